"""The one loop or kernel over a batch, apart from the physics that it is for."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax.dynamics.fused_loop import (
    FOUND,
    GIVEN,
    NOTHING,
    any_order,
    apart,
    one_kernel,
    one_loop,
    together,
)

BOTH = pytest.mark.parametrize("call", [one_loop, one_kernel])


class Body(NamedTuple):
    place: tuple
    speed: jax.Array
    push: jax.Array | None


def step(body, wind):
    speed = body.speed + wind["x"]
    return {"body": Body(tuple(x + speed for x in body.place), speed, body.push), "sum": speed * 2}


@BOTH
def test_trees_go_in_and_come_out(call):
    """Structure, names and what is absent: as from the function itself."""
    body = Body((jnp.arange(5.0), jnp.ones(5)), jnp.linspace(-1, 1, 5), None)
    wind = {"x": jnp.full(5, 0.25)}
    ours = jax.jit(jax.vmap(lambda *trees: call(step, *trees)))(body, wind)
    expected = jax.vmap(step)(body, wind)
    assert jax.tree.structure(ours) == jax.tree.structure(expected)
    jax.tree.map(np.testing.assert_array_equal, ours, expected)


def test_whatever_the_trees_there_is_one_reduction():
    body = Body((1.0, 2.0), 3.0, None)
    jaxpr = jax.make_jaxpr(lambda *trees: one_loop(step, *trees))(body, {"x": 0.5}).jaxpr
    reductions = [equation for equation in jaxpr.eqns if equation.primitive.name == "reduce"]
    assert len(reductions) == 1
    assert len(reductions[0].outvars) == 4


@BOTH
def test_more_results_than_operands(call):
    powers = call(lambda x: {"cube": x**3, "self": x, "square": x**2}, jnp.float32(3))
    assert {name: x.item() for name, x in powers.items()} == {"self": 3, "square": 9, "cube": 27}


@BOTH
def test_operands_and_results_of_several_types(call):
    """Each in its own, in whatever order, and where no operand is of a result's type."""

    def function(words, x, count):
        return {"is_odd": words[0] % 2 == 1, "x": x * 2, "word": words[0] + words[1], "n": -count}

    words = jnp.uint32(2**32 - 1), jnp.uint32(3)
    found = call(function, words, jnp.float32(1.5), jnp.int32(7))
    assert {name: x.item() for name, x in found.items()} == {
        "is_odd": True,
        "x": 3.0,
        "word": 2,
        "n": -7,
    }


@pytest.mark.parametrize("order", ["left", "right", "tree", "started everywhere"])
def test_in_whatever_order_a_device_reduces_the_function_is_applied_once(order):
    """The function of a result would be another, and so would that of the zeros at the start."""
    reduce = any_order(lambda values: [3 * values[0] + 1, values[0] - values[1]])
    given = (jnp.float32(2), jnp.float32(5), jnp.int32(GIVEN))
    start = (jnp.float32(0), jnp.float32(0), jnp.int32(NOTHING))
    reduced = {
        "left": lambda: functools.reduce(reduce, [given] * 3, start),
        "right": lambda: reduce(given, reduce(given, reduce(given, start))),
        "tree": lambda: reduce(reduce(given, given), reduce(given, start)),
        "started everywhere": lambda: reduce(reduce(start, given), reduce(start, start)),
    }[order]()
    assert [x.item() for x in reduced] == [7, -3, FOUND]
    assert reduce(start, start)[2] == NOTHING


@BOTH
def test_the_reducer_is_a_call(call):
    """Of a function however deep: the compiler's walk through it takes exponentially long."""

    def deep(x, y):
        for _ in range(200):
            x, y = x + x * y, x - y
        return x, y

    lowered = jax.jit(jax.vmap(lambda *xs: call(deep, *xs))).lower(*jnp.ones((2, 8)))
    _, reducer = lowered.as_text().split("reducer(")
    body = reducer[reducer.index("{") + 1 : reducer.index("}")].split("\n")
    operations = [line for line in body if line.strip()]
    if call is one_kernel:  # which takes or leaves what the call gives, and nothing else
        around = "stablehlo.constant", "stablehlo.compare", "call @_where"
        operations = [line for line in operations if not any(x in line for x in around)]
    assert len(operations) == 2 and "call @" in operations[0] and "return" in operations[1]


def test_nothing_together_is_no_loop():
    """As of a world in which nothing acts: the compiler would crash on a reduction of nothing."""
    assert jax.jit(jax.vmap(lambda x: together(lambda y: (None, ()), x)))(jnp.ones(3)) == (None, ())
    given = jax.make_jaxpr(lambda x: together(lambda y: {}, x))(1.0)
    assert "reduce" not in str(given)


def test_together_has_the_functions_values_and_derivatives():
    x = jnp.linspace(-1, 2, 7)
    ours = jax.jit(jax.vmap(lambda x: together(lambda y: (y**2, jnp.sin(y)), x)))(x)
    np.testing.assert_allclose(ours, (x**2, np.sin(x)), atol=1e-6)
    slope = jax.vmap(jax.grad(lambda x: together(jnp.sin, x)))(x)
    np.testing.assert_allclose(slope, np.cos(x), atol=1e-6)


def test_what_is_looked_up_comes_apart():
    """Values and derivatives are of the vector itself; under vmap a reduction makes it."""
    table = jnp.arange(12.0).reshape(4, 3)
    rows = jnp.array([2, 0, 3])
    looked_up = jax.vmap(lambda row: apart(table[row]))
    np.testing.assert_array_equal(jax.jit(looked_up)(rows), table[rows])
    np.testing.assert_array_equal(jax.jacfwd(apart)(table[1]), np.eye(3))
    assert "stablehlo.reduce" in jax.jit(looked_up).lower(rows).as_text()
