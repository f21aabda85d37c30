#define ATTJAX_CONTROL_PERIOD $control_period /* s */
#define ATTJAX_PULSE $pulse /* s */
#define ATTJAX_RATE_LIMIT $rate_limit /* rad/s */

/*
 * The torque for the present state, about the axes of the body frame, N m: of a magnitude of
 * ($largest) at most.
 *
$state
 *
 * If a number is not finite, or the state so large that single precision does not hold what the
 * network computes of it, there is no torque: {0, 0, 0}.
 */
void attjax_torque(const float quaternion[4], const float angular_velocity[3], float torque[3]);
