#define SCALES $scales

/* Factors of the state: the first resolves the slew, the last its end. */
static const float scales[SCALES] = $scale_values;

/* The spacecraft's own units: its largest impulse is 1, its control period is 1. */
static const float of_vector[9] = $of_vector;
static const float of_rate[9] = $of_rate;
static const float momentum[9] = $momentum;

/* Directions of the torque axes; the same over the rate limit; what kind of spacecraft it is. */
static const float directions[9] = $directions;
static const float slowness[9] = $slowness;
static const float constants[$constant_count] = $constants;

static float product(const float row[3], const float x[3])
{
    return row[0] * x[0] + row[1] * x[1] + row[2] * x[2];
}

/*
 * tanh(k x) for every scale k, of the turn z to the goal as z / sqrt(1 + |z|) and of the momentum,
 * both in the spacecraft's own units and along its torque axes; then the attitude, and the rate over
 * its limit, along these axes, and the constants.
 */
static void features_of(const float q[4], const float w[3], float features[FEATURES])
{
    float own[6];
    float *rest = features + 6 * SCALES;
    for (int i = 0; i < 3; i++) {
        const float z = product(of_vector + 3 * i, q) + product(of_rate + 3 * i, w);
        own[i] = z / sqrtf(1.0f + fabsf(z));
        own[3 + i] = product(momentum + 3 * i, w);
        rest[i] = product(directions + 3 * i, q);
        rest[4 + i] = product(slowness + 3 * i, w);
    }
    rest[3] = q[3];
    for (int i = 0; i < $constant_count; i++) {
        rest[7 + i] = constants[i];
    }
    for (int s = 0; s < SCALES; s++) {
        for (int i = 0; i < 6; i++) {
            features[6 * s + i] = tanhf(scales[s] * own[i]);
        }
    }
}
