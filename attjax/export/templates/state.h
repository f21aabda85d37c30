 * quaternion: error quaternion {q1, q2, q3, qs}, scalar last, of unit length: the rotation that
 *     takes the axes of the desired frame to those of the body; {0, 0, 0, 1} is the goal. Its
 *     rate is 0.5 * {w3 q2 - w2 q3 + w1 qs, w1 q3 - w3 q1 + w2 qs, w2 q1 - w1 q2 + w3 qs,
 *     -(w1 q1 + w2 q2 + w3 q3)}. q and -q are the same attitude but not the same to the policy:
 *     start a slew with qs >= 0, and let the sign be continuous after that.
 * angular_velocity: of the body with respect to the desired frame, in the body frame, rad/s.
