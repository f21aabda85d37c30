/* The state vector: error quaternion, its rate (1/s) and angular velocity (rad/s). */
static void features_of(const float q[4], const float w[3], float features[FEATURES])
{
    for (int i = 0; i < 4; i++) {
        features[i] = q[i];
    }
$quaternion_rate
    for (int i = 0; i < 3; i++) {
        features[8 + i] = w[i];
    }
}
