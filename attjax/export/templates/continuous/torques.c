/* Largest torque about each axis of the body frame, N m. */
static const float largest_torque[3] = $largest_torque;
