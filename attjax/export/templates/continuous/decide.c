void attjax_torque(const float quaternion[4], const float angular_velocity[3], float torque[3])
{
    float outputs[3] = {0.0f, 0.0f, 0.0f};

    if (all_finite(quaternion, angular_velocity)) {
        network(quaternion, angular_velocity, outputs);
    }
    if (isnan(outputs[0]) || isnan(outputs[1]) || isnan(outputs[2])) {
        outputs[0] = outputs[1] = outputs[2] = 0.0f;
    }
    for (int i = 0; i < 3; i++) {
        torque[i] = largest_torque[i] * tanhf(outputs[i]);
    }
}
