"""Deliberate faults that no rule of mutants.py makes, each with the tests that should see it."""

from agent_faults import AGENT_FAULTS
from assurance_faults import ASSURANCE_FAULTS
from loop_faults import LOOP_FAULTS
from world_faults import WORLD_FAULTS

PHYSICS = [
    "tests/test_truth.py",
    "tests/dynamics/test_propagation.py",
    "tests/dynamics/test_quaternion.py",
    "tests/envs/test_attitude.py",
]
LEARNING = [
    "tests/ppo/test_train.py",
    "tests/ppo/test_rollout.py",
    "tests/ppo/test_losses.py",
    "tests/envs/test_batch.py",
]
DESCENT = [
    "tests/ppo/test_descent.py",
    "tests/ppo/test_minibatches.py",
    "tests/ppo/test_losses.py",
    "tests/ppo/test_rollout.py",
]
RUNS = [
    "tests/runs/test_checkpoint.py",
    "tests/runs/test_folder.py",
    "tests/runs/test_metrics.py",
    "tests/commands/test_command_line.py",
]
FAULTS = {
    "sign of the gyroscopic term": (
        "attjax/dynamics/equations.py", "((i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3)",
        "((i3 - i2) / i1, (i1 - i3) / i2, (i2 - i1) / i3)", PHYSICS,
    ),
    "gyroscopic term of a full tensor without its symmetric part": (
        "attjax/dynamics/equations.py",
        "factors = factors + factors.swapaxes(1, 2)", "factors = 2 * factors",
        PHYSICS,
    ),
    "missing ½ in the kinematics": (
        "attjax/dynamics/quaternion.py",
        "factor * (w3 * q2 - w2 * q3 + w1 * qs)", "(w3 * q2 - w2 * q3 + w1 * qs)",
        PHYSICS,
    ),
    "wrong order in RK4": (
        "attjax/dynamics/integration.py", "k3 = equations.rate(advance(dt / 2, k2))",
        "k3 = equations.rate(advance(dt / 2, k1))", PHYSICS,
    ),
    "skipped normalisation": (
        "attjax/dynamics/propagation.py",
        "return quaternions.normalize(quaternion)", "return (quaternion)", PHYSICS,
    ),
    "one coasting step too many": (
        "attjax/dynamics/integration.py",
        "for n in range(count):", "for n in range(count + 1):", PHYSICS,
    ),
    "torque twice as strong": (
        "attjax/dynamics/integration.py", "change = call(first, limit, start, equations)",
        "change = call(first, limit, start, equations._replace("
        "torque=add(equations.torque, equations.torque)))", PHYSICS,
    ),
    "terminal reward added, not replacing": (
        "attjax/envs/reward.py", "jnp.where(inside, TERMINAL_BONUS, 0.0), reward)",
        "reward + jnp.where(inside, TERMINAL_BONUS, 0.0), reward)",
        ["tests/envs/test_reward.py", "tests/envs/test_attitude.py"],
    ),
    "time limit before overspeed": (
        "attjax/envs/attitude.py",
        "truncated = ~terminated & (next_state.time", "truncated = (next_state.time",
        ["tests/envs/test_attitude.py"],
    ),
    "GAE bootstraps over a termination": (
        "attjax/ppo/losses.py",
        "jnp.where(terminated, 0.0, next_values)", "next_values", ["tests/ppo/test_losses.py"],
    ),
    "GAE runs over the end of an episode": (
        "attjax/ppo/losses.py", "jnp.where(done, 0.0, 1.0)", "jnp.where(terminated, 0.0, 1.0)",
        ["tests/ppo/test_losses.py"],
    ),
    "clipped objective without the pessimistic bound": (
        "attjax/ppo/losses.py",
        "objective = jnp.minimum(", "objective = jnp.maximum(", ["tests/ppo/test_losses.py"],
    ),
    "annealing off by one": (
        "attjax/ppo/train_state.py", "settings.final_learning_rate, settings.gradient_steps",
        "settings.final_learning_rate, settings.gradient_steps - settings.minibatches", LEARNING,
    ),
    "key reused from update to update": (
        "attjax/ppo/rollout.py",
        "return learner.replace(key=key), steps", "return learner, steps", LEARNING,
    ),
    "same key for all steps of a rollout": (
        "attjax/ppo/rollout.py", "random = (noise, jax.random.split(flight_key, (length, 2)))",
        "random = (0 * noise + noise[0], jax.random.split(flight_key, (length, 2)))", LEARNING,
    ),
    "density of a Gaussian without its scale": (
        "attjax/ppo/distributions.py", "deviation**2 / 2 + self.log_std + math.log",
        "deviation**2 / 2 + math.log", ["tests/ppo/test_distributions.py"],
    ),
    "a Gaussian's greedy spacecraft explore": (
        "attjax/ppo/distributions.py", "jnp.where(np.asarray(greedy)[..., None], 0.0, noise)",
        "noise", ["tests/ppo/test_distributions.py"],
    ),
    "continuous training without its margin": (
        "attjax/runs/build.py", "rate_limit=margin * params.rate_limit",
        "rate_limit=params.rate_limit", ["tests/test_continuous_runs.py"],
    ),
    "all of a mapped step restart alike": (
        "attjax/envs/restart.py", "lambda x, own: x[row] if own else x, given",
        "lambda x, own: x[0] if own else x, given", ["tests/envs/test_restart.py"],
    ),
    "all of a fused rollout restart alike": (
        "attjax/envs/batch.py", "jax.random.fold_in(fresh_key, row)",
        "jax.random.fold_in(fresh_key, 0)", LEARNING,
    ),
    "a mapped step restarts whoever goes on": (
        "attjax/envs/restart.py", "jnp.where(ended, new, old), reset(*given), ongoing)",
        "jnp.where(ended, old, new), reset(*given), ongoing)", ["tests/envs/test_restart.py"],
    ),
    "devices draw the same numbers": (
        "attjax/ppo/rollout.py",
        "jax.random.fold_in(device_key, jax.lax.axis_index(sharding.AXIS))",
        "jax.random.fold_in(device_key, 0)", LEARNING,
    ),
    "closest angle is the last": (
        "attjax/evaluation/blocks.py",
        "closest_angle=jnp.where(closer, angle, so_far.closest_angle)",
        "closest_angle=angle", ["tests/evaluation/test_episodes.py"],
    ),
    "closest rate is the last": (
        "attjax/evaluation/blocks.py",
        "closest_rate=jnp.where(closer, rate, so_far.closest_rate)",
        "closest_rate=rate", ["tests/evaluation/test_episodes.py"],
    ),
    "impulse of a held torque is that of a pulse, in evaluation": (
        "attjax/evaluation/blocks.py",
        "env.context(first).torque_duration", "(1 / 240)", ["tests/evaluation/test_episodes.py"],
    ),
    "impulse of a held torque is that of a pulse, for a reward": (
        "attjax/envs/attitude.py", "self.context(params).torque_duration,", "INTEGRATION_STEP,",
        ["tests/envs/test_attitude.py"],
    ),
    "sign in TABLE_5": (
        "attjax/evaluation/paper.py",
        '"slew2": (0.44228, -0.44228', '"slew2": (0.44228, 0.44228',
        ["tests/control/test_time_optimal.py"],
    ),
    "factor of the time-optimal reference": (
        "attjax/control/time_optimal.py", "return 2 * numerics.square_root(",
        "return 3 * numerics.square_root(", ["tests/control/test_time_optimal.py"],
    ),
    "reward_scale ignored": (
        "attjax/ppo/rollout.py",
        "*= setup.settings.task.reward_scale", "*= 1.0", ["tests/ppo/test_rollout.py"],
    ),
    "max_gradient_norm ignored": (
        "attjax/ppo/train_state.py", "if settings.max_gradient_norm > 0:", "if False:", DESCENT,
    ),
    "normalize_advantage ignored: always": (
        "attjax/ppo/descent.py", "if settings.normalize_advantage:", "if True:", DESCENT,
    ),
    "normalize_advantage ignored: never": (
        "attjax/ppo/descent.py", "if settings.normalize_advantage:", "if False:", DESCENT,
    ),
    "same shuffle in each pass": (
        "attjax/ppo/descent.py", "jax.random.split(pass_key, settings.passes)",
        "jnp.stack([pass_key] * settings.passes)", DESCENT,
    ),
    "same shuffle on each device": (
        "attjax/ppo/descent.py", "jax.random.fold_in(pass_key, jax.lax.axis_index(AXIS))",
        "jax.random.fold_in(pass_key, 0)", DESCENT,
    ),
    "approximate KL without its ratio": (
        "attjax/ppo/losses.py", "jnp.mean(ratio - 1 - log_ratio)", "jnp.mean(-log_ratio)",
        ["tests/ppo/test_losses.py"],
    ),
    "multi-scale features without the period": (
        "attjax/control/features.py", "10 * self.control_period, jnp.log(10 * self.control_period)",
        "0 * self.control_period, 0 * self.control_period", ["tests/control/test_features.py"],
    ),
    "rate mask without its second-order remainder": (
        "attjax/dynamics/rigid_body.py", "MOST_TURNING = 0.5**0.5", "MOST_TURNING = 0.0",
        ["tests/control/test_rate_limit.py"],
    ),
    "observation bound without coasting": (
        "attjax/envs/spaces.py",
        "(params.rate_limit + kick) * jnp.sqrt(jnp.max(moments) / jnp.min(moments))",
        "(params.rate_limit + kick)", ["tests/envs/test_observation_space.py"],
    ),
    "optimizer not restored": (
        "attjax/runs/checkpoint.py", "    return restored.replace(key=",
        "    return restored.replace(optimizer=template.optimizer, key=", RUNS,
    ),
    "rows after the checkpoint kept": (
        "attjax/runs/metrics_file.py", 'if int(row["agent_steps"]) <= resume_at', "if True", RUNS,
    ),
    "no lock on the folder": (
        "attjax/runs/folder.py", "fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)", "pass", RUNS,
    ),
} | WORLD_FAULTS | LOOP_FAULTS | ASSURANCE_FAULTS | AGENT_FAULTS  # fmt: skip
"""By name: module, code, what it becomes, tests that should catch it."""
