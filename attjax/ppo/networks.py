"""Policy and value networks."""

import dataclasses
from collections.abc import Callable

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax.control import assurance, torque_order
from attjax.control.features import FEATURES
from attjax.control.universal import backward_axes
from attjax.envs import observation as observations
from attjax.envs.context import Context
from attjax.ppo.distributions import Categorical, Gaussian
from attjax.ppo.layers import MLP

MASKED_LOGIT = -1e9


@struct.dataclass
class Inputs:
    """All that the networks see of one step.

    Attributes:
        features: (features,) network input.
        allowed: (actions,) bool, the actions that are not masked; None of continuous ones.
        backward: (3,) bool, of :func:`attjax.control.universal.backward_axes`; None of other
            features.
    """

    features: chex.Array
    allowed: chex.Array | None
    backward: chex.Array | None = None


@dataclasses.dataclass(frozen=True)
class Policy:
    """A policy and its value function, two networks that share no parameters.

    Attributes:
        features: of FEATURES by name, or a function of an observation (size,) and a context, to
            (features,). Where they are "universal", actions are numbers of
            :func:`attjax.control.torque_order.rows` until they are commanded.
        hidden_sizes: neurons of each hidden layer.
        num_actions: how many a categorical policy chooses from.
        rate_margin: the fraction of the rate limit that :func:`attjax.control.assurance.rate_mask`
            keeps; 0: no mask. Continuous actions are not masked.
        initial_weights: "orthogonal", or "uniform" up to 1/√inputs with biases, as PyTorch's.
        actions: "discrete"; or "continuous", a Gaussian over (3,) fractions of the largest torques.
    """

    features: str | Callable = "state"
    hidden_sizes: tuple[int, ...] = (400, 300)
    num_actions: int = 19
    rate_margin: float = 0.0
    initial_weights: str = "orthogonal"
    actions: str = "discrete"

    @property
    def distribution_family(self) -> type[Categorical] | type[Gaussian]:
        """What its actions are drawn from."""
        return Gaussian if self.actions == "continuous" else Categorical

    @property
    def policy_network(self) -> MLP:
        """From features to logits, or to the two parameters of a Gaussian for each axis."""
        outputs = 6 if self.actions == "continuous" else self.num_actions
        return MLP(self.hidden_sizes, outputs, 0.01, self.initial_weights)

    @property
    def value_network(self) -> MLP:
        """From features to V(s)."""
        return MLP(self.hidden_sizes, 1, 1.0, self.initial_weights)

    def init(
        self,
        policy_key: chex.PRNGKey,
        value_key: chex.PRNGKey,
        observation: chex.Array,
        context: Context,
    ) -> dict:
        """Random parameters {"policy": ..., "value": ...} for such an observation (size,)."""
        features = self.encode(observation, context).features[None]
        return {
            "policy": self.policy_network.init(policy_key, features),
            "value": self.value_network.init(value_key, features),
        }

    def encode(self, observation: chex.Array, context: Context) -> Inputs:
        """Features and mask of one observation (size,); no parameters are involved."""
        given = self.features
        function = FEATURES[given] if isinstance(given, str) else given
        features = function(observation, context)
        if self.actions == "continuous":
            return Inputs(features, None)
        allowed, backward = jnp.ones(self.num_actions, bool), None
        if self.is_universal:
            backward, context = backward_axes(observation, context), torque_order.ordered(context)
        if self.rate_margin > 0:
            angular_velocity = observation[observations.ANGULAR_VELOCITY]
            allowed = assurance.rate_mask(context, self.rate_margin).allowed(angular_velocity)
        if self.is_universal:
            allowed &= torque_order.alive(context)
        return Inputs(features, allowed, backward)

    @property
    def is_universal(self) -> bool:
        """Whether it flies any spacecraft with three torque axes."""
        return self.features == "universal"

    def command(self, action: chex.Array, context: Context) -> chex.Array:
        """The spacecraft's action, a row of its torque table or (3,) fractions, of the policy's."""
        return torque_order.rows(context)[action] if self.is_universal else action

    def outputs(self, params: dict, inputs: Inputs) -> chex.Array:
        """(outputs, samples) of (samples, ...) inputs: logits are MASKED_LOGIT where masked."""
        outputs: chex.Array = self.policy_network.apply(params["policy"], inputs.features)
        if inputs.allowed is None:
            return outputs
        if inputs.backward is not None:
            outputs = torque_order.turned_back(outputs, inputs.backward)
        return jnp.where(inputs.allowed.T, outputs, MASKED_LOGIT)

    def distribution(self, params: dict, inputs: Inputs) -> Categorical | Gaussian:
        """What the actions are drawn from, of (samples, ...) inputs."""
        return self.distribution_family.of(self.outputs(params, inputs))

    def value(self, params: dict, features: chex.Array) -> chex.Array:
        """(samples,) V(s) of (samples, features)."""
        return self.value_network.apply(params["value"], features)[0]

    def act(self, params: dict, observation: chex.Array, context: Context) -> chex.Array:
        """The most probable action for one observation: int32, or (3,) fractions."""
        decided = self._decided(params, self.encode(observation, context), None)
        return self.command(decided, context)

    def draw(
        self, params: dict, key: chex.PRNGKey, observation: chex.Array, context: Context
    ) -> chex.Array:
        """A random action for one observation, as in training: the same for the same key and state.

        So it can be flown as any controller, which is told of no time and has no memory.
        """
        for word in jax.lax.bitcast_convert_type(observation.astype(jnp.float32), jnp.uint32):
            key = jax.random.fold_in(key, word)
        noise = self.distribution_family.noise(key, (), observation.dtype)
        decided = self._decided(params, self.encode(observation, context), noise)
        return self.command(decided, context)

    def scores(self, params: dict, observation: chex.Array, context: Context) -> chex.Array:
        """(rows of the torque table,) logits of one observation, MASKED_LOGIT where masked.

        Less where the row is none of those that the policy chooses from.
        """
        outputs = _one_of_a_batch(lambda params, inputs: self.outputs(params, inputs).T)
        logits = outputs(params, self.encode(observation, context))
        if not self.is_universal:
            return logits
        lowest = jnp.full(len(context.torque_table), 2 * MASKED_LOGIT, logits.dtype)
        return lowest.at[torque_order.rows(context)].max(logits)

    def _decided(self, params, inputs, noise):
        """The action for one spacecraft's inputs: drawn, or the mode where there is no noise."""

        def decide(params, samples):
            inputs, noise = samples
            outputs = self.outputs(params, inputs)
            if noise is None:
                return self.distribution_family.mode_of(outputs)
            return self.distribution_family.of(outputs).draw(noise)

        return _one_of_a_batch(decide)(params, (inputs, noise))


def _one_of_a_batch(function):
    """A function of parameters and samples (samples, ...) as one of a single sample.

    Under ``vmap`` it is the function of the batch. By itself ``vmap`` would make of a network's
    layers for a batch of one some that transpose all they compute, which takes twice as long.
    """

    def of_one(params, sample):
        batch_of_one = jax.tree.map(lambda x: x[None], sample)
        return function(params, batch_of_one)[0]

    batched = jax.custom_batching.custom_vmap(of_one)

    @batched.def_vmap
    def _of_a_batch(size, is_batched, params, sample):
        if any(jax.tree.leaves(is_batched[0])):
            axes = jax.tree.map(lambda x: 0 if x else None, is_batched)
            return jax.vmap(of_one, axes, axis_size=size)(params, sample), True
        samples = jax.tree.map(
            lambda x, is_one_each: x if is_one_each else jnp.broadcast_to(x, (size, *x.shape)),
            sample,
            is_batched[1],
        )
        return function(params, samples), True

    with_gradients = jax.custom_jvp(batched)  # of the batched form JAX has none in reverse

    @with_gradients.defjvp
    def _jvp(primals, tangents):
        return jax.jvp(of_one, primals, tangents)

    return with_gradients
