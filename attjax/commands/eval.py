"""Judge an attitude controller over random slews, as in the paper's Table 2."""

import argparse
import contextlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from attjax import destinations, devices, errors
from attjax.commands import assured, evaluation_output, evaluation_subject, robustness
from attjax.commands.evaluation_subject import POLICY
from attjax.config import command_line, fields
from attjax.spacecraft import MOST_DURATION
from attjax.values import ACTIONS

STDOUT = Path("-")
CLASSICAL = ("phase-plane", "feedback")
USAGE = "%(prog)s [--checkpoint FOLDER | --controller NAME] [--compare] [FLAG ...]"
EXAMPLES = """\
examples:
  python eval.py --checkpoint ckpt/                 5,000 random slews
  python eval.py --checkpoint ckpt/ --frameskip 20  the same at 11.43 Hz
  python eval.py --checkpoint ckpt/ --compare       beside the classical ones
  python eval.py --checkpoint ckpt/ --json result.json --plot figures/
  python eval.py --checkpoint ckpt/ --json - | python -m json.tool
  python eval.py --checkpoint ckpt/ --playback slews.html
  python eval.py --controller phase-plane           needs no checkpoint
  python eval.py --checkpoint ckpt/ --robustness    in imperfect worlds
  python eval.py --checkpoint pretrained/universal --fleet --frameskip 20
"""


def parse_arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = command_line.Parser(
        usage=USAGE, description=__doc__, epilog=command_line.examples(EXAMPLES)
    )
    _add_who(parser.add_argument_group("what to evaluate"))
    _add_conditions(parser.add_argument_group("conditions, the same for all controllers"))
    _add_output(parser.add_argument_group("output"))
    return parser.parse_args(argv)


def _add_who(group):
    command_line.add_checkpoint(group)
    command_line.add_best(group)
    who = group.add_mutually_exclusive_group()
    controller_help = "the trained policy (default), or a classical controller, without checkpoint"
    who.add_argument(
        "--controller", choices=(POLICY, *CLASSICAL), default=POLICY, help=controller_help
    )
    compare_help = "policy, classical controllers and the paper side by side, on the same slews"
    who.add_argument("--compare", action="store_true", help=compare_help)
    sampled_help = "let the policy draw its actions as in training, not take the most probable"
    robustness_help = (
        "the same three through a ladder of conditions: inertia, torques, sensors and delays that "
        "are not as believed, and each named world"
    )
    who.add_argument("--robustness", action="store_true", help=robustness_help)
    group.add_argument("--sampled", action="store_true", help=sampled_help)
    bare_help = (
        "tell the controllers what the sensors say; otherwise an estimator filters it, and a "
        "predictor looks ahead of known delays (the same where the world is ideal)"
    )
    group.add_argument("--bare", action="store_true", help=bare_help)
    adaptive_help = (
        "let the flight loop identify inertia and torques in flight, and tell the controllers what "
        "it finds"
    )
    group.add_argument("--adaptive", action="store_true", help=adaptive_help)
    assured_help = (
        "let through only actions after which every plant that the world states keeps the rate "
        "limit, the wheels' speeds and the cones of --keep-out; else the best that does"
    )
    group.add_argument("--assured", action="store_true", help=assured_help)
    actions_help = (
        "how classical controllers without checkpoint act: by one of the torques (default), or by "
        "any about the three axes at once; a policy acts as it was trained to"
    )
    group.add_argument("--actions", choices=ACTIONS, help=actions_help)


def _add_conditions(group):
    episodes_help = "number of random slews (default: 5000; with --robustness 1000 a condition)"
    command_line.add_number(group, "episodes", int, None, episodes_help, low=1, high=10**7)
    command_line.add_frameskip(
        group, "RK4 steps of 1/240 s after the first of a decision, for 240/(N + 1) Hz"
    )
    craft_help = (
        "TOML file of the spacecraft that flies (default: the one that the policy was trained on; "
        "for a classical controller the named world's, else LM50)"
    )
    group.add_argument("--spacecraft", type=command_line.path, metavar="FILE", help=craft_help)
    fleet_help = (
        "fly each slew with another spacecraft, drawn as those that universal trains on, and "
        "compare with what each of them can"
    )
    group.add_argument("--fleet", action="store_true", help=fleet_help)
    command_line.add_world(group, "that of the policy's training; ideal for a classical controller")
    command_line.add_keep_out(group)
    duration_help = "length of an episode (default: the spacecraft's; LM50's is 43.75)"
    limits = {"above": 0, "high": MOST_DURATION}
    command_line.add_number(group, "duration", float, None, duration_help, unit="s", **limits)
    command_line.add_seed_and_device(group, "seed of the initial slews")


def _add_output(group):
    json_help = "also write the statistics here; -: to stdout, and the report to stderr"
    group.add_argument("--json", type=command_line.path, metavar="FILE", help=json_help)
    plot_help = "also draw figures into this folder (needs the extra plot)"
    group.add_argument("--plot", type=command_line.path, metavar="FOLDER", help=plot_help)
    playback_help = (
        "also write a web page that replays slews in 3-D: the controller beside phase-plane, or "
        "phase-plane beside feedback"
    )
    group.add_argument("--playback", type=command_line.path, metavar="FILE", help=playback_help)


@errors.program("eval.py")
def main(argv: Sequence[str] | None = None) -> int:
    """Evaluate a checkpoint or a classical controller; returns the exit status."""
    arguments = parse_arguments(argv)
    advice = "fewer --episodes take less"
    with errors.one_line_errors(), errors.enough_memory(advice):
        devices.select_device(arguments.device)
        is_alone = not (arguments.compare or arguments.robustness)
        names = (arguments.controller,) if is_alone else (POLICY, *CLASSICAL)
        evaluation_subject.complete(arguments)
        config = evaluation_subject.config(arguments, names)
        trained = config.settings.task.frameskips if config else None
        if arguments.frameskip is None:
            arguments.frameskip = fields.frameskip_to_judge(trained or ())
        world = evaluation_subject.world(arguments, config)
        spacecraft = evaluation_subject.spacecraft(arguments, config, world)
        env = evaluation_subject.env(arguments, config, spacecraft, world)
        assurance = assured.asked_for(arguments, env)
        how = arguments, env, config, assurance
        controllers = {name: evaluation_subject.flown(name, *how) for name in names}
        if arguments.json not in (None, STDOUT):
            destinations.check("--json", arguments.json)
        evaluation_output.prepare_playback(
            arguments.playback, spacecraft.max_steps(arguments.frameskip)
        )
        plots = evaluation_output.prepare_plots(arguments.plot)
        is_drawn = plots is not None and POLICY in controllers
        metrics = evaluation_output.metrics_rows(arguments.checkpoint) if is_drawn else []
        json_file = arguments.json
        aside: contextlib.AbstractContextManager = contextlib.nullcontext()
        if json_file == STDOUT:
            json_file, aside = sys.stdout, contextlib.redirect_stdout(sys.stderr)
        command_line.warn_of_untrained(arguments.frameskip, trained)
        with aside:
            if arguments.robustness:
                return robustness.judge(arguments, controllers, env, json_file)
            return _evaluate(how, controllers, plots, metrics, json_file)


def _evaluate(how, controllers, plots, metrics, json_file):
    """Fly, draw, write and print."""
    # Imported late: with them, --help and errors in the arguments would take seconds.
    from attjax import evaluation
    from attjax.evaluation import tables

    arguments, env, config, assurance = how
    params, seed, episodes = env.default_params, arguments.seed or 0, arguments.episodes
    judge = evaluation.evaluate_fleet if arguments.fleet else evaluation.evaluate
    start, results, written = time.monotonic(), [], []
    for name, controller in controllers.items():
        with evaluation_output.flying(name, episodes) as told:
            judged = judge(controller, env, episodes=episodes, seed=seed, progress=told)
        shown = f"{name}, adaptive" if arguments.adaptive else name
        results.append({"controller": shown} | judged | assured.told(assurance))
        if plots:
            folder = arguments.plot / name if arguments.compare else arguments.plot
            flight = plots.Flight(controller, env, params, seed, episodes)
            rows = metrics if name == POLICY else []
            written += evaluation_output.draw(flight, rows, folder)
    seconds = time.monotonic() - start
    try:
        if json_file:
            evaluation_output.write_json(
                json_file, {"controllers": results} if arguments.compare else results[0]
            )
        if arguments.playback:
            _write_playback(how, controllers)
            written.append(arguments.playback)
    finally:  # where one of them fails, too
        for path in written:
            print(f"wrote {path}")
        if arguments.compare:
            tables.print_comparison(results, env.spacecraft)
        else:
            tables.print_report(results[0], env.spacecraft)
        if assurance is not None:
            print(assured.line(assurance))
        if beside := evaluation_subject.companion(arguments, config):
            print(f"where an axis is found to be dead: the policy in {beside}")
        print(f"evaluated in {seconds:.1f} s, compilation included")
    return 0


def _write_playback(how, controllers):
    """The controller that is judged beside phase-plane, or that beside feedback."""
    from attjax.evaluation.playback import page as playback

    arguments, env, _, assurance = how
    name = next(iter(controllers))
    other = "feedback" if name == "phase-plane" else "phase-plane"
    beside = evaluation_subject.flown(other, arguments, env, None, assurance)
    shown = {name: controllers[name], other: beside}
    checkpoint = arguments.checkpoint.resolve().name if name == POLICY else None
    page = playback.page(shown, env, env.default_params, arguments.seed or 0, checkpoint)
    evaluation_output.write_text(arguments.playback, page)
