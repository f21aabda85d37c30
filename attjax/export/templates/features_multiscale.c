#define SCALES $scales

/* Factors of the state: the first resolves the slew, the last its end. */
static const float scales[SCALES] = $scale_values;

/*
 * tanh(k x) for every scale k, of x = (q1, q2, q3) * $feature_period s / control period and of the
 * angular velocity; then qs, the control period in 0.1 s, and the logarithm of that.
 */
static void features_of(const float q[4], const float w[3], float features[FEATURES])
{
    for (int s = 0; s < SCALES; s++) {
        for (int i = 0; i < 3; i++) {
            features[6 * s + i] = tanhf(scales[s] * (q[i] * $attitude_factor));
            features[6 * s + 3 + i] = tanhf(scales[s] * w[i]);
        }
    }
    features[6 * SCALES] = q[3];
$period
}
