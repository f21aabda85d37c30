"""Deliberate faults of what flies any spacecraft, for faults.py: known torques, dead axes."""

KNOWN = ["tests/envs/test_known_disturbance.py"]
WAY = ["tests/envs/test_way.py"]
INPUTS = ["tests/control/test_universal.py"]
FLIGHT = ["tests/runs/test_flight.py"]
AGENT_FAULTS = {
    "a known torque while a commanded one is on alone": (
        "attjax/dynamics/equations.py", "return self._replace(torque=None)",
        "return self._replace(torque=None, pushing=None)", KNOWN,
    ),
    "leaned as far for a pulse as for a held torque": (
        "attjax/envs/leaning.py", "(context.control_period + context.torque_duration) / 2",
        "context.control_period", KNOWN,
    ),
    "an observation that is not leaned": (
        "attjax/envs/attitude.py", "return leaned(observation, self.context(params))",
        "return observation", KNOWN,
    ),
    "a way round an area without its corner": (
        "attjax/envs/way.py", "corner = area + x * y / 2", "corner = area", WAY,
    ),
    "Euler's angles about one of the two axes first alone": (
        "attjax/envs/way.py", "_by_euler(scalar, second, first, third)",
        "_by_euler(scalar, first, second, third)", WAY,
    ),
    "once round for nothing": (
        "attjax/envs/way.py", "half_sum = abs(jnp.arctan2(first, scalar))",
        "half_sum = abs(jnp.arctan2(first, abs(scalar)))", WAY,
    ),
    "a known torque about an axis that is called backward": (
        "attjax/control/universal.py", "pushes = [sign] * len(PUSH_SCALES)",
        "pushes = [abs(sign)] * len(PUSH_SCALES)", INPUTS,
    ),
    "a dead axis where its momentum puts it": (
        "attjax/control/torque_order.py", "jnp.where(dead, jnp.inf, moments)", "moments", INPUTS,
    ),
    "torques about a dead axis to choose from": (
        "attjax/ppo/networks.py", "allowed &= torque_order.alive(context)", "pass", INPUTS,
    ),
    "the policy for a whole spacecraft, whatever is dead": (
        "attjax/ppo/crew.py", "jnp.where(torque_order.is_crippled(context), crippled, whole)",
        "whole", FLIGHT,
    ),
    "the gains of the law by default": (
        "attjax/control/classical.py", "2 * gains.braking_margin", "2 * GAINS.braking_margin",
        ["tests/control/test_classical.py"],
    ),
    "a constant torque in a world that has its own": (
        "attjax/runs/build.py", "drawn = drawn._replace(disturbance=None)", "pass",
        ["tests/runs/test_fleet_runs.py"],
    ),
}  # fmt: skip
"""As faults.FAULTS."""
