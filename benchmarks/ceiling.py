"""The agent step in hand-vectorised C (ceiling.c): the ceiling of one core."""

import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import common
import numpy as np
from batch import Batch

SOURCE = Path(__file__).with_suffix(".c")
# Not -ffast-math: linked into a library, it makes the whole process flush denormal numbers.
FLAGS = [
    *("-O3", "-march=native", "-shared", "-fPIC", "-ffp-contract=fast", "-freciprocal-math"),
    *("-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros", "-ffinite-math-only"),
    *("-fschedule-insns", "-fsched-pressure"),
]
TABLE_WIDTH = 32
"""Places for the torques about an axis: two registers of 16."""


class Parameters(ctypes.Structure):
    """The C structure ``parameters``."""

    _fields_ = (
        ("inertia", ctypes.c_float * 3),
        ("table", ctypes.c_float * (3 * TABLE_WIDTH)),
        ("rate_limit", ctypes.c_float),
        ("goal_angle", ctypes.c_float),
        ("min_slew", ctypes.c_float),
        ("max_slew", ctypes.c_float),
        ("max_steps", ctypes.c_int32),
    )


def missing() -> str | None:
    """Why the ceiling cannot be had, or None."""
    try:
        library()
    except (OSError, subprocess.CalledProcessError) as error:
        return "no C compiler" if _compiler() is None else f"does not compile: {error}"
    return None


def _compiler():
    return shutil.which("gcc") or shutil.which("cc")


@functools.cache
def library() -> tuple[ctypes.CDLL, float]:
    """The compiled library, and the seconds that compiling took."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "ceiling.so"
        command = [_compiler() or "cc", *FLAGS, str(SOURCE), "-o", str(target), "-lm"]
        compile_s = common.seconds(lambda: subprocess.run(command, check=True, capture_output=True))
        return ctypes.CDLL(str(target)), compile_s


class CeilingBatch(Batch):
    """Flown by ceiling.c, in whole registers of spacecraft."""

    def __init__(self, num_envs: int):
        self.library, self.compile_s = library()
        super().__init__(num_envs, multiple=self.library.lanes())
        self.parameters = _parameters(self.params)
        self.seed = ctypes.c_uint64(1)

    def physics(self, actions: np.ndarray) -> None:
        """Fly (steps, size) actions, without reward, observation and end of episode."""
        state = (self.quaternion, self.angular_velocity)
        self._call(self.library.physics, actions, *state, actions, self.parameters)

    def full(self, actions: np.ndarray) -> None:
        """Fly (steps, size) actions."""
        state = (self.quaternion, self.angular_velocity, self.time)
        results = (self.observation, self.reward, self.ended, self.seed)
        self._call(self.library.full, actions, *state, actions, self.parameters, *results)

    def _call(self, function, actions, *arguments):
        pointers = [
            x.ctypes.data_as(ctypes.c_void_p) if isinstance(x, np.ndarray) else ctypes.byref(x)
            for x in arguments
        ]
        function(*actions.shape, *pointers)


def _parameters(params):
    table = np.zeros((3, TABLE_WIDTH), np.float32)
    table[:, : len(params.torque_table)] = np.asarray(params.torque_table).T
    return Parameters(
        inertia=tuple(np.asarray(params.inertia).tolist()),
        table=tuple(table.ravel().tolist()),
        rate_limit=float(params.rate_limit),
        goal_angle=float(params.goal_angle),
        min_slew=float(params.min_slew_angle),
        max_slew=float(params.max_slew_angle),
        max_steps=int(params.max_steps_in_episode),
    )
