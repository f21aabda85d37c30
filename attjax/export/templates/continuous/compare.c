/*
 * How far rounding may move a torque from that in attjax, N m: $roundings times the largest difference
 * there between single and double precision, at the states that the vectors are of.
 */
#define TOLERANCE $tolerance

/* Returns how many torques differ from those in attjax. */
static int compare(void)
{
    int failures = 0;
    float largest = 0.0f;

    for (int v = 0; v < VECTORS; v++) {
        float torque[3];
        int differs = 0;
        attjax_torque(vectors[v].quaternion, vectors[v].angular_velocity, torque);
        for (int i = 0; i < 3; i++) {
            const float difference = fabsf(torque[i] - vectors[v].torque[i]);
            differs = differs || !(difference <= TOLERANCE); /* of NaN, too */
            largest = fmaxf(largest, difference);
        }
        failures += differs;
    }
    printf("vectors: %d of %d decisions as in attjax, within %.3g N m", VECTORS - failures,
           VECTORS, (double)TOLERANCE);
    printf("; the largest difference is %.3g\n", (double)largest);
    return failures;
}

/* Whether any torque follows a state. */
static int turns(const float x[STATE])
{
    float torque[3];

    attjax_torque(x, x + 4, torque);
    return !(torque[0] == 0.0f && torque[1] == 0.0f && torque[2] == 0.0f);
}
