"""Frames of spacecraft in flight, as arrays of pixels. Needs the extra ``plot`` (matplotlib).

Matplotlib draws into memory with a canvas of its own; its global state stays as it is.
"""

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from attjax import canvas

DPI = 100
WIDTH, HEIGHT = 640, 360
LEAST_ERROR_DEG, LEAST_RATE = 1e-5, 1e-5
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Corners of each face, in order as seen from outside."""
BODY = np.array([[0.65, 0.73, 0.83], [0.83, 0.70, 0.52], [0.55, 0.62, 0.60]])
"""Colours of the faces across the body's x, y and z axes."""
AXES = ("#c0392b", "#1e8449", "#2457a6")
VIEW = np.array([[-0.7071, 0.7071, 0.0], [-0.3536, -0.3536, 0.866], [0.6124, 0.6124, 0.5]])
"""Rows: right, up and towards the viewer, in the frame of the goal attitude."""


class Renderer:
    """Draws spacecraft, each beside the curves of its error and rate since its episode began.

    Args:
        inertia: (3,) principal moments or (3, 3) tensor, kg m²: the body is the box that has it.
        rate_limit: rad/s.
        goal_angle: rad.
        control_period: s.
        max_steps: agent steps of an episode.
        num_envs: spacecraft.
    """

    def __init__(
        self,
        inertia: npt.ArrayLike,
        rate_limit: float,
        goal_angle: float,
        control_period: float,
        max_steps: int,
        num_envs: int = 1,
    ):
        self._period = control_period
        self._times = control_period * np.arange(max_steps + 1)
        self._curves = np.full((2, max_steps + 1, num_envs), np.nan)
        self._now = np.full(num_envs, -1)
        self._box = box(inertia)
        with canvas.own_style():
            self._draw_background(rate_limit, np.rad2deg(goal_angle))

    def record(
        self, quaternion: np.ndarray, angular_velocity: np.ndarray, time: np.ndarray
    ) -> None:
        """Note the states (num_envs, 4), (num_envs, 3) and the agent steps (num_envs,) so far."""
        self._quaternion = quaternion
        time = np.minimum(time, len(self._times) - 1)  # stepped on, after the end
        self._curves[:, :, time != self._now + 1] = np.nan  # other episodes than before
        spacecraft = np.arange(len(time))
        vector, scalar = np.linalg.norm(quaternion[:, :3], axis=-1), quaternion[:, 3]
        self._curves[0, time, spacecraft] = np.rad2deg(2 * np.arctan2(vector, scalar))
        self._curves[1, time, spacecraft] = np.linalg.norm(angular_velocity, axis=-1)
        self._now = time

    def frame(self, index: int = 0) -> np.ndarray:
        """(HEIGHT, WIDTH, 3) uint8: the spacecraft of that index as it was last noted."""
        now = self._now[index]
        times, curves = self._times[: now + 1], self._curves[:, : now + 1, index]
        for line, curve, least in zip(self._lines, curves, (LEAST_ERROR_DEG, LEAST_RATE)):
            line.set_data(times, np.maximum(curve, least))
        self._words.set_text(
            f"{times[-1]:.2f} s   error {curves[0, -1]:.4g}°   rate {curves[1, -1]:.3g} rad/s"
        )
        self._canvas.restore_region(self._background)
        self._draw_body(rotation(self._quaternion[index]))
        for line in self._lines:
            assert line.axes is not None  # they drew it
            line.axes.draw_artist(line)
        self._scene.draw_artist(self._words)
        return np.array(self._canvas.buffer_rgba())[..., :3].copy()

    def _draw_background(self, rate_limit, goal_deg):
        """All that is the same in every frame, and the artists that each frame moves."""
        figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI, facecolor="white")
        self._canvas = FigureCanvasAgg(figure)
        self._scene = scene = figure.add_axes((0.0, 0.0, 0.5, 1.0), frameon=False)
        reach = 1.15 * np.linalg.norm(self._box)
        height = reach * 2 * HEIGHT / WIDTH
        scene.set(xlim=(-reach, reach), ylim=(-height, height))
        scene.set_axis_off()
        for face in FACES:  # the goal attitude, as a wire frame
            outline = (CORNERS[list(face)] * self._box) @ VIEW[:2].T
            scene.add_patch(Polygon(outline, fill=False, edgecolor="0.8", linewidth=0.8))
        scene.text(0.03, 0.95, "grey: the goal attitude", transform=scene.transAxes, color="0.5")
        self._words = scene.text(0.03, 0.03, "", transform=scene.transAxes, animated=True)
        limits = ((LEAST_ERROR_DEG, 400.0, goal_deg), (LEAST_RATE, 2 * rate_limit, rate_limit))
        self._lines = []
        for row, (low, high, mark) in enumerate(limits):
            axes = figure.add_axes((0.6, 0.57 - 0.44 * row, 0.37, 0.35))
            axes.set(yscale="log", ylim=(low, high), xlim=(0, self._times[-1]))
            axes.set_title(("error (°)", "rate (rad/s)")[row], fontsize=9, loc="left", pad=3)
            axes.tick_params(labelsize=7, labelbottom=row == 1)
            axes.axhline(mark, color="0.5", linestyle="--", linewidth=0.8)
            self._lines += axes.plot([], [], color=AXES[2], linewidth=1.4, animated=True)
        axes.set_xlabel("time (s)", fontsize=8, labelpad=1)
        self._patch = Polygon(np.zeros((4, 2)), edgecolor="0.2", linewidth=0.8, animated=True)
        scene.add_patch(self._patch)
        self._axis = scene.plot([], [], linewidth=2, animated=True)[0]
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)

    def _draw_body(self, turned):
        """The box and its axes, what is behind first."""
        corners = (CORNERS * self._box) @ turned.T @ VIEW.T
        tips = np.diag(self._box + 0.35 * self._box.max()) @ turned.T @ VIEW.T
        self._draw_axes(tips, behind=True)
        for axis, face in zip(np.repeat(range(3), 2), FACES):
            corner = corners[list(face)]
            towards = np.cross(corner[1] - corner[0], corner[2] - corner[1])
            towards /= np.linalg.norm(towards)
            if towards[2] > 0:
                self._patch.set(xy=corner[:, :2], facecolor=BODY[axis] * (0.55 + 0.45 * towards[2]))
                self._scene.draw_artist(self._patch)
        self._draw_axes(tips, behind=False)

    def _draw_axes(self, tips, behind):
        """The parts of the axes outside the box, of those that point away or of the others."""
        for tip, half, colour in zip(tips, self._box, AXES):
            if (tip[2] < 0) == behind:
                start = tip[:2] * half / (half + 0.35 * self._box.max())
                self._axis.set_data(*zip(start, tip[:2]))
                self._axis.set_color(colour)
                self._scene.draw_artist(self._axis)


def box(inertia: npt.ArrayLike) -> np.ndarray:
    """(3,) half the edges of the homogeneous box, largest edge 2, that turns as the body does."""
    inertia = np.asarray(inertia, float)
    moments = inertia if inertia.ndim == 1 else np.diag(inertia)
    squares = np.maximum(np.sum(moments) - 2 * moments, 0.05 * np.max(moments))
    return np.sqrt(squares / np.max(squares))


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) matrix from the body's frame to the goal attitude's, of (4,) scalar last."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    rows = (
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    )
    return np.array(rows)
