"""The programs: what ``attjax train|eval|export``, and train.py, eval.py and export.py run."""

import importlib
import sys
from collections.abc import Sequence

import attjax
from attjax import errors
from attjax.config import command_line

COMMANDS = {
    "train": "train a neural attitude controller by PPO",
    "eval": "judge an attitude controller over random slews",
    "export": "write a trained controller for flight software",
}
USAGE = "attjax train|eval|export [FLAG ...]"


@errors.program("attjax")
def main(argv: Sequence[str] | None = None) -> int:
    """Run the program that the first argument names; returns its exit status."""
    argv = sys.argv[1:] if argv is None else argv
    command = _parse(argv[:1])
    module = importlib.import_module(f"attjax.commands.{command}")
    return module.main(argv[1:], prog=f"attjax {command}")


def _parse(argv):
    epilog = "attjax COMMAND --help lists the flags of a command."
    parser = command_line.Parser(usage=USAGE, description=attjax.__doc__, epilog=epilog)
    version = f"attjax {attjax.__version__}"
    parser.add_argument("--version", action="version", version=version, help="print the version")
    commands = parser.add_subparsers(
        title="commands", dest="command", metavar="COMMAND", required=True
    )
    for name, meaning in COMMANDS.items():
        commands.add_parser(name, help=meaning, add_help=False)
    return parser.parse_args(argv).command
