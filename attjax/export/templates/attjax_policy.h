/*
 * Attitude control policy: $title.
 *
 * Where it comes from:
 *
$facts
 *
 * Call $function once every ATTJAX_CONTROL_PERIOD, then apply the torque
 * $given for the first ATTJAX_PULSE of that period.
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

$interface
#ifdef __cplusplus
}
#endif

#endif
