"""What ``--help`` says of the settings, in how many columns, and on terminals without Greek."""

import argparse
import codecs
import dataclasses
import shutil
import sys
import textwrap

from attjax import presets

MOST_COLUMNS = 100
PLAIN = {
    "γ": "gamma", "λ": "lambda", "ε": "epsilon", "φ": "phi", "ω": "omega", "θ": "theta",
    "Â": "A^", "°": "deg", "²": "^2", "½": "1/2", "‖": "|", "–": "-", "−": "-", "—": "-",
    "…": "...", "×": "x", "·": "*", "≤": "<=", "≥": ">=", "→": "->", "µ": "u", "─": "-", "━": "-",
}  # fmt: skip


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Of the terminal's width, up to 100 columns; ``--[no-]flag`` in place of two flags."""

    def __init__(self, prog):
        columns = min(shutil.get_terminal_size().columns, MOST_COLUMNS)
        super().__init__(prog, max_help_position=30, width=columns - 1)

    def _split_lines(self, text, width):
        return textwrap.wrap(text, width, break_on_hyphens=False)

    def _format_action_invocation(self, action):
        if isinstance(action, argparse.BooleanOptionalAction):
            return action.option_strings[0].replace("--", "--[no-]", 1)
        return super()._format_action_invocation(action)


def meaning(field: dataclasses.Field) -> str:
    """What a setting is: symbol, meaning, unit.

    Example:
        >>> from attjax.settings import FIELDS
        >>> meaning(FIELDS["discount"])
        'γ: discount of later rewards (Eq. 2)'
    """
    symbol, unit = field.metadata["symbol"], field.metadata["unit"]
    return (f"{symbol}: " if symbol else "") + field.metadata["help"] + (f" [{unit}]" * bool(unit))


def defaults(name: str) -> str:
    """A setting's value in the presets, once where they agree.

    Example:
        >>> defaults("clip"), defaults("discount")
        ('default: 0.2', 'precise: 0.995; paper, paper-fast: 0.99')
    """
    presets_of = {}
    for preset, values in presets.PRESETS.items():
        presets_of.setdefault(show(getattr(values, name)), []).append(preset)
    if len(presets_of) == 1:
        return f"default: {next(iter(presets_of))}"
    return "; ".join(f"{', '.join(names)}: {value}" for value, names in presets_of.items())


def show(value) -> str:
    """A value as its flag takes it; yes or no for a switch.

    Example:
        >>> show(1e-4), show(40_000_000), show((5, 20)), show(True)
        ('0.0001', '40_000_000', '5,20', 'yes')
    """
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:_}" if value >= 10_000 else str(value)
    return f"{value:g}" if isinstance(value, float) else value


def plain(text: str) -> str:
    """The text in ASCII.

    Example:
        >>> plain("φ ≤ 0.25°")
        'phi <= 0.25deg'
    """
    return text.encode("ascii", ERRORS).decode()


def print_anywhere() -> None:
    """Let stdout and stderr take any text: what their encoding lacks is written out in ASCII."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=ERRORS)


def _replace(error):
    """A codec's error handler."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(PLAIN.get(character, "?") for character in lacking), error.end


ERRORS = "attjax.plain"
codecs.register_error(ERRORS, _replace)
