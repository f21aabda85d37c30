"""What ``--help`` says of the settings, and in how many columns."""

import argparse
import dataclasses
import shutil
import textwrap

from attjax.config import presets

MOST_COLUMNS = 100


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Of the terminal's width, up to 100 columns; ``--[no-]flag`` in place of two flags."""

    def __init__(self, prog: str):
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
        >>> from attjax.config.settings import FIELDS
        >>> meaning(FIELDS["discount"])
        'γ: discount of later rewards (Eq. 2)'
    """
    symbol, unit = field.metadata["symbol"], field.metadata["unit"]
    return (f"{symbol}: " if symbol else "") + field.metadata["help"] + (f" [{unit}]" * bool(unit))


def defaults(name: str) -> str:
    r"""A setting's value in the presets, once where they agree.

    Example:
        >>> defaults("clip")
        'default: 0.2'
        >>> print(*defaults("discount").split("; "), sep="\n")
        precise, precise-gpu, universal, two-torques, continuous: 0.995
        paper, paper-gae, paper-fast: 0.99
    """
    presets_of: dict[str, list[str]] = {}
    for preset, values in presets.PRESETS.items():
        presets_of.setdefault(show(values.flat[name]), []).append(preset)
    if len(presets_of) == 1:
        return f"default: {next(iter(presets_of))}"
    return "; ".join(f"{', '.join(names)}: {value}" for value, names in presets_of.items())


def show(value: tuple[int, ...] | bool | float | str) -> str:
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
