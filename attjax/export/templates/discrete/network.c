void attjax_logits(const float quaternion[4], const float angular_velocity[3],
                   float logits[ATTJAX_ACTIONS])
{
$forward
}

$allow$admit