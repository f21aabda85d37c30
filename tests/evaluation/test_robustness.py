"""The ladder of conditions: its worlds, its rows, what is printed and drawn of them."""

import importlib
import json

import jax
import numpy as np
import programs
import pytest
from commands import ROOT
from scipy import stats

from attjax import AttitudeEnv, Spacecraft, World, evaluation, flight_loop
from attjax.commands import eval as eval_command
from attjax.config.run import check_world
from attjax.control.classical import phase_plane, quaternion_feedback
from attjax.evaluation import ladder, robustness, robustness_table
from attjax.evaluation.blocks import fly_blocks
from attjax.evaluation.episodes import fly_side_by_side
from attjax.runs.flight import network
from attjax.spacecraft import LM50
from attjax.world import made_for, names

KEYS = (
    "condition", "controller", "flight_loop", "adaptive", "assured", "episodes", "success_rate",
    "overspeed_rate", "rms_deg", "max_deg", "estimate_rms_deg", "settling_time_s", "impulse_N_m_s",
)  # fmt: skip
LAWS = {"phase-plane": phase_plane, "feedback": quaternion_feedback}
SHORT = AttitudeEnv(20, spacecraft=Spacecraft(duration=14.0, slew_angles_deg=(5, 10)))


@pytest.fixture
def two_conditions(monkeypatch):
    """The ideal world, and one with noise."""

    def only(spacecraft, frameskip):
        every = ladder.conditions(spacecraft, frameskip)
        return {name: every[name] for name in ("ideal", 'noise of 30" and 0.0005 rad/s')}

    monkeypatch.setattr(robustness, "conditions", only)


@pytest.mark.parametrize("share", [0.0, 0.003, 0.5, 1.0])
@pytest.mark.parametrize("count", [1, 200, 1000])
def test_wilsons_interval_is_scipys(share, count):
    seen = round(share * count)
    found = stats.binomtest(seen, count).proportion_ci(method="wilson")
    assert robustness.wilson(seen / count, count) == pytest.approx(tuple(found), abs=1e-8)


@pytest.mark.parametrize("frameskip", [5, 20])
@pytest.mark.parametrize("craft", [LM50, Spacecraft.from_toml(ROOT / "docs/examples/cubesat.toml")])
def test_each_kind_of_condition_has_two_strengths_and_can_be_flown(craft, frameskip):
    worlds = ladder.conditions(craft, frameskip)
    assert next(iter(worlds)) == "ideal" and set(names()) <= set(worlds)
    assert sum(not world.is_ideal for world in worlds.values()) == len(worlds) - 1 >= 24
    for name, world in worlds.items():
        check_world(world, made_for(world) if made_for(world) != LM50 else craft)
        assert World.from_lists(world.table()) == world, name
    assert worlds["delay of two periods"].actuators.delay == 2 * (frameskip + 1)
    gyro = worlds['noise of 5" and 0.0001 rad/s'].sensors.gyro
    walk = np.deg2rad(gyro.angle_random_walk_deg_per_root_h) / 60
    assert walk / np.sqrt((frameskip + 1) / 240) == pytest.approx(1e-4)


def test_side_by_side_is_one_by_one():
    """Loops and bare controllers in one program, as each by itself, with how they hold."""
    env = AttitudeEnv(20, spacecraft=SHORT.spacecraft, world=World.named("lm50-leo"))
    params, key = env.default_params, jax.random.key(3)
    plain = tuple(map(jax.tree_util.Partial, LAWS.values()))
    crew = (*map(flight_loop, plain), *plain)
    together = fly_side_by_side(crew, env, params, key, 7)
    steps = int(params.max_steps_in_episode)
    start = evaluation.random_slews(env, params, key, 7)[1]
    for controller, flown in zip(crew, together):
        alone = evaluation.fly(controller, env, params, key, 7)
        for name in ("terminal_angle", "impulse", "last_outside"):
            np.testing.assert_allclose(
                getattr(flown, name), getattr(alone, name), rtol=1e-3, atol=1e-6
            )
        history = evaluation.record(controller, env, params, key, start, steps)
        angles = np.linalg.norm(history.quaternion[-(steps // 5) :, :, :3], axis=-1) * 2
        np.testing.assert_allclose(flown.holding.most, angles.max(axis=0), rtol=0.1)
        # A decision that rounding turns changes all after it.
        np.testing.assert_allclose(flown.holding.squared, (angles**2).mean(axis=0), rtol=0.1)
        true = np.concatenate([start.quaternion[None], history.quaternion[:-1]])
        missed = np.abs(np.sum(true * history.believed, axis=-1))
        assert np.all(np.diff(missed, axis=0)[-3:] < 1e-4)
    assert not np.allclose(together[0].holding.squared, together[2].holding.squared)


def test_rows_are_of_each_controller_in_both_ways(two_conditions):
    told = []
    flights = robustness.Flights(SHORT, episodes=6, seed=1)
    rows = robustness.robustness(LAWS, flights, lambda *counts: told.append(counts))
    assert told == [(1, 2), (2, 2)] and len(rows) == 8
    assert all(tuple(row) == KEYS and row["episodes"] == 6 for row in rows)
    ideal, noisy = rows[:4], rows[4:]
    assert [row["flight_loop"] for row in ideal] == [True, True, False, False]
    for row, twin in zip(ideal[:2], ideal[2:]):
        assert {**twin, "flight_loop": True} == row and row["estimate_rms_deg"] == 0
    assert all(a["estimate_rms_deg"] < 0.5 * b["estimate_rms_deg"]
               for a, b in zip(noisy[:2], noisy[2:]))  # fmt: skip
    judged = evaluation.evaluate(phase_plane, SHORT, episodes=6, seed=1)
    assert ideal[0]["success_rate"] == judged["success_rate"]
    assert ideal[0]["settling_time_s"] == pytest.approx(judged["settling_time_s"]["mean"])


def test_no_condition_leaves_its_programs_behind(two_conditions):
    """Those of the whole ladder are more than a process can hold."""
    robustness.robustness({"phase-plane": phase_plane}, robustness.Flights(SHORT, episodes=2))
    assert programs.held(fly_blocks) == 0


def test_rows_of_loops_that_adapt_and_of_assured_ones(two_conditions):
    flights = robustness.Flights(SHORT, episodes=4, seed=1, adaptive=True, assured=True)
    rows = robustness.robustness(LAWS, flights)
    assert all(tuple(row) == KEYS for row in rows)
    ways = [(row["flight_loop"], row["adaptive"], row["assured"]) for row in rows[:6]]
    looped, bare, adaptive = (True, False, True), (False, False, False), (True, True, True)
    assert ways == [looped] * 2 + [bare] * 2 + [adaptive] * 2
    names = [name for name, _ in robustness_table.named(rows[6:])]
    laws = list(LAWS)
    expected = [f"{law}, {way}" for way in ("loop", "bare", "adaptive") for law in laws]
    assert names == expected


def test_a_policy_is_flown_under_assurance_by_its_own_scores(two_conditions, monkeypatch):
    """And not by which impulse is the nearest to that of its best action, as a law is."""
    crews = []
    monkeypatch.setattr(robustness, "fly_side_by_side", lambda crew, *_: crews.append(crew) or ())
    policy, params = network(ROOT / "pretrained" / "precise")
    act = jax.tree_util.Partial(policy.act, params)
    flights = robustness.Flights(SHORT, episodes=1, adaptive=True, assured=True)
    robustness.robustness({"policy": act, "phase-plane": phase_plane}, flights)
    context = SHORT.context(SHORT.default_params)
    observation = jax.numpy.zeros(11).at[3].set(1.0)
    wanted = policy.scores(params, observation, context)
    assert len(crews) == 4
    for loop, *_ in crews:
        np.testing.assert_array_equal(loop.scores(observation, context), wanted)


def test_the_small_spacecrafts_worlds_are_flown_with_their_own():
    for name in names()[1:]:
        env = robustness.environment(SHORT, World.named(name))
        own = made_for(World.named(name))
        assert env.spacecraft == (SHORT.spacecraft if own == LM50 else own)


def test_the_command_prints_draws_and_writes(two_conditions, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    json_file, folder = tmp_path / "rows.json", tmp_path / "figures"
    status = eval_command.main([
        "--checkpoint", str(ROOT / "pretrained/precise"), "--robustness", "--episodes", "4",
        "--duration", "9", "--json", str(json_file), "--plot", str(folder),
    ])  # fmt: skip
    printed = capsys.readouterr().out
    rows = json.loads(json_file.read_text())
    assert status == 0 and len(rows) == 12
    assert {row["controller"] for row in rows} == {"policy", *LAWS}
    assert "feedback, loop" in printed and "(95 %" not in printed
    table = printed[: printed.index(robustness_table.NOTE)]
    assert max(map(len, table.splitlines())) <= 100
    figures = sorted(path.name for path in folder.iterdir())
    assert figures == ["pointing_against_knowledge.png", "robustness.png"]


@pytest.mark.parametrize(
    "flags",
    [
        ["--world", "stress"],
        ["--bare"],
        ["--sampled"],
        ["--playback", "page.html"],
    ],
)
def test_flags_that_do_not_go_with_it_are_refused(flags, capsys):
    with pytest.raises(SystemExit) as stopped:
        eval_command.main(
            ["--checkpoint", str(ROOT / "pretrained/precise"), "--robustness", *flags]
        )
    assert stopped.value.code == 2
    assert f"{flags[0]} does not go with --robustness" in capsys.readouterr().err


def test_no_success_and_no_whole_flight_have_no_figures():
    none = dict.fromkeys(("rms_deg", "max_deg", "estimate_rms_deg", "settling_time_s"))
    row = dict.fromkeys(KEYS, 0.0) | {"episodes": 5} | none
    assert robustness_table.cells(row)[2:6] == ["–"] * 4


def test_the_side_by_side_table_has_a_column_for_each_loop(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    table = importlib.import_module("robustness_table")
    looped = {
        "condition": "ideal", "controller": "policy", "flight_loop": True, "adaptive": False,
        "success_rate": 0.985, "overspeed_rate": 0.015, "rms_deg": 8.8e-5, "settling_time_s": 7.98,
    }  # fmt: skip
    adaptive = looped | {"adaptive": True, "success_rate": 1.0, "overspeed_rate": 0.0}
    none = {"rms_deg": None, "settling_time_s": None, "success_rate": 0.0}
    elsewhere = looped | {"condition": "wheels"} | none
    rows = [looped, looped | {"flight_loop": False}, adaptive, elsewhere]
    assert table.side_by_side(rows) == [
        "|  | policy, loop | policy, adaptive |",
        "| --- | --- | --- |",
        "| ideal | 98.5 % (1.5 % over), 0.000088°, 7.98 s | 100.0 %, 0.000088°, 7.98 s |",
        "| wheels | 0.0 % (1.5 % over) |  |",
    ]
