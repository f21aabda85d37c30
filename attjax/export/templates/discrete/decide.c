int attjax_decide(const float quaternion[4], const float angular_velocity[3])
{
    float logits[ATTJAX_ACTIONS];
    int allowed[ATTJAX_ACTIONS];
    int best = -1;

    if (!all_finite(quaternion, angular_velocity)) {
        return ATTJAX_NO_TORQUE;
    }
    attjax_logits(quaternion, angular_velocity, logits);
    allow(angular_velocity, allowed);
$keep    for (int a = 0; a < ATTJAX_ACTIONS; a++) {
        if (allowed[a] && (best < 0 || logits[a] > logits[best])) {
            best = a; /* the first of equal ones */
        }
    }
    return best; /* none is no case: no torque is always allowed */
}
