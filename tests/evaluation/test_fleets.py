"""Slews of which each is flown by another spacecraft."""

import argparse
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import eval_script, one_line_error

from attjax import AttitudeEnv, Spacecraft, World, evaluation, flight_loop
from attjax.commands import evaluation_subject
from attjax.config import run as run_config
from attjax.control.classical import phase_plane, quaternion_feedback
from attjax.control.time_optimal import rate_limited_reference, time_optimal_reference
from attjax.envs import parameters
from attjax.evaluation import fleets
from attjax.evaluation.episodes import fly_side_by_side
from attjax.evaluation.flown import Flown, first_memory

SHORT = AttitudeEnv(20, spacecraft=Spacecraft(duration=6))


def params_of_row(params, row):
    return params.replace(
        **{x: getattr(params, x)[row] for x in ("inertia", "torque_table", "rate_limit")}
    )


@pytest.mark.parametrize("loop", [False, True], ids=["bare", "loop"])
def test_each_slew_is_as_by_its_spacecraft_alone(loop):
    """More slews than fill a block, side by side, in a world that is late."""
    world = World.from_lists({"actuators": {"delay": 21}}) if loop else World()
    env = AttitudeEnv(20, spacecraft=SHORT.spacecraft, world=world)
    crew = tuple(map(jax.tree_util.Partial, (phase_plane, quaternion_feedback)))
    crew = tuple(map(flight_loop, crew)) if loop else crew
    count, key = 700, jax.random.key(3)
    params = fleets.params_of(env, count, seed=1)
    together = fly_side_by_side(crew, env, params, key, count)
    start = evaluation.random_slews(env, params, key, count)[1]
    assert start.quaternion.shape == (count, 4)
    steps = int(params.max_steps_in_episode)
    for row in (0, 1, 255, 256, 511, 699):
        own = params_of_row(params, row)
        first = jax.tree.map(lambda x, row=row: x[row : row + 1], start)
        for controller, flown in zip(crew, together):
            history = evaluation.record(controller, env, own, key, first, steps)
            rates = np.linalg.norm(history.angular_velocity[:, 0], axis=1)
            assert bool(flown.overspeed[row]) == np.any(rates > own.rate_limit)
            if not flown.overspeed[row]:
                angle = 2 * np.arcsin(np.linalg.norm(history.quaternion[-1, 0, :3]))
                assert float(flown.terminal_angle[row]) == pytest.approx(angle, rel=0.02, abs=1e-5)


def test_record_flies_the_spacecraft_of_each_slew():
    env, key = SHORT, jax.random.key(0)
    params = fleets.params_of(env, 9, seed=2)
    start = evaluation.random_slews(env, params, key, 9)[1]
    steps = int(params.max_steps_in_episode)
    history = evaluation.record(jax.tree_util.Partial(phase_plane), env, params, key, start, steps)
    flown = evaluation.fly(jax.tree_util.Partial(phase_plane), env, params, key, 9)
    kept = ~np.asarray(flown.overspeed)
    angle = 2 * np.arcsin(np.linalg.norm(history.quaternion[-1, :, :3], axis=1))
    np.testing.assert_allclose(angle[kept], flown.terminal_angle[kept], rtol=0.02, atol=1e-5)
    assert kept.sum() >= 5


def test_ratios_are_over_the_estimates_of_the_successes():
    env, key = AttitudeEnv(20), jax.random.key(5)
    params = fleets.params_of(env, 40, seed=5)
    flown = evaluation.fly(jax.tree_util.Partial(phase_plane), env, params, key, 40)
    found = fleets.ratios(flown, env, params, key)
    success = np.asarray(evaluation.successes(flown, params))
    assert 20 < success.sum() < 40
    start = evaluation.random_slews(env, params, key, 40)[1]
    rows = np.flatnonzero(success)
    contexts = [env.context(params_of_row(params, row)) for row in rows]
    estimates = [rate_limited_reference(start.quaternion[n], c) for n, c in zip(rows, contexts)]
    settling = evaluation.settling_times(flown, env)[success]
    assert found["settling_over_estimate"] == pytest.approx(
        settling.mean() / np.mean(estimates), rel=1e-5
    )
    limits = [fleets.quantisation(c) for c in contexts]
    error = np.asarray(flown.terminal_angle)[success].mean() / np.mean(limits)
    assert found["terminal_over_quantisation"] == pytest.approx(error, rel=1e-5)


def test_the_estimate_keeps_the_rate_limit():
    """By hand: accelerating and braking take as long as by the limit's share of the peak."""
    context = AttitudeEnv(5).context(AttitudeEnv(5).default_params)
    turned = jnp.array([0.0, 0.7071068, 0.0, 0.7071068])
    free = float(time_optimal_reference(turned, context))
    peak = np.pi / free
    for limit in (0.3, 0.5, 2.0):
        limited = context.replace(rate_limit=jnp.array(limit))
        ramp = min(limit, peak) / (2 * peak / free)
        expected = 2 * ramp + max(0.0, (np.pi / 2 - min(limit, peak) * ramp) / min(limit, peak))
        assert float(rate_limited_reference(turned, limited)) == pytest.approx(expected, rel=1e-5)


def test_quantisation_is_the_mean_of_a_cell():
    env = AttitudeEnv(5)
    context = env.context(env.default_params)
    edges = 0.005 / 240 * (6 / 240) / np.array([0.872, 0.115, 0.797])
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (200_000, 3)) * edges
    expected = np.linalg.norm(points, axis=1).mean()
    assert float(fleets.quantisation(context)) == pytest.approx(expected, rel=0.01)


def test_the_command_flies_a_fleet(tmp_path, capsys):
    file = tmp_path / "fleet.json"
    flags = ["--controller=feedback", "--fleet", "--frameskip=20", "--episodes=30"]
    assert eval_script.main([*flags, "--device=cpu", f"--json={file}"]) == 0
    printed, told = capsys.readouterr().out, json.loads(file.read_text())
    assert "any spacecraft, seed 0" in printed and "beside estimates  settling" in printed
    assert told["spacecraft"] == "any" and told["settling_over_estimate"] > 0.9
    others = "--spacecraft=a.toml", "--world=stress", "--assured", "--plot=x", "--playback=x.html"
    for flag in others:
        said = one_line_error(eval_script.main, ["--controller=feedback", "--fleet", flag], capsys)
        assert f"{flag.partition('=')[0]} does not go with --fleet" in said


def test_a_loop_that_adapts_begins_with_each_spacecraft_as_believed():
    params, count = fleets.params_of(SHORT, 5, seed=1), 5
    loops = (flight_loop(phase_plane, adapts=True),) * 2
    doubled = jax.tree.map(
        lambda x, axis: x if axis is None else jnp.concatenate([x] * 2),
        params,
        parameters.fleet_axes(params),
    )
    memory = first_memory(loops, Flown(SHORT, doubled), count)
    found = np.stack([np.stack(x, axis=-1) for x in memory.identity.inertia], axis=1)
    np.testing.assert_allclose(found, doubled.inertia, rtol=1e-4, atol=1e-5)
    mixed = loops[0], flight_loop(phase_plane)
    with pytest.raises(ValueError, match="of flight loops side by side all adapt, or none"):
        first_memory(mixed, Flown(SHORT, params), count)


def test_a_fleet_in_another_world_is_refused():
    env = AttitudeEnv(20, world=World.named("lm50-leo"))
    with pytest.raises(ValueError, match="the world is lm50-leo; a fleet flies in the ideal one"):
        evaluation.evaluate_fleet(phase_plane, env, episodes=2)


def test_a_policy_of_any_spacecraft_flies_that_of_a_named_world():
    """As the classical laws do; a policy of one spacecraft, and a world of none, have the run's."""
    arguments = argparse.Namespace(fleet=False, spacecraft=None, duration=None, frameskip=5)
    tug = Spacecraft(name="tug")
    cubesat, stress = World.named("cubesat-6u"), World.named("stress")
    for preset, world, name in (
        ("universal", cubesat, "6U CubeSat"),
        ("universal", stress, "tug"),
        ("precise", cubesat, "tug"),
    ):
        config = run_config.new(preset, spacecraft=tug)
        assert evaluation_subject.spacecraft(arguments, config, world).name == name
    assert evaluation_subject.spacecraft(arguments, None, cubesat).name == "6U CubeSat"
