"""The simulator's contenders: which there are, how to build their flights, which are absent."""

import dataclasses
import functools
import importlib
from collections.abc import Callable

import batch
import ceiling
import rollouts
from common import Flight, seconds

STEPS_OF_ONE = 50
"""Agent steps that a lone spacecraft in Python flies in a call."""

FUSED, PHYSICS, USER = "attjax fused rollout", "attjax physics only", "attjax, user's vmap+scan"
C_FULL, C_PHYSICS = "C ceiling, full step", "C ceiling, physics only"
CEILINGS = (C_FULL, C_PHYSICS)
NUMPY, NUMBA = "NumPy batch", "Numba batch"
MAKE_VEC, GYM_BENCHMARK = "attjax, Gymnasium make_vec", "benchmark_vector_step"
GYM, BASILISK = "Numba RK4 in a Gym class", "Basilisk in an RL loop"


@dataclasses.dataclass(frozen=True)
class Contender:
    """A way to simulate.

    Attributes:
        name: in the table.
        build: makes the flight of a number of spacecraft.
        full: observation, reward, end of episode and reset too, not the physics alone.
        one: it flies one spacecraft only.
    """

    name: str
    build: Callable[[int], Flight]
    full: bool = True
    one: bool = False


def find(device: str, cores: int) -> tuple[list[Contender], dict[str, str]]:
    """The contenders, and by name why others are absent.

    Those in C, NumPy and Numba are checked against attjax first.

    Raises:
        ArithmeticError: one differs from attjax.
    """
    found = [
        Contender(FUSED, lambda num_envs: rollouts.fused(num_envs, min(num_envs, cores))),
        Contender(PHYSICS, rollouts.physics, full=False),
        Contender(USER, rollouts.users_scan),
    ]
    absent = {}
    _add_make_vec(found, absent)
    if device == "cpu":
        for add in (_add_ceiling, _add_numpy, _add_numba, _add_basilisk):
            add(found, absent)
    return found, absent


def _add_make_vec(found, absent):
    try:
        gymnasium = importlib.import_module("gymnasium")
    except ImportError:
        absent |= dict.fromkeys((MAKE_VEC, GYM_BENCHMARK), "not installed (pip install gymnasium)")
        return
    name = importlib.import_module("attjax.wrappers.gymnasium").ID
    performance = importlib.import_module("gymnasium.utils.performance")

    def build(num_envs, times_itself):
        envs = gymnasium.make_vec(name, num_envs=num_envs)
        envs.reset(seed=0)
        call = functools.partial(envs.step, batch.random_actions(1, num_envs)[0])
        own_rate = functools.partial(performance.benchmark_vector_step, envs, seed=0)
        return Flight(call, num_envs, seconds(call), own_rate if times_itself else None)

    found.append(Contender(MAKE_VEC, functools.partial(build, times_itself=False)))
    found.append(Contender(GYM_BENCHMARK, functools.partial(build, times_itself=True)))


def _add_ceiling(found, absent):
    reason = ceiling.missing()
    if reason is not None:
        absent |= dict.fromkeys(CEILINGS, reason)
        return
    fleet = ceiling.CeilingBatch(batch.CHECKED_SPACECRAFT)
    batch.check_physics(fleet)
    batch.check_full(fleet)
    found.append(Contender(C_FULL, functools.partial(_in_c, "full")))
    found.append(Contender(C_PHYSICS, functools.partial(_in_c, "physics"), full=False))


def _in_c(method, num_envs):
    fleet = ceiling.CeilingBatch(num_envs)
    actions = batch.random_actions(rollouts.steps_a_call(num_envs), fleet.size)
    call = functools.partial(getattr(fleet, method), actions)
    return Flight(call, len(actions) * num_envs, fleet.compile_s)


def _add_numpy(found, absent):
    batch.check_full(batch.NumpyBatch(batch.CHECKED_SPACECRAFT))
    found.append(Contender(NUMPY, functools.partial(_in_arrays, batch.NumpyBatch)))


def _in_arrays(kind, num_envs):
    fleet = kind(num_envs)
    call = functools.partial(fleet.full, batch.random_actions(1, num_envs))
    return Flight(call, num_envs)


def _add_numba(found, absent):
    try:
        peer = importlib.import_module("numba_peer")
    except ImportError:
        absent |= dict.fromkeys((NUMBA, GYM), "not installed (pip install numba)")
        return
    compile_s = seconds(functools.partial(_in_arrays(peer.NumbaBatch, 1).call))
    batch.check_full(peer.NumbaBatch(batch.CHECKED_SPACECRAFT))

    def build(num_envs):
        flight = _in_arrays(peer.NumbaBatch, num_envs)
        return dataclasses.replace(flight, compile_s=compile_s)

    found.append(Contender(NUMBA, build))
    found.append(Contender(GYM, functools.partial(_alone, peer.NumbaSlew), one=True))


def _add_basilisk(found, absent):
    try:
        peer = importlib.import_module("basilisk_peer")
    except ImportError:
        absent[BASILISK] = "not installed (pip install bsk)"
        return
    found.append(Contender(BASILISK, functools.partial(_alone, peer.BasiliskSlew), one=True))


def _alone(kind, num_envs):
    env = kind()
    actions = batch.random_actions(STEPS_OF_ONE, num_envs)[:, 0]
    compile_s = seconds(lambda: env.fly(actions))
    return Flight(lambda: env.fly(actions), STEPS_OF_ONE, compile_s)
