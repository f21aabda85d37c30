#define ATTJAX_ACTIONS $actions
#define ATTJAX_NO_TORQUE $no_torque /* the action without torque */
#define ATTJAX_CONTROL_PERIOD $control_period /* s */
#define ATTJAX_PULSE $pulse /* s */
#define ATTJAX_RATE_LIMIT $rate_limit /* rad/s */

/* Torque of each action about the axes of the body frame, N m. */
extern const float attjax_torque_table[ATTJAX_ACTIONS][3];

/*
 * The action for the present state, from 0 to ATTJAX_ACTIONS - 1.
 *
$state
 *
 * If a number is not finite, the action is ATTJAX_NO_TORQUE.
 */
int attjax_decide(const float quaternion[4], const float angular_velocity[3]);

/*
 * The logits of all actions for a finite state, for telemetry and tests. They are not masked:
 * attjax_decide takes the first largest among the actions that are allowed.
 */
void attjax_logits(const float quaternion[4], const float angular_velocity[3],
                   float logits[ATTJAX_ACTIONS]);
$admit_declared