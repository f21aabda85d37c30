"""Judge a trained attitude controller over random slews, as in the paper's Table 2.

Example:
    python eval.py --checkpoint ckpt/
    python eval.py --checkpoint ckpt/ --frameskip 20 --json result.json
    python eval.py --controller phase-plane
    python eval.py --checkpoint ckpt/ --compare
    python eval.py --checkpoint ckpt/ --playback slews.html
"""

import json
import os
import sys
import time
from pathlib import Path

from attjax import cli, run_folder

POLICY = "policy"
CLASSICAL = ("phase-plane", "feedback")


def parse_arguments(argv):
    parser = cli.Parser(prog="eval.py", description=__doc__)
    cli.add_common(parser, seed_help="of the initial slews (default: 0)")
    who = parser.add_mutually_exclusive_group()
    controller_help = "the trained policy (default), or a classical controller, without checkpoint"
    who.add_argument(
        "--controller", choices=(POLICY, *CLASSICAL), default=POLICY, help=controller_help
    )
    compare_help = "policy, classical controllers and the paper side by side, on the same slews"
    who.add_argument("--compare", action="store_true", help=compare_help)
    best_help = "the checkpoint with the least terminal error in training, not the newest"
    parser.add_argument("--best", action="store_true", help=best_help)
    cli.add_number(parser, "episodes", int, 5000, "number of slews", low=1, high=10**7)
    frameskip_help = "torque-free RK4 steps after an impulse; the control rate is 240/(N + 1) Hz"
    cli.add_number(parser, "frameskip", int, 5, frameskip_help, low=0, below=10_500)
    cli.add_number(parser, "duration", float, 43.75, "length of an episode, s", above=0, high=1e6)
    plot_help = "also draw figures into this folder (needs the extra plot)"
    parser.add_argument("--plot", type=Path, metavar="FOLDER", help=plot_help)
    playback_help = (
        "also write a web page that replays slews in 3-D: the controller beside phase-plane, or "
        "phase-plane beside feedback"
    )
    parser.add_argument("--playback", type=Path, metavar="FILE", help=playback_help)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the statistics here")
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Evaluate a checkpoint or a classical controller; returns the exit status."""
    arguments = parse_arguments(argv)
    advice = "fewer --episodes take less"
    with cli.one_line_errors("eval.py", run_folder.FolderError), cli.enough_memory(advice):
        cli.select_device(arguments.device)
        steps = _episode_steps(arguments.duration, arguments.frameskip)
        names = (POLICY, *CLASSICAL) if arguments.compare else (arguments.controller,)
        controllers = {name: _controller(name, arguments) for name in names}
        _check_writable("--json", arguments.json)
        _prepare_playback(arguments.playback, steps)
        plots = _prepare_plots(arguments.plot)
        metrics = _metrics(arguments.checkpoint) if plots and POLICY in controllers else []
        return _evaluate(arguments, controllers, steps, plots, metrics)


def _evaluate(arguments, controllers, steps, plots, metrics):
    """Fly, print, draw and write."""
    # Imported late: with them, --help and errors in the arguments would take seconds.
    import jax
    import jax.numpy as jnp

    from attjax import AttitudeEnv, evaluation, report

    env = AttitudeEnv(arguments.frameskip)
    params = env.default_params.replace(max_steps_in_episode=jnp.array(steps, jnp.int32))
    start = time.monotonic()
    seed, results = arguments.seed or 0, []
    conditions = evaluation.conditions(env, params, seed, arguments.episodes)
    for name, controller in controllers.items():
        flown = evaluation.fly(controller, env, params, jax.random.key(seed), arguments.episodes)
        statistics = evaluation.statistics(flown, env, params)
        results.append({"controller": name} | conditions | statistics)
        if plots:
            folder = arguments.plot / name if arguments.compare else arguments.plot
            flight = plots.Flight(controller, env, params, seed, flown)
            for path in plots.write_all(flight, folder, metrics if name == POLICY else []):
                print(f"wrote {path}")
    if arguments.compare:
        report.print_comparison(results)
    else:
        report.print_report(results[0])
    print(f"evaluated in {time.monotonic() - start:.1f} s, compilation included")
    if arguments.json:
        content = {"controllers": results} if arguments.compare else results[0]
        with run_folder.writing(arguments.json):
            arguments.json.write_text(json.dumps(content, indent=2) + "\n")
    if arguments.playback:
        _write_playback(arguments, controllers, env, params)
    return 0


def _metrics(folder):
    """The rows of the run's metrics.csv, for the learning curve."""
    from attjax import progress

    return progress.read_rows(folder / run_folder.METRICS)


def _prepare_plots(folder):
    """The module that draws, with its folder made; None where no plots were asked for."""
    if folder is None:
        return None
    try:
        from attjax import plots
    except ImportError:
        raise cli.UserError("--plot needs matplotlib: pip install 'attjax[plot]'") from None
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cli.UserError(f"--plot {folder} cannot be written: {error.strerror}") from None
    return plots


def _prepare_playback(path, steps):
    """Fail before the work rather than after it."""
    if path is None:
        return
    from attjax import playback

    if steps > playback.MAX_STEPS:
        raise cli.UserError(
            f"--playback shows slews of at most {playback.MAX_STEPS:,} agent steps, and these "
            f"have {steps:,}: give a shorter --duration or a larger --frameskip"
        )
    if os.path.exists(path) and not os.path.isfile(path):
        raise cli.UserError(f"--playback {path} cannot be written: it is no ordinary file")
    _check_writable("--playback", path)
    _check_writable("--playback", path.with_name(path.name + ".tmp"))  # as run_folder.replace does


def _write_playback(arguments, controllers, env, params):
    """The controller that is judged beside phase-plane, or that beside feedback."""
    from attjax import playback

    name = next(iter(controllers))
    other = "feedback" if name == "phase-plane" else "phase-plane"
    shown = {name: controllers[name], other: _controller(other, arguments)}
    checkpoint = arguments.checkpoint.resolve().name if name == POLICY else None
    page = playback.page(shown, env, params, arguments.seed or 0, checkpoint)
    with run_folder.writing(arguments.playback):
        run_folder.replace(arguments.playback, page)
    print(f"wrote {arguments.playback}")


def _controller(name, arguments):
    import jax

    from attjax import checkpoint, controllers

    if name == POLICY:
        update = checkpoint.best(arguments.checkpoint) if arguments.best else None
        return checkpoint.restore_policy(arguments.checkpoint, update)
    return jax.tree_util.Partial(controllers.CONTROLLERS[name])


def _episode_steps(duration, frameskip):
    """Whole agent steps in the duration; 43.75 s at frameskip 5 are 1,750."""
    steps = int(duration * 240 / (frameskip + 1) + 1e-6)
    if not 1 <= steps < 2**31:
        raise cli.UserError(
            f"--duration is {duration} s; it must hold at least one agent step of "
            f"{(frameskip + 1) / 240:.4g} s, and fewer than 2^31"
        )
    return steps


def _check_writable(flag, path):
    """Fail before the work rather than after it; leaves no new file behind."""
    if path is None:
        return
    try:
        existed = path.exists()
        path.open("a").close()
    except OSError as error:
        raise cli.UserError(f"{flag} {path} cannot be written: {error.strerror}") from None
    if not existed:
        path.unlink()


if __name__ == "__main__":
    sys.exit(main())
