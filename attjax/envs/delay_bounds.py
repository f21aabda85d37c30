"""When the torques of commands come, at the earliest and at the latest."""

from attjax.envs.context import Context
from attjax.envs.torque_bounds import delays, high, low
from attjax.spacecraft import INTEGRATION_STEP
from attjax.world import World


def late(world: World, context: Context) -> int:
    """RK4 steps that a torque can come earlier or later than is believed."""
    return max(abs(end - context.knowledge.delay) for end in delays(world.actuators))


def uncounted(world: World, context: Context) -> float:
    """Torques at most of which it can be wrong whether they have come when another one begins.

    What is told at a decision is the work of those that have come by then; the others are added to
    it. Of commands n periods old, one with the delay D is still to come if n ≤ D/T. Of held
    torques it is the share of one by which those that have come are more or fewer.
    """
    steps = _steps(context)
    if context.agent_step.held:
        return late(world, context) / steps
    first, last = (end // steps for end in delays(world.actuators))
    believed = context.knowledge.delay // steps
    if world.actuators is not None and world.actuators.delay_jitter != 0:
        return last - first  # some too early, others too late
    return max(last - believed, believed - first)


def check_order(world: World, context: Context) -> None:
    """Check that torques come in the order of their commands.

    Raises:
        ValueError: they may not.
    """
    if world.actuators is None:
        return
    jitter, steps = world.actuators.delay_jitter, _steps(context)
    spread = round(high(jitter)) - round(low(jitter))
    if spread >= steps:
        raise ValueError(
            f"assurance needs torques in the order of their commands; delay_jitter is of up to "
            f"{spread} RK4 steps, a control period of {steps}"
        )


def _steps(context):
    return round(float(context.control_period) / INTEGRATION_STEP)
