/*
 * Tests the policy on the machine where it is to fly: the decisions of attjax_vectors.h, numbers
 * that are not finite, and slews in a closed loop with a rigid body in double precision. Prints
 * what it finds and the time of a decision. The exit status is 0 if all is well: the decisions are
 * as in attjax, no torque follows what is not finite, and each slew ends within the goal angle
 * without ever having passed the rate limit.
 *
 *     cc -std=c99 -O2 attjax_test.c attjax_policy.c -o attjax_test -lm && ./attjax_test
 *
$facts
 */
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "attjax_policy.h"
#include "attjax_vectors.h"

#define STATE 7 /* error quaternion, scalar last, and angular velocity */
#define STEP (1.0 / 240.0)
#define GOAL_DEG $goal_deg
#define DEG_PER_RAD 57.295779513082321
#define TIMED 200 /* passes over the vectors */

/* Euler's equations and the quaternion's kinematics. */
static void rate(const double x[STATE], const float torque[3], double dx[STATE])
{
    const double *q = x, *w = x + 4;
    double h[3], moment[3];

    dx[0] = 0.5 * (w[2] * q[1] - w[1] * q[2] + w[0] * q[3]);
    dx[1] = 0.5 * (w[0] * q[2] - w[2] * q[0] + w[1] * q[3]);
    dx[2] = 0.5 * (w[1] * q[0] - w[0] * q[1] + w[2] * q[3]);
    dx[3] = -0.5 * (w[0] * q[0] + w[1] * q[1] + w[2] * q[2]);
    for (int i = 0; i < 3; i++) {
        h[i] = inertia[i][0] * w[0] + inertia[i][1] * w[1] + inertia[i][2] * w[2];
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        moment[i] = (double)torque[i] - (w[j] * h[k] - w[k] * h[j]);
    }
    for (int i = 0; i < 3; i++) {
        const double *row = inverse[i];
        dx[4 + i] = row[0] * moment[0] + row[1] * moment[1] + row[2] * moment[2];
    }
}

/* One Runge-Kutta step of fourth order. */
static void advance(double x[STATE], const float torque[3])
{
    static const double node[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    double k[STATE] = {0.0}, sum[STATE] = {0.0}, stage[STATE];

    for (int n = 0; n < 4; n++) {
        for (int i = 0; i < STATE; i++) {
            stage[i] = x[i] + node[n] * STEP * k[i];
        }
        rate(stage, torque, k);
        for (int i = 0; i < STATE; i++) {
            sum[i] += weight[n] * k[i];
        }
    }
    for (int i = 0; i < STATE; i++) {
        x[i] += STEP * sum[i];
    }
}

static double norm(const double *x, int size)
{
    double sum = 0.0;
    for (int i = 0; i < size; i++) {
        sum += x[i] * x[i];
    }
    return sqrt(sum);
}

/* One control period: the policy decides, the torque acts, and the spacecraft coasts. */
static void control(double x[STATE])
{
    static const float none[3] = {0.0f, 0.0f, 0.0f};
    $torque_declared
    float single[STATE];
    double length;

    for (int i = 0; i < STATE; i++) {
        single[i] = (float)x[i];
    }
    $torque_decided
    for (int n = 0; n < TORQUE_STEPS; n++) {
        advance(x, torque);
    }
    for (int n = 0; n < COASTING_STEPS; n++) {
        advance(x, none);
    }
    length = norm(x, 4);
    for (int i = 0; i < 4; i++) {
        x[i] /= length;
    }
}

/* Fly the slews; returns how many miss the goal or pass the rate limit, as in attjax or not. */
static int fly(void)
{
    int failures = 0;

    for (int s = 0; s < SLEWS; s++) {
        double x[STATE] = {0.0};
        double error, largest_rate = 0.0;
        for (int i = 0; i < 4; i++) {
            x[i] = slew_start[s][i];
        }
        for (int n = 0; n < DECISIONS; n++) {
            control(x);
            largest_rate = fmax(largest_rate, norm(x + 4, 3));
        }
        error = 2.0 * atan2(norm(x, 3), x[3]) * DEG_PER_RAD;
        printf("slew %d: error at the end %.6f deg, in attjax %.6f; ", s + 1, error,
               slew_error_deg[s]);
        printf("rate %.6f rad/s, in attjax %.6f\n", norm(x + 4, 3), slew_rate[s]);
        if (!(error <= GOAL_DEG)$unless_held) { /* of NaN, too */
            printf("slew %d: FAILED: the goal is an error of %g deg at most\n", s + 1, GOAL_DEG);
            failures++;
        } else if (!(largest_rate <= (double)ATTJAX_RATE_LIMIT)) {
            printf("slew %d: FAILED: a rate of %.6f rad/s passes the limit of %g\n", s + 1,
                   largest_rate, (double)ATTJAX_RATE_LIMIT);
            failures++;
        }
    }
    return failures;
}

$compare
/* Returns in how many of its places a number that is not finite does not lead to no torque. */
static int spoil(void)
{
    int failures = 0;

    for (int i = 0; i < STATE; i++) {
        float x[STATE] = {0.0f, 0.0f, 0.0f, 1.0f, 0.1f, 0.1f, 0.1f};
        x[i] = NAN;
        failures += $turns;
        x[i] = INFINITY;
        failures += $turns;
    }
    printf("not finite: %d of %d lead to no torque\n", 2 * STATE - failures, 2 * STATE);
    return failures;
}

static void measure(void)
{
    const clock_t start = clock();
    $sink

    for (int n = 0; n < TIMED; n++) {
        for (int v = 0; v < VECTORS; v++) {
            $timed
        }
    }
    (void)sink;
    printf("time: %.0f ns a decision\n",
           1e9 * (double)(clock() - start) / CLOCKS_PER_SEC / (TIMED * VECTORS));
}

int main(void)
{
    const int failures = compare() + spoil() + fly();

    measure();
    printf(failures == 0 ? "passed\n" : "FAILED\n");
    return failures != 0;
}
