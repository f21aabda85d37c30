"""Discrete actions: of the torques of the table the best that the rate mask allows."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from attjax.control import assurance
from attjax.envs import observation as observations
from attjax.export import assured, c_text
from attjax.export.kind import NOTHING_KEEPS, CDecision, Kind, States, decide_all
from attjax.ppo import networks

TIE = 1e-4
"""Actions whose logits differ by less than this share of the logits' range are tied."""

MASK_ROUNDING = 1e-6
"""Relative change of ω that must not change which actions are masked in a clear decision."""


@dataclasses.dataclass(frozen=True)
class Decisions(States):
    """States, and what the policy does there.

    Attributes:
        action: (states,) int32.
        logits: (states, actions), MASKED_LOGIT where masked.
        clear: (states,) bool, whether rounding cannot decide: the two best actions are no tie,
            and no action is within rounding of being masked or not.
    """

    action: np.ndarray
    logits: np.ndarray
    clear: np.ndarray

    @property
    def comparable(self) -> np.ndarray:
        """Where the decision is clear."""
        return self.clear

    @property
    def c_values(self) -> dict[str, object]:
        """What the test vectors are."""
        return {"compared": "whose decision does not hang on rounding", "decision": "int action"}

    def c_decision(self, state: int) -> str:
        """The action."""
        return str(self.action[state])


def _decide(flight, quaternion, angular_velocity):
    """The action, an int32 scalar, and the logits (actions,)."""
    observation = observations.observe(quaternion, angular_velocity)
    inputs = flight.policy.encode(observation, flight.context)
    batch_of_one = jax.tree.map(lambda x: x[None], inputs)
    logits = flight.policy.outputs(flight.params, batch_of_one)[:, 0]
    action = flight.act(observation, flight.context)
    return action.astype(jnp.int32), logits


def _decisions(flight, quaternion, angular_velocity):
    action, logits = map(np.asarray, decide_all(flight, quaternion, angular_velocity))
    nearby = [angular_velocity * np.float32(1 + x) for x in (-MASK_ROUNDING, MASK_ROUNDING)]
    masked = logits == networks.MASKED_LOGIT
    near_logits = (np.asarray(decide_all(flight, quaternion, x)[1]) for x in nearby)
    clear = np.ones(len(action), bool)
    for near in near_logits:
        clear &= np.all((near == networks.MASKED_LOGIT) == masked, axis=1)
    if flight.guard is not None:
        admitted, is_certain = flight.guard.admitted(quaternion, angular_velocity, MASK_ROUNDING)
        masked, clear = masked | ~admitted, clear & is_certain
    clear &= _not_tied(logits, masked)
    return Decisions(quaternion, angular_velocity, action, logits, clear)


def _not_tied(logits, masked):
    """Whether the best logit leads the second by TIE of their range; not if one is NaN."""
    second, best = np.sort(np.where(masked, -np.inf, logits), axis=1)[:, -2:].T
    least = np.min(np.where(masked, np.inf, logits), axis=1)
    with np.errstate(invalid="ignore"):
        return best - second > TIE * (best - least)


def _rate_mask(flight):
    """The mask in float32, as NumPy arrays; None if the policy has none."""
    if flight.policy.rate_margin == 0:
        return None
    mask = assurance.rate_mask(flight.context, flight.policy.rate_margin)
    return jax.tree.map(lambda x: np.asarray(x, np.float32), mask)


_C_NAMES = {
    "function": "attjax_decide",
    "given": "attjax_torque_table[action]",
    "torque_declared": "const float *torque;",
    "torque_decided": "torque = attjax_torque_table[attjax_decide(single, single + 4)];",
    "turns": "attjax_decide(x, x + 4) != ATTJAX_NO_TORQUE",
    "sink": "volatile int sink = 0;",
    "timed": "sink = attjax_decide(vectors[v].quaternion, vectors[v].angular_velocity);",
}


def _c(flight):
    actions, mask = len(flight.torque_table), _rate_mask(flight)
    decision = CDecision(
        parts={
            "interface": "discrete/interface.h",
            "torques": "discrete/torques.c",
            "allow": "discrete/allow_all.c",
            "network": "discrete/network.c",
            "decide": "discrete/decide.c",
        },
        test_parts={"compare": "discrete/compare.c"},
        names=_C_NAMES,
        values={
            "title": f"which of {actions} torques to apply next",
            "actions": actions,
            "no_torque": int(np.flatnonzero(assurance.coasts(flight.torque_table))[0]),
            "torque_table": c_text.table(flight.torque_table),
            "unless_held": "",
            "outputs": "logits",
            "admit": "",
            "admit_declared": "",
            "keep": "",
        },
        kept_rate=NOTHING_KEEPS,
        constants=flight.torque_table.size,
        stack=2 * actions,  # logits, allowed
        comparisons=actions - 1,
    )
    if mask is not None:
        decision = _c_masked(decision, mask, flight.policy.rate_margin)
    return decision if flight.guard is None else assured.guarded(decision, flight.guard)


def _c_masked(decision, mask, margin):
    actions = len(mask.impulse)
    values = {
        "form": c_text.table(mask.form),
        "impulse": c_text.table(mask.impulse),
        "own_gain": c_text.table(mask.own_gain),
        "limit_squared": c_text.table(mask.limit_squared),
        "margin": margin,
    }
    kept_rate = (
        f"actions after which the coasting motion would pass {margin} of it are masked, except "
        f"those that lower that motion's largest rate"
    )
    return decision._replace(
        kept_rate=kept_rate,
        parts=decision.parts | {"allow": "discrete/allow_rate_mask.c"},
        values=decision.values | values,
        constants=sum(x.size for x in jax.tree.leaves(mask)),  # the torque table is among them
        multiply_adds=9 + 3 + 3 * actions,
        comparisons=decision.comparisons + 2 * actions,
        other=3 * actions,
    )


def _onnx(graph, flight, logits):
    """The first largest of the logits; those of masked actions are MASKED_LOGIT."""
    mask = _rate_mask(flight)
    if mask is not None:
        masked = graph.constant("masked_logit", np.float32(networks.MASKED_LOGIT))
        logits = graph.add("Where", [_allowed(graph, mask), logits, masked], "masked_logits")
    graph.add("Identity", [logits], "logits")
    graph.add("ArgMax", [logits], "action", axis=1, keepdims=0)  # the first of equal ones
    graph.result("action", np.int64)
    graph.result("logits", np.float32, len(flight.torque_table))


def _allowed(graph, mask):
    """The actions that :class:`attjax.control.assurance.RateMask` allows, (batch, actions)."""
    rate = "angular_velocity"
    form = graph.constant("peak_rate_form", mask.form)
    twice_impulse = graph.constant("twice_impulse", 2 * mask.impulse.T)
    own_gain = graph.constant("own_gain", mask.own_gain)
    limit = graph.constant("limit_squared", mask.limit_squared)
    zero = graph.constant("zero", np.float32(0))
    no_torque = graph.constant("no_torque", mask.coasts)
    gradient = graph.add("MatMul", [rate, form], "gradient")
    gain = graph.add("Gemm", [gradient, twice_impulse, own_gain], "gain")
    axis = graph.constant("axis", np.array([1], np.int64))
    terms = graph.add("Mul", [gradient, rate], "terms")
    peak = graph.add("ReduceSum", [terms, axis], "peak_squared", keepdims=1)
    after = graph.add("Add", [peak, gain], "peak_squared_after")
    within = graph.add("LessOrEqual", [after, limit], "within")
    lower = graph.add("Less", [gain, zero], "lower")
    allowed = graph.add("Or", [within, lower], "within_or_lower")
    return graph.add("Or", [allowed, no_torque], "allowed")


def _results(flight):
    return {
        "action": "int32, a row of the torque table",
        "logits": f"float32 ({len(flight.torque_table)},), -1e9 where masked",
    }


DISCRETE = Kind(None, _decide, _decisions, _c, _onnx, _results)
