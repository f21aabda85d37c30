#define SCALES $scales
#define SLEW_SCALES $slew_scales

/* Factors of the state in the spacecraft's own units, and over a slew's length. */
static const float scales[SCALES] = $scale_values;
static const float slew_scales[SLEW_SCALES] = $slew_scale_values;

/* The spacecraft's own units: its largest impulse is 1, its control period is 1. */
static const float of_vector[9] = $of_vector;
static const float of_rate[9] = $of_rate;
static const float momentum[9] = $momentum;

/* Length of a turn of 1 rad about each torque axis, in control periods. */
static const float lengths[3] = $lengths;

/* Directions of the torque axes; the same over the rate limit; what kind of spacecraft it is. */
static const float directions[9] = $directions;
static const float slowness[9] = $slowness;
static const float constants[$constant_count] = $constants;

/* Axes of the products of inertia among the constants. */
static const int pairs[3][2] = $pairs;

static float product(const float row[3], const float x[3])
{
    return row[0] * x[0] + row[1] * x[1] + row[2] * x[2];
}

/*
 * tanh(k x) for every scale k, of the turn z to the goal as z / sqrt(1 + |z|) and of the momentum,
 * both in the spacecraft's own units and along its torque axes; the same over a slew's length; then
 * the attitude, and the rate over its limit, along these axes, and the constants.
 *
 * Where z is negative, what is called forward about that axis is backward.
 */
static void features_of(const float q[4], const float w[3], float features[FEATURES],
                        int backward[3])
{
    float own[6], sign[3];
    float *slew = features + 6 * SCALES, *rest = slew + 6 * SLEW_SCALES;
    for (int i = 0; i < 3; i++) {
        const float z = product(of_vector + 3 * i, q) + product(of_rate + 3 * i, w);
        backward[i] = z < 0.0f;
        sign[i] = backward[i] ? -1.0f : 1.0f;
        own[i] = fabsf(z) / sqrtf(1.0f + fabsf(z));
        own[3 + i] = sign[i] * product(momentum + 3 * i, w);
        rest[i] = sign[i] * product(directions + 3 * i, q);
        rest[4 + i] = sign[i] * product(slowness + 3 * i, w);
    }
    rest[3] = q[3];
    for (int i = 0; i < $constant_count; i++) {
        rest[7 + i] = constants[i];
    }
    for (int i = 0; i < 3; i++) {
        rest[7 + $first_product + i] *= sign[pairs[i][0]] * sign[pairs[i][1]];
    }
    rest[7 + $hand] *= sign[0] * sign[1] * sign[2];
    for (int i = 0; i < $pushes; i++) {
        rest[7 + $first_push + i] *= sign[i % 3];
    }
    for (int s = 0; s < SCALES; s++) {
        for (int i = 0; i < 6; i++) {
            features[6 * s + i] = tanhf(scales[s] * own[i]);
        }
    }
    for (int s = 0; s < SLEW_SCALES; s++) {
        for (int i = 0; i < 6; i++) {
            slew[6 * s + i] = tanhf(slew_scales[s] * (own[i] / lengths[i % 3]));
        }
    }
}

/* Of actions about axes where backward is called forward: up is down, and down is up. */
static void turn_back(const int backward[3], float *actions)
{
    for (int pair = 0; pair < 3 * $levels; pair++) {
        if (backward[pair % 3]) {
            float *up = actions + 1 + 2 * pair;
            const float down = up[1];
            up[1] = up[0];
            up[0] = down;
        }
    }
}
