"""What an export must know of a kind of action: discrete.py and continuous.py tell it."""

import abc
import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import chex
import jax
import numpy as np

NOTHING_KEEPS = "there is no mask; nothing keeps it but what was learned"
"""The rate limit."""


@dataclasses.dataclass(frozen=True)
class States(abc.ABC):
    """States at which a policy decides.

    Attributes:
        quaternion, angular_velocity: (states, 4) and (states, 3), float32.
    """

    quaternion: np.ndarray
    angular_velocity: np.ndarray

    @property
    @abc.abstractmethod
    def comparable(self) -> np.ndarray:
        """(states,) bool, where an export must decide as JAX does."""

    @property
    @abc.abstractmethod
    def c_values(self) -> Mapping[str, object]:
        """What fills in the test program."""

    @abc.abstractmethod
    def c_decision(self, state: int) -> str:
        """The decision at one of the states, as C reads it."""


class CDecision(NamedTuple):
    """A decision in C. What is counted is counted beside the inputs and the layers.

    Attributes:
        parts: templates of what only this kind has, by the name that they fill in, one after
            the other: each may use those before it.
        test_parts: the same of the test program.
        names: what fills in the templates and has names that begin with the prefix.
        values: what else fills them in; ``outputs``, the name of what the network computes.
        kept_rate: what keeps the rate limit, for people.
        constants: how many numbers the arrays have.
        stack: how many numbers of arrays are on the stack in a call.
        multiply_adds, tanh, comparisons, other: operations.
    """

    parts: Mapping[str, str]
    test_parts: Mapping[str, str]
    names: Mapping[str, str]
    values: Mapping[str, object]
    kept_rate: str
    constants: int
    stack: int
    multiply_adds: int = 0
    tanh: int = 0
    comparisons: int = 0
    other: int = 0


class Kind(NamedTuple):
    """A kind of action; each function takes a :class:`attjax.export.flight_policy.FlightPolicy`.

    Attributes:
        outputs: how many of the network's outputs the decision is made of, the first ones; None:
            all.
        decide: (flight, quaternion, angular_velocity) to what the exports give for one state, in
            JAX.
        states: (flight, quaternion, angular_velocity) of many to :class:`States`.
        c: (flight) to :class:`CDecision`.
        onnx: (graph, flight, name of the network's outputs); adds nodes and results to the graph.
        results: (flight) to what StableHLO gives, a line each, by name.
    """

    outputs: int | None
    decide: Callable
    states: Callable[..., States]
    c: Callable[..., CDecision]
    onnx: Callable[..., None]
    results: Callable[..., Mapping[str, str]]


@functools.partial(jax.jit, static_argnums=0)
def decide_all(flight: Any, quaternion: chex.Array, angular_velocity: chex.Array) -> chex.ArrayTree:
    """What a flight policy's kind decides at many states, (states, 4) and (states, 3)."""
    decide = functools.partial(flight.kind.decide, flight)
    return jax.vmap(decide)(quaternion, angular_velocity)
