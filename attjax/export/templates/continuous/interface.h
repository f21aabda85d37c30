#define ATTJAX_CONTROL_PERIOD $control_period /* s */
#define ATTJAX_PULSE $pulse /* s */
#define ATTJAX_RATE_LIMIT $rate_limit /* rad/s */

/*
 * The torque for the present state, about the axes of the body frame, N m: of a magnitude of
 * ($largest) at most.
 *
$state
 *
 * If a number is not finite, there is no torque: {0, 0, 0}; nor is there one if the network leads
 * to NaN, as it may of numbers that are near the end of single precision.
 */
void attjax_torque(const float quaternion[4], const float angular_velocity[3], float torque[3]);
