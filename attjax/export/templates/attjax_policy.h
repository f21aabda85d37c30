/*
 * Attitude control policy: which of $actions torques to apply next.
 *
 * Where it comes from:
 *
$facts
 *
 * Call attjax_decide once every ATTJAX_CONTROL_PERIOD, then apply the torque
 * attjax_torque_table[action] for the first ATTJAX_PULSE of that period.
 *
 * It is for one spacecraft alone, for these torques, this control period and this rate limit, and
 * for a desired frame that does not turn; whether it was trained for them stands above.
 *
 *   inertia:     $inertia
 *   rate limit:  $kept_rate
 *
 * Static size:  $constant_bytes bytes of constants, no variables;
 *               $stack_bytes bytes of arrays on the stack, at most, in a call.
 * A decision:   $multiply_adds multiply-adds, $tanh calls of tanhf, at most $comparisons comparisons and
 *               $other other floating-point operations, whatever the state.
 *
 * C99, single precision, no allocation, no state, no dependency beyond math.h.
 */
#ifndef ATTJAX_POLICY_H
#define ATTJAX_POLICY_H

#ifdef __cplusplus
extern "C" {
#endif

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
 * quaternion: error quaternion {q1, q2, q3, qs}, scalar last, of unit length: the rotation that
 *     takes the axes of the desired frame to those of the body; {0, 0, 0, 1} is the goal. Its
 *     rate is 0.5 * {w3 q2 - w2 q3 + w1 qs, w1 q3 - w3 q1 + w2 qs, w2 q1 - w1 q2 + w3 qs,
 *     -(w1 q1 + w2 q2 + w3 q3)}. q and -q are the same attitude but not the same to the policy:
 *     start a slew with qs >= 0, and let the sign be continuous after that.
 * angular_velocity: of the body with respect to the desired frame, in the body frame, rad/s.
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

#ifdef __cplusplus
}
#endif

#endif
