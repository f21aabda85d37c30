"""TOML files that describe a training run: ``--config`` and ``--print-config``."""

import dataclasses
import json
import textwrap
import tomllib
from pathlib import Path

from attjax import help_text, presets, settings
from attjax.cli import UserError
from attjax.run_folder import Config

SETTINGS = {field.name: field for field in dataclasses.fields(settings.Settings)}
OTHERS = (
    settings.single("preset", str, "the recipe", choices=tuple(presets.PRESETS)),
    settings.single("seed", int, "of everything random", low=0, below=2**32),
)
FIELDS = SETTINGS | {field.name: field for field in OTHERS}


def read(path: Path) -> dict:
    """The preset, the seed and the settings that a file gives, by name; it need not give all.

    Raises:
        UserError: it cannot be read, or something in it is unknown or out of range.
    """
    try:
        content = tomllib.loads(path.read_text())
    except OSError as error:
        raise UserError(f"--config {path} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise UserError(f"--config {path} is no TOML: {error}") from None
    given = content.pop("settings", {})
    if not isinstance(given, dict):
        raise UserError(f"--config {path}: settings must be a table, [settings]")
    unknown = content.keys() - {field.name for field in OTHERS} | given.keys() - SETTINGS.keys()
    if unknown:
        raise UserError(f"--config {path} has unknown names: {', '.join(sorted(unknown))}")
    given = {k: tuple(v) if isinstance(v, list) else v for k, v in given.items()}
    try:
        for name, value in (content | given).items():
            settings.check(FIELDS[name], value)
    except ValueError as error:
        raise UserError(f"--config {path}: {error}") from None
    return content | given


def text(config: Config) -> str:
    """The file that reproduces a run, in ASCII, with a comment for each setting.

    Example:
        >>> text(Config("paper", 3, presets.PAPER)).splitlines()[:2]
        ['preset = "paper"', 'seed = 3']
    """
    lines = [f'preset = "{config.preset}"', f"seed = {config.seed}", "", "[settings]"]
    for group, title in settings.GROUPS.items():
        lines += ["", f"# --- {title} ---"]
        for name, field in SETTINGS.items():
            if field.metadata["group"] == group:
                value = getattr(config.settings, name)
                shown = json.dumps(list(value) if isinstance(value, tuple) else value)
                lines += [*_comment(field), f"{name} = {shown}"]
    return help_text.plain("\n".join(lines)) + "\n"


def _comment(field):
    described = "; ".join(filter(None, (help_text.meaning(field), settings.limits(field))))
    return textwrap.wrap(described, 100, initial_indent="# ", subsequent_indent="# ")
