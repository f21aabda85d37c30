/* The state vector: error quaternion, its rate (1/s) and angular velocity (rad/s). */
static void features_of(const float q[4], const float w[3], float features[FEATURES])
{
    for (int i = 0; i < 4; i++) {
        features[i] = q[i];
    }
    features[4] = 0.5f * (w[2] * q[1] - w[1] * q[2] + w[0] * q[3]);
    features[5] = 0.5f * (w[0] * q[2] - w[2] * q[0] + w[1] * q[3]);
    features[6] = 0.5f * (w[1] * q[0] - w[0] * q[1] + w[2] * q[3]);
    features[7] = -0.5f * (w[0] * q[0] + w[1] * q[1] + w[2] * q[2]);
    for (int i = 0; i < 3; i++) {
        features[8 + i] = w[i];
    }
}
