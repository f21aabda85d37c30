"""Deliberate faults of the flight loop, for faults.py: what filter and predictor leave out."""

FILTER = ["tests/control/test_estimator.py"]
LOOP = ["tests/control/test_flight_loop.py"]
LATE = ["tests/control/test_lateness.py"]
COVARIANCE = ["tests/control/test_covariance.py"]
LOOP_FAULTS = {
    "a late star tracker taken for one of now": (
        "attjax/control/measured.py",
        "seen_from = vectors.then(seen_from, vectors.conjugate(expected.turn))",
        "seen_from = vectors.then(seen_from, (0.0, 0.0, 0.0, 1.0))", FILTER,
    ),
    "a bias of the other sign": (
        "attjax/control/measured.py", "        rate = vectors.add(rate, estimate.bias)",
        "        rate = vectors.add(rate, vectors.scaled(-1, estimate.bias))", FILTER,
    ),
    "errors of the attitude in the frame before": (
        "attjax/control/linearized.py", "turned = vectors.attitude_matrix(motion.turn)",
        "turned = tuple(zip(*vectors.attitude_matrix(motion.turn)))", FILTER,
    ),
    "wheels without momentum in the filter": (
        "attjax/control/linearized.py", "momentum = vectors.add(momentum, aboard)",
        "momentum = vectors.add(momentum, vectors.scaled(0, aboard))", FILTER,
    ),
    "a gyro's noise for any time between samples": (
        "attjax/envs/knowledge.py", "white**2 / interval", "white**2", FILTER,
    ),
    "disturbances that never change": (
        "attjax/control/linearized.py", "walk = known.torque.walk(_length(rate)) * period",
        "walk = 0 * known.torque.walk(_length(rate)) * period", FILTER,
    ),
    "a predictor that looks one RK4 step too far": (
        "attjax/control/belief.py", "frameskip=known.delay - 1", "frameskip=known.delay", LOOP,
    ),
    "torques under way that stay where they are": (
        "attjax/control/flight_loop.py", "queue.later(belief.rk4_steps(context))", "queue", LOOP,
    ),
    "a delay that is believed, whatever comes": (
        "attjax/control/lateness.py", "return surprises + jax.vmap(surprise)(delays)",
        "return surprises", LATE,
    ),
    "delays told apart by rates alone": (
        "attjax/control/lateness.py", "for x, s, f in zip(numbers, spread, floor)",
        "for x, s, f in zip(numbers[:3], spread, floor)", LATE,
    ),
    "a predictor that looks ahead by the most of the delays": (
        "attjax/control/belief.py", "(agent_step, delay - 1, (None, None))",
        "(agent_step, None, (None, None))", LATE,
    ),
    "a held torque for the whole period, whenever it begins": (
        "attjax/control/belief.py", "steps_on = following - start", "steps_on = steps", LOOP,
    ),
    "rounding left out of a variance": (
        "attjax/control/covariance.py", "rounded = ROUNDINGS * rounding", "rounded = 0 * rounding",
        COVARIANCE,
    ),
}  # fmt: skip
"""As faults.FAULTS."""
