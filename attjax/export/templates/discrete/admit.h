
#define ATTJAX_LEVEL $level /* of the peak rate, that is kept, rad/s */

/*
 * Which actions the assurance lets through in a finite state, 1 or 0 each and at least one of them
 * 1: for a controller of your own, for telemetry and tests. attjax_decide takes no other, but
 * where a number is not finite.
 *
 * The state is that of the moment at which the torque begins: where commands are late, predict it.
 */
void attjax_admit(const float quaternion[4], const float angular_velocity[3],
                  int admitted[ATTJAX_ACTIONS]);
