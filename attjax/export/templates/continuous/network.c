static void network(const float quaternion[4], const float angular_velocity[3], float outputs[3])
{
$forward
}
