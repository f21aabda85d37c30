import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from matplotlib import image

from attjax import AttitudeEnv, evaluation
from attjax.control import classical, time_optimal
from attjax.control.classical import average_torque
from attjax.dynamics import quaternion as quaternions
from attjax.envs.parameters import EnvState
from attjax.evaluation import paper, plots
from attjax.runs import learning_curve

ENV = AttitudeEnv(frameskip=5)
CONTROLLER = jax.tree_util.Partial(classical.phase_plane)
COLUMNS = ("agent_steps", "episode_return", "success_rate", "terminal_error_deg")
ROWS = [("1000", "", "", ""), ("2000", "100", "0.1", "20"), ("3000", "900", "0.5", "1")]
CURVE = [dict(zip(COLUMNS, row)) for row in ROWS]


def fly():
    params = ENV.default_params.replace(max_steps_in_episode=jnp.array(400, jnp.int32))
    return plots.Flight(CONTROLLER, ENV, params, 2, 100)


@pytest.fixture(scope="module")
def flight():
    return fly()


def test_every_figure_is_written(flight, tmp_path):
    folder = tmp_path / "figures"
    written = plots.write_all(flight, folder) + learning_curve.write(CURVE, True, folder)
    names = {path.stem for path in written}
    assert names == {
        "slew1", "slew2", "slew3", "error_histories", "distributions", "settling",
        "learning_curve", "final_seconds",
    }  # fmt: skip
    for path in written:
        pixels = image.imread(path)
        assert pixels.shape[0] > 500 and pixels[..., :3].std() > 0.01


def test_a_figure_is_the_same_in_any_style_of_the_user(flight, tmp_path):
    first = plots.distributions(flight, tmp_path).read_bytes()
    hostile = {
        "text.usetex": True, "axes.facecolor": "black", "savefig.dpi": 20, "font.size": 30,
        "savefig.format": "pdf", "savefig.bbox": "tight", "figure.autolayout": True,
    }  # fmt: skip
    with matplotlib.rc_context(hostile):
        assert plots.distributions(flight, tmp_path).read_bytes() == first
        assert {name: matplotlib.rcParams[name] for name in hostile} == hostile


def test_a_run_in_which_no_episode_ended_has_no_learning_curve(tmp_path):
    rows = [{"agent_steps": "1000", "episode_return": ""}]
    assert learning_curve.write(rows, True, tmp_path) == [] == list(tmp_path.iterdir())


def test_recorded_slews_are_the_flown_ones(x64):
    """Histories and statistics come from two loops; they must tell of the same flights.

    In float64: compiled apart, float32 loops differ in the last bit, on which a decision of the
    controller depends now and then.
    """
    flight = fly()
    time, history = flight.record(flight.starts)
    assert time[0] == ENV.control_period and len(time) == 400
    angles = jax.vmap(quaternions.error_angle)(history.quaternion[-1])
    np.testing.assert_allclose(angles, flight.flown.terminal_angle, atol=1e-9)
    impulses = np.linalg.norm(history.torque, axis=-1).sum(axis=0) / 240
    np.testing.assert_allclose(impulses, flight.flown.impulse, rtol=1e-2)


def test_table_5_slews_are_100_degrees():
    for quaternion in paper.TABLE_5.values():
        angle = np.rad2deg(float(quaternions.error_angle(jnp.array(quaternion))))
        assert angle == pytest.approx(100, abs=0.01)


def test_time_optimal_reference_of_table_5():
    """17.4 s at 11.43 Hz and 9.3 s at 40 Hz, and a single-axis slew by its closed form."""
    for frameskip, expected in ((20, 17.4), (5, 9.3)):
        env = AttitudeEnv(frameskip)
        context = env.context(env.default_params)
        slew = jnp.array(paper.TABLE_5["slew1"])
        time = time_optimal.time_optimal_reference(slew, context)
        assert float(time) == pytest.approx(expected, abs=0.05)
    acceleration = float(average_torque(context)) / 0.115
    about_y = jnp.array([0.0, np.sin(0.5), 0.0, np.cos(0.5)])  # 1 rad: half gained, half braked
    time = time_optimal.time_optimal_reference(about_y, context)
    assert float(time) == pytest.approx(2 * np.sqrt(1 / acceleration), rel=1e-4)


def test_record_keeps_every_step():
    start = EnvState(jnp.array([[0.0, 0, 0, 1]]), jnp.zeros((1, 3)), jnp.zeros(1, jnp.int32))
    history = evaluation.record(CONTROLLER, ENV, ENV.default_params, jax.random.key(0), start, 7)
    assert history.quaternion.shape == (7, 1, 4)
    assert history.angular_velocity.shape == history.torque.shape == (7, 1, 3)
    assert not history.torque.any()
