
/*
 * All plants that the assurance is for, in the principal axes of the believed inertia: these axes,
 * as columns; of P^2 = w.Aw the largest elements of A; the least and largest of what an impulse
 * works by, 1/(kg m^2).
 */
static const float axes[3][3] = $axes;
static const float form[3] = $plants_form;
static const float least_work[3] = $least_work;
static const float most_work[3] = $most_work;

/*
 * Of each action: its impulse, N m s; the least and largest share of it that there may be; what
 * its direction and the axes can be off by, of its own and of its work; what else there is of an
 * impulse; what it changes P by at most, from rest, rad/s; how far the body turns meanwhile; what
 * an error of the rate adds, (rad/s)^2.
 */
static const float torque_impulse[ATTJAX_ACTIONS][3] = $torque_impulse;
static const float least_share[ATTJAX_ACTIONS] = $least_share;
static const float most_share[ATTJAX_ACTIONS] = $most_share;
static const float tilted[ATTJAX_ACTIONS] = $tilted;
static const float tilted_work[ATTJAX_ACTIONS] = $tilted_work;
static const float other_impulse[ATTJAX_ACTIONS] = $other_impulse;
static const float growth[ATTJAX_ACTIONS] = $growth;
static const float turning[ATTJAX_ACTIONS] = $turning;
static const float of_rate_error[ATTJAX_ACTIONS] = $of_rate_error;

static float larger(float x, float y)
{
    return x > y ? x : y;
}

$cones
void attjax_admit(const float quaternion[4], const float angular_velocity[3],
                  int admitted[ATTJAX_ACTIONS])
{
    const float *w = angular_velocity;
    const float level_squared = ATTJAX_LEVEL * ATTJAX_LEVEL;
    float rate[3], change[ATTJAX_ACTIONS];
    float speed = 0.0f, peak = 0.0f, working = 0.0f;
    float worked, squared, most;
    int braking = 0;

    for (int i = 0; i < 3; i++) {
        rate[i] = w[0] * axes[0][i] + w[1] * axes[1][i] + w[2] * axes[2][i];
        speed += rate[i] * rate[i];
        peak += form[i] * rate[i] * rate[i];
        worked = most_work[i] * rate[i];
        working += worked * worked;
    }
    speed = sqrtf(speed);
    peak = sqrtf(peak) + $peak_error;
    working = sqrtf(working) + $turned_inverse * speed;
    squared = peak * peak;
$kept    most = peak < ATTJAX_LEVEL ? peak : ATTJAX_LEVEL;
    for (int a = 0; a < ATTJAX_ACTIONS; a++) {
        const float *impulse_a = torque_impulse[a];
        const float after = most + growth[a];
        float work = 0.0f;
        for (int i = 0; i < 3; i++) {
            const float product = impulse_a[i] * rate[i];
            work += larger(most_work[i] * product, least_work[i] * product);
        }
        work += tilted[a] * working + tilted_work[a] * speed;
        work = larger(least_share[a] * work, most_share[a] * work) + other_impulse[a] * working;
        change[a] = 2.0f * work + growth[a] * growth[a]
                    + ($square * after + $linear) * after * turning[a]
                    + $feeding * after * after + of_rate_error[a];
        admitted[a] = (squared + change[a] <= level_squared || change[a] <= 0.0f)$within;
        braking = change[a] < change[braking] ? a : braking;
    }
    admitted[braking] = 1;
}

/* Of the actions that are allowed those that are admitted; if there is none, the first of these. */
static void keep_admitted(const float quaternion[4], const float angular_velocity[3],
                          int allowed[ATTJAX_ACTIONS])
{
    int admitted[ATTJAX_ACTIONS];
    int first = -1, is_left = 0;

    attjax_admit(quaternion, angular_velocity, admitted);
    for (int a = 0; a < ATTJAX_ACTIONS; a++) {
        first = first < 0 && admitted[a] ? a : first;
        allowed[a] = allowed[a] && admitted[a];
        is_left = is_left || allowed[a];
    }
    allowed[first] = allowed[first] || !is_left;
}
