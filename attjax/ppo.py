"""PPO: rollout, advantages and clipped updates, fused in one jitted block.

Works with any environments of ``AttitudeEnv``'s protocol; several at once make one batch.
"""

import dataclasses
import functools
from typing import Any

import chex
import jax
import jax.numpy as jnp
import optax
from flax import struct

from attjax import losses
from attjax.networks import Inputs, Policy
from attjax.settings import Settings


@dataclasses.dataclass(frozen=True)
class Setup:
    """The static part of a run: environments, the policy that serves them all, settings."""

    envs: tuple
    policy: Policy
    settings: Settings

    @property
    def slices(self) -> list[slice]:
        """Where each environment's spacecraft stand among the ``num_envs`` of the batch."""
        total, groups = self.settings.num_envs, len(self.envs)
        bounds = [i * total // groups for i in range(groups + 1)]
        return [slice(a, b) for a, b in zip(bounds, bounds[1:])]


@struct.dataclass
class Learner:
    """All that changes during training.

    Attributes:
        params: {"policy", "value"} network parameters.
        optimizer: {"policy", "value"} Adam's moments and step counts.
        env_states: batched states, one pytree an environment.
        observation: (num_envs, size) current observations.
        score: (num_envs,) sum of ``info["score"]`` over the current episodes.
        key: typed random key.
        update: updates done, int32.
    """

    params: dict
    optimizer: dict
    env_states: tuple
    observation: chex.Array
    score: chex.Array
    key: chex.PRNGKey
    update: chex.Array


@struct.dataclass
class Step:
    """What a rollout keeps of each step; fields are (rollout_length, num_envs, ...)."""

    inputs: Inputs
    action: chex.Array
    log_probability: chex.Array
    reward: chex.Array
    terminated: chex.Array
    truncated: chex.Array
    final_observation: chex.Array
    score: chex.Array
    outcome: dict[str, chex.Array]


@struct.dataclass
class Sample:
    """What the losses need of a step; fields are (samples, ...)."""

    inputs: Inputs
    action: chex.Array
    log_probability: chex.Array
    advantage: chex.Array
    target: chex.Array


def optimizer(settings: Settings) -> optax.GradientTransformation:
    """Adam, annealed linearly over the whole run, with optional gradient clipping."""
    gradient_steps = settings.num_updates * settings.passes * settings.minibatches
    schedule = optax.linear_schedule(
        settings.learning_rate, settings.final_learning_rate, gradient_steps
    )
    clip = optax.clip_by_global_norm(settings.max_gradient_norm)
    return optax.chain(clip if settings.max_gradient_norm else optax.identity(), optax.adam(schedule))


def init(setup: Setup, env_params: tuple, key: chex.PRNGKey) -> Learner:
    """A learner at its start. ``env_params`` holds one parameter set an environment."""
    key, policy_key, value_key, reset_key, time_key = jax.random.split(key, 5)
    reset_keys = jax.random.split(reset_key, setup.settings.num_envs)
    observations, states = [], []
    for env, params, group in zip(setup.envs, env_params, setup.slices):
        observation, state = jax.vmap(env.reset, (0, None))(reset_keys[group], params)
        if setup.settings.stagger_episodes:
            key_, shape = jax.random.fold_in(time_key, group.start), state.time.shape
            time = jax.random.randint(key_, shape, 0, params.max_steps_in_episode)
            state = state.replace(time=time)
        observations.append(observation)
        states.append(state)
    observation = jnp.concatenate(observations)
    context = setup.envs[0].context(env_params[0])
    params = setup.policy.init(policy_key, value_key, observation[0], context)
    return Learner(
        params=params,
        optimizer={name: optimizer(setup.settings).init(p) for name, p in params.items()},
        env_states=tuple(states),
        observation=observation,
        score=jnp.zeros(setup.settings.num_envs, observation.dtype),
        key=key,
        update=jnp.zeros((), jnp.int32),
    )


@functools.partial(jax.jit, static_argnames="setup", donate_argnames="learner")
def train_block(setup: Setup, env_params: tuple, learner: Learner, num_updates):
    """Run ``num_updates`` updates (traced, so that every block shares one compilation).

    Returns:
        The learner and metrics: "losses", means over the block's updates; "episodes", sums
        over the episodes that ended, one an environment; "diverged", for each checked
        quantity the first update in which it was not finite, −1 if none.
    """
    first_update = learner.update

    def body(_, carry):
        learner, totals, diverged = carry
        learner, metrics, finite = update(setup, env_params, learner)
        diverged = {
            name: jnp.where((diverged[name] < 0) & ~ok, learner.update, diverged[name])
            for name, ok in finite.items()
        }
        return learner, jax.tree.map(jnp.add, totals, metrics), diverged

    _, metrics, finite = jax.eval_shape(functools.partial(update, setup), env_params, learner)
    totals = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), metrics)
    diverged = {name: jnp.full((), -1, learner.update.dtype) for name in finite}
    learner, totals, diverged = jax.lax.fori_loop(
        0, num_updates, body, (learner, totals, diverged)
    )
    done = learner.update - first_update
    means = jax.tree.map(lambda x: x / done, totals["losses"])
    return learner, {"losses": means, "episodes": totals["episodes"], "diverged": diverged}


def update(setup: Setup, env_params: tuple, learner: Learner):
    """One update: rollout, advantages, N passes of minibatch gradient steps.

    Returns:
        The learner, its metrics and {name: bool} whether each checked quantity is finite.
    """
    contexts = [env.context(params) for env, params in zip(setup.envs, env_params)]
    learner, steps = rollout(setup, env_params, contexts, learner)
    samples = with_advantages(setup, contexts, learner, steps)
    learner, losses_ = optimize(setup, learner, samples)
    finite = {
        "observations": _all_finite(steps.inputs.features),
        "rewards": _all_finite(steps.reward),
        "losses": _all_finite(losses_),
        "parameters": _all_finite(learner.params),
    }
    metrics = {"losses": losses_, "episodes": episode_sums(setup, steps)}
    return learner.replace(update=learner.update + 1), metrics, finite


def rollout(setup, env_params, contexts, learner) -> tuple[Learner, Step]:
    """``rollout_length`` steps of all spacecraft under the current policy."""
    policy, num_envs = setup.policy, setup.settings.num_envs

    def step(learner, _):
        key, action_key, step_key = jax.random.split(learner.key, 3)
        inputs = encode(setup, contexts, learner.observation)
        log_probabilities = policy.log_probabilities(learner.params, inputs)
        action = jax.random.categorical(action_key, log_probabilities)
        results = [
            jax.vmap(env.step, (0, 0, 0, None))(keys, state, action_, params)
            for env, keys, state, action_, params in zip(
                setup.envs,
                (jax.random.split(step_key, num_envs)[group] for group in setup.slices),
                learner.env_states,
                (action[group] for group in setup.slices),
                env_params,
            )
        ]
        observations, env_states, *rest = zip(*results)
        reward, terminated, truncated, info = map(_concatenate, rest)
        score = learner.score + info["score"]
        step = Step(
            inputs=inputs,
            action=action,
            log_probability=_pick(log_probabilities, action),
            reward=reward * setup.settings.reward_scale,
            terminated=terminated,
            truncated=truncated,
            final_observation=info["final_observation"],
            score=score,
            outcome=info["outcome"],
        )
        learner = learner.replace(
            env_states=env_states,
            observation=jnp.concatenate(observations),
            score=jnp.where(terminated | truncated, 0.0, score),
            key=key,
        )
        return learner, step

    return jax.lax.scan(step, learner, length=setup.settings.rollout_length)


def encode(setup, contexts, observation) -> Inputs:
    """Network inputs of the (num_envs, size) observations, each group in its own context."""
    encode_group = jax.vmap(setup.policy.encode, (0, None))
    return _concatenate(
        [encode_group(observation[group], c) for group, c in zip(setup.slices, contexts)]
    )


def with_advantages(setup, contexts, learner, steps: Step) -> Sample:
    """Values of the whole rollout at once, its advantages and the value targets."""
    settings, policy = setup.settings, setup.policy
    values = policy.value(learner.params, steps.inputs.features)
    if settings.time_limit_terminates:
        terminated = steps.terminated | steps.truncated
        last = encode(setup, contexts, learner.observation).features
        last_value = policy.value(learner.params, last)
        next_values = jnp.concatenate([values[1:], last_value[None]])
    else:
        terminated = steps.terminated
        final = jax.vmap(functools.partial(encode, setup, contexts))(steps.final_observation)
        next_values = policy.value(learner.params, final.features)
    advantages = losses.generalized_advantages(
        steps.reward,
        values,
        next_values,
        terminated,
        steps.terminated | steps.truncated,
        discounts(setup, contexts),
        settings.gae_lambda,
    )
    samples = Sample(
        inputs=steps.inputs,
        action=steps.action,
        log_probability=steps.log_probability,
        advantage=advantages,
        target=advantages + values,
    )
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), samples)


def discounts(setup, contexts) -> chex.Array:
    """(num_envs,) discount of one agent step, or a scalar where it is the same for all."""
    settings = setup.settings
    if settings.discount_period == 0:
        return jnp.array(settings.discount, float)
    exponents = [c.control_period / settings.discount_period for c in contexts]
    sizes = jnp.array([group.stop - group.start for group in setup.slices])
    exponents = jnp.repeat(jnp.stack(exponents), sizes, total_repeat_length=settings.num_envs)
    return settings.discount**exponents


def optimize(setup, learner, samples: Sample) -> tuple[Learner, dict]:
    """N passes of shuffled minibatches. Returns the learner and the losses' means."""
    settings = setup.settings
    transformation = optimizer(settings)
    used = settings.minibatches * settings.minibatch_size

    def gradient_step(carry, sample):
        params, state = carry
        gradients, metrics = jax.grad(loss, argnums=1, has_aux=True)(setup, params, sample)
        new = {n: transformation.update(gradients[n], state[n], params[n]) for n in params}
        params = {n: optax.apply_updates(params[n], new[n][0]) for n in params}
        return (params, {n: new[n][1] for n in params}), metrics

    def one_pass(carry, key):
        order = jax.random.permutation(key, settings.steps_per_update)[:used]
        shuffled = jax.tree.map(
            lambda x: x[order].reshape(settings.minibatches, -1, *x.shape[1:]), samples
        )
        return jax.lax.scan(gradient_step, carry, shuffled)

    key, pass_key = jax.random.split(learner.key)
    (params, state), metrics = jax.lax.scan(
        one_pass,
        (learner.params, learner.optimizer),
        jax.random.split(pass_key, settings.passes),
    )
    learner = learner.replace(params=params, optimizer=state, key=key)
    return learner, jax.tree.map(jnp.mean, metrics)


def loss(setup: Setup, params: dict, sample: Sample) -> tuple[chex.Array, dict[str, Any]]:
    """Clipped objective with entropy bonus plus the value's mean squared error.

    The two networks share no parameters, so the sum trains each on its own loss.
    """
    settings, policy = setup.settings, setup.policy
    log_probabilities = policy.log_probabilities(params, sample.inputs)
    advantage = sample.advantage
    if settings.normalize_advantage:
        advantage = losses.standardize(advantage)
    policy_loss, diagnostics = losses.clipped_policy_loss(
        _pick(log_probabilities, sample.action), sample.log_probability, advantage, settings.clip
    )
    entropy = jnp.mean(losses.entropy(log_probabilities))
    residual = policy.value(params, sample.inputs.features) - sample.target
    value_loss = jnp.mean(residual**2)
    metrics = {
        "policy_loss": policy_loss,
        "value_loss": value_loss,
        "entropy": entropy,
        "explained_variance": 1 - jnp.var(residual) / (jnp.var(sample.target) + 1e-12),
        **diagnostics,
    }
    return policy_loss - settings.entropy_coefficient * entropy + value_loss, metrics


def episode_sums(setup, steps: Step) -> dict[str, chex.Array]:
    """Sums over the episodes that ended in a rollout, one an environment."""
    ended = (steps.terminated | steps.truncated).astype(steps.score.dtype)
    columns = {
        "episodes": ended,
        "score": ended * steps.score,
        "score_squared": ended * steps.score**2,
        **{name: ended * x for name, x in steps.outcome.items()},
    }
    return {
        name: jnp.stack([jnp.sum(x[:, group]) for group in setup.slices])
        for name, x in columns.items()
    }


def _concatenate(trees):
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *trees)


def _pick(log_probabilities, action):
    return jnp.take_along_axis(log_probabilities, action[..., None], axis=-1)[..., 0]


def _all_finite(tree):
    return jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(tree)]))
