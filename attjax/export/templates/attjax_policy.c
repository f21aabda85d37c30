/*
 * Attitude control policy; see attjax_policy.h.
 *
$facts
 */
#include "attjax_policy.h"

#include <math.h>

#if defined __FAST_MATH__ || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__)
#error "without infinities and NaN (-ffast-math) a spoilt state would not lead to no torque"
#endif

#ifdef __cplusplus
#define restrict /* which C++ does not have */
#endif

#define FEATURES $features

$torques
$weights
$features_function
/* y = Wx + b. The weights of one input lie side by side. */
static void layer(int inputs, int outputs, const float *restrict weights,
                  const float *restrict biases, const float *restrict x, float *restrict y)
{
    for (int o = 0; o < outputs; o++) {
        y[o] = biases[o];
    }
    for (int i = 0; i < inputs; i++) {
        const float *row = weights + i * outputs;
        for (int o = 0; o < outputs; o++) {
            y[o] += row[o] * x[i];
        }
    }
}

/* Rectified linear units, in place. */
static void rectify(int size, float *x)
{
    for (int i = 0; i < size; i++) {
        x[i] = x[i] > 0.0f ? x[i] : 0.0f;
    }
}

$network
static int all_finite(const float quaternion[4], const float angular_velocity[3])
{
    int result = 1;
    for (int i = 0; i < 4; i++) {
        result = result && isfinite(quaternion[i]);
    }
    for (int i = 0; i < 3; i++) {
        result = result && isfinite(angular_velocity[i]);
    }
    return result;
}

$decide