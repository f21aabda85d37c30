"""Descriptions of worlds: what they may be, what is said of what they may not be."""

import contextlib
import functools
import math
import tomllib

import pytest
from commands import ROOT
from fuzzing import FUZZ
from hypothesis import given, settings
from hypothesis import strategies as st

from attjax import Spacecraft, World
from attjax.config import run, toml
from attjax.world import IDEAL, Actuators, LogUniform, Normal, Uniform, Wheels, distributions

EXAMPLE = ROOT / "docs" / "examples" / "leo.toml"
ORBIT = {"altitude_km": 500}
WHEEL = {"inertia": 1e-3}
MODE = {"frequency": 1, "participation": 0.1}
BAD = [
    ({"x": 1}, "has the unknown name 'x'"),
    ({"name": 3}, "name is 3"),
    ({"name": ""}, "name is ''"),
    ({"orbit": 3}, "orbit is 3; it must be a table"),
    ({"orbit": {}}, "orbit lacks altitude_km"),
    ({"orbit": {"altitude_km": 10}}, "orbit.altitude_km is 10; it must be from 160"),
    ({"disturbances": {"gravity_gradient": True}}, "disturbances.gravity_gradient needs an orbit"),
    ({"disturbances": {"residual_dipole": {"uniform": [0, 1]}}}, "residual_dipole needs an orbit"),
    ({"disturbances": {"gravity_gradient": 1}}, "gravity_gradient is 1; it must be True or False"),
    ({"disturbances": {"constant_torque": -1}}, "constant_torque is -1"),
    ({"disturbances": {"constant_axis": [0, 0, 0]}}, "constant_axis is all zeros"),
    ({"disturbances": {"constant_axis": [1, 0]}}, "constant_axis is [1, 0]; it must be 3 numbers"),
    ({"orbit": ORBIT, "disturbances": {"drag": {"area": 1}}}, "disturbances.drag lacks lever_arm"),
    ({"disturbances": {"sinusoid": {"torque": 1, "period": 0}}}, "sinusoid.period is 0"),
    ({"actuators": {"dead_levels": [0]}}, "dead_levels is [0]"),
    ({"actuators": {"faulty_axes": 1}}, "faulty_axes is 1"),
    ({"actuators": {"delay": True}}, "delay is True"),
    ({"actuators": {"delay": float("nan")}}, "delay is nan"),
    ({"actuators": {"gain": {"normal": [1, 0.1]}}}, "gain can be from -inf to inf"),
    ({"actuators": {"gain": {"normal": [1, 0]}}}, "actuators.gain: normal has the deviation 0"),
    ({"actuators": {"gain": {"normal": [1, 1], "truncated": [9, 8]}}}, "truncated is [9, 8]"),
    ({"actuators": {"gain": {"normal": [1, 0.1], "truncated": [5, 6]}}}, "within 4 deviations"),
    (
        {"actuators": {"gain": {"uniform": [2, 1]}}},
        "uniform is [2, 1]; the first must be the least",
    ),
    ({"actuators": {"gain": {"uniform": [1, 2, 3]}}}, "uniform is [1, 2, 3]"),
    ({"actuators": {"gain": {"log_uniform": [0, 1]}}}, "low must be above 0"),
    ({"actuators": {"gain": {"norml": [0, 1]}}}, "{'norml'} is no distribution"),
    ({"actuators": {"gain": {"uniform": [0, 1], "truncated": [0, 1]}}}, "goes with normal"),
    ({"actuators": {"gain": "much"}}, "gain is 'much'; it must be a number"),
    ({"actuators": {"on_time_granularity": 1}}, "on_time_granularity is 1"),
    ({"sensors": {"gyro": {"rate_hz": 7}}}, "sensors.gyro.rate_hz is 7; it must be 240 over"),
    ({"sensors": {"gyro": {"angle_random_walk_deg_per_root_h": -1}}}, "per_root_h is -1; it must"),
    ({"sensors": {"star_tracker": {"latency": 0.1}}}, "latency is given, and no rate_hz"),
    (
        {"sensors": {"star_tracker": {"rate_hz": 4, "latency": 0.3}}},
        "latency is 0.3; it must be at",
    ),
    ({"sensors": {"star_tracker": {"boresight": [0, 0, 0]}}}, "boresight is all zeros"),
    ({"sensors": {"sextant": {}}}, "sensors has the unknown name 'sextant'"),
    ({"uncertainty": {"moment_factor": [1, 2, 3]}}, "moment_factor is [1, 2, 3]"),
    ({"actuators": {"wheels": {}}}, "actuators.wheels lacks inertia"),
    ({"actuators": {"wheels": {"inertia": 0}}}, "actuators.wheels.inertia is 0; it must be from"),
    ({"actuators": {"wheels": 3}}, "actuators.wheels is 3; it must be a table"),
    ({"actuators": {"wheels": WHEEL | {"most_torque": 0}}}, "wheels.most_torque is 0; it must be"),
    ({"actuators": {"wheels": WHEEL | {"most_speed": {"uniform": [1, 2]}}}}, "must be a number"),
    ({"actuators": {"wheels": WHEEL | {"dead_band": -1}}}, "wheels.dead_band is -1; it must be"),
    ({"actuators": {"wheels": WHEEL | {"coulomb_friction": -1}}}, "coulomb_friction is -1"),
    (
        {"actuators": {"wheels": WHEEL | {"viscous_friction": {"uniform": [0, 1]}}}},
        "wheels.viscous_friction can be 1; it must be at most 0.24",
    ),
    ({"disturbances": {"flexible": {"frequency": 1}}}, "flexible lacks participation"),
    ({"disturbances": {"flexible": MODE | {"frequency": 0}}}, "flexible.frequency is 0"),
    ({"disturbances": {"flexible": MODE | {"damping": 2}}}, "flexible.damping is 2; it must be"),
    ({"disturbances": {"flexible": MODE | {"axis": [0, 0, 0]}}}, "flexible.axis is all zeros"),
    ({"own_disturbances": [1]}, "own_disturbances can be given in Python only"),
    ({"own_sensors": [1]}, "own_sensors can be given in Python only"),
    ([], "world is []; it must be a table"),
]


@pytest.mark.parametrize("table, said", BAD, ids=[said for _, said in BAD])
def test_what_is_wrong_is_named(table, said):
    with pytest.raises(ValueError) as error:
        World.from_lists(table)
    assert said in str(error.value)
    assert "\n" not in str(error.value) and not str(error.value).startswith("world.")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["uniform", "normal", "truncated", "area", "x"]), inner)
    ),
    max_leaves=6,
)


def places(table, path=()):
    for name, value in table.items():
        yield (*path, name)
        if isinstance(value, dict):
            yield from places(value, (*path, name))


@settings(max_examples=400, **FUZZ)
@given(st.data())
def test_whatever_stands_in_a_description_it_is_taken_or_refused_in_one_line(data):
    """Any one value of the example replaced by anything, or any name by another."""
    table = World.from_toml(EXAMPLE).table()
    *way, last = data.draw(st.sampled_from(list(places(table))))
    inner = functools.reduce(lambda x, name: x[name], way, table)
    if data.draw(st.booleans()):
        inner[last] = data.draw(VALUES)
    else:
        inner[data.draw(st.text(max_size=5))] = inner.pop(last)
    try:
        world = World.from_lists(table)
    except ValueError as error:
        assert str(error) and "\n" not in str(error)
    else:
        assert World.from_lists(world.table()) == world and hash(world) is not None


def test_a_description_survives_its_tables():
    world = World.from_toml(EXAMPLE)
    assert World.from_lists(world.table()) == world and hash(world)
    assert world.name == "low orbit" and not world.is_ideal and str(world) == "low orbit"
    assert World.from_lists({}) == IDEAL and IDEAL.table() == {}


def test_a_runs_file_holds_its_world(tmp_path):
    """--print-config to --config, distributions and tables in tables included."""
    config = run.new("precise", world=World.from_toml(EXAMPLE))
    file = tmp_path / "run.toml"
    file.write_text(toml.text(config))
    assert run.new(**toml.read(file)) == config
    assert "[world.disturbances.drag]" in file.read_text()
    assert "[world" not in toml.text(run.new("precise"))
    assert tomllib.loads(file.read_text())["world"]["actuators"]["gain"] == {
        "normal": [1.0, 0.03],
        "truncated": [0.9, 1.1],
    }


def test_a_file_without_a_name_gives_its_own(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[uncertainty]\ninertia_factor = 2\n")
    assert World.from_toml(file).name == "mine"


def test_what_the_spacecraft_lacks_is_named():
    for table, said in (
        ({"dead_levels": [4]}, "dead_levels holds 4; LM50 has 3 torque_levels"),
        ({"faulty_axes": [1, 5]}, "faulty_axes holds 5; LM50 has 3 torque_axes"),
        ({"delay": 9000, "delay_jitter": 2000}, "come to 11000; in an episode of 43.75 s"),
    ):
        with pytest.raises(ValueError, match=said):
            run.new(world=World.from_lists({"actuators": table}))
    with pytest.raises(ValueError, match="cannot be kept with a run"):
        run.new(world=World(name="mine", own_disturbances=(print,)))
    run.check_world(World(actuators=Actuators(dead_levels=(3,))), Spacecraft())


@pytest.mark.parametrize(
    "table, said",
    [
        ({"actuators": {"wheels": {"inertia": 0.04}}}, "3 wheels comes to 0.12; it must be below"),
        (
            {"disturbances": {"flexible": MODE | {"participation": 0.34}}},
            "participation can be 0.34, whose square is 0.1156; it must be below .* wheels, 0.115$",
        ),
        (
            {"disturbances": {"flexible": MODE | {"participation": {"uniform": [0, 0.3]}}}}
            | {"actuators": {"wheels": {"inertia": 0.009}}},
            "whose square is 0.09; it must be below .* 0.088$",
        ),
        (
            {"disturbances": {"flexible": MODE | {"participation": 0.3}}}
            | {"uncertainty": {"inertia_factor": {"uniform": [0.5, 2]}}},
            "must be below the spacecraft's least moment but for wheels, 0.0575$",
        ),
        (
            {"disturbances": {"flexible": MODE | {"frequency": 30, "participation": 0.25}}},
            "frequency can be 30; at this participation and damping it must be at most 25.8",
        ),
    ],
)
def test_what_moves_aboard_is_within_the_spacecrafts_inertia(table, said):
    with pytest.raises(ValueError, match=said) as error:
        run.new(world=World.from_lists(table))
    assert "\n" not in str(error.value)


def test_a_tensor_has_room_for_what_its_least_moment_has():
    """Turned by an eighth about the last axis, moments 1 and 3 make 2 on the diagonal."""
    craft = Spacecraft(inertia=((2, 1, 0), (1, 2, 0), (0, 0, 3)), torque_levels=(0.1,))
    assert craft.least_moment == pytest.approx(1)
    for inertia, is_enough in ((0.33, True), (0.34, False)):
        world = World(actuators=Actuators(wheels=Wheels(inertia=inertia)))
        with contextlib.nullcontext() if is_enough else pytest.raises(ValueError, match="least"):
            run.check_world(world, craft)


def test_support_is_what_can_be_drawn():
    for number, support in (
        (Uniform(1, 2), (1, 2)),
        (LogUniform(0.1, 2), (0.1, 2)),
        (Normal(0, 1), (-math.inf, math.inf)),
        (Normal(0, 1, -1, 2), (-1, 2)),
    ):
        assert number.support == support
        assert (distributions.least(number), distributions.largest(number)) == support
        assert distributions.from_table(distributions.to_table(number)) == number
    assert distributions.least(3.0) == distributions.largest(3.0) == 3.0


def test_only_the_ideal_world_is_called_so():
    assert World(actuators=Actuators(gain=0.9)).name == "unnamed"
    assert World.from_lists({"name": "ideal", "actuators": {"gain": 0.9}}).name == "unnamed"
    assert World().name == World.from_lists({"actuators": {}}).name == "ideal"


def test_there_is_no_other_name():
    with pytest.raises(ValueError, match="world is 'heaven'; it must be one of ideal"):
        World.named("heaven")
    assert World.of("ideal") is IDEAL and World.of(IDEAL) is IDEAL
