"""TOML files that describe a training run: ``--config`` and ``--print-config``."""

import contextlib
import dataclasses
import json
import textwrap
import tomllib
from pathlib import Path

from attjax import spacecraft as specification
from attjax import streams
from attjax.config import fields, help_text, presets, settings
from attjax.config.run import Config
from attjax.errors import UserError
from attjax.spacecraft import Spacecraft
from attjax.world import KeepOut, World, keep_out, names
from attjax.world.distributions import KINDS

SETTINGS = settings.FIELDS
OTHERS = (
    fields.single("preset", str, "the recipe", choices=tuple(presets.PRESETS)),
    fields.single("seed", int, "of everything random", **fields.SEED),
    fields.single("resume_from", str, "folder of the run whose networks it begins with"),
)
FIELDS = SETTINGS | {field.name: field for field in OTHERS}


def read(path: Path) -> dict:
    """Preset, seed, settings, spacecraft and world of a file, by name, and the folder that the run
    begins from; it need not give all.

    Raises:
        UserError: it cannot be read, or something in it is unknown or out of range.
    """
    with _one_line(f"--config {path}"):
        content = specification.read_toml(path)
    spacecraft = content.pop("spacecraft", None)
    world = content.pop("world", None)
    given = content.pop("settings", {})
    if not isinstance(given, dict):
        raise UserError(f"--config {path}: settings must be a table, [settings]")
    unknown = content.keys() - {field.name for field in OTHERS} | given.keys() - SETTINGS.keys()
    if unknown:
        raise UserError(f"--config {path} has unknown names: {', '.join(sorted(unknown))}")
    with _one_line(f"--config {path}"):
        given = {k: fields.check(FIELDS[k], v) for k, v in (given | content).items()}
        if spacecraft is not None:
            given["spacecraft"] = specification.from_lists(spacecraft, specification.NEEDED)
        if world is not None:
            given["world"] = World.of(world if isinstance(world, str) else World.from_lists(world))
    return given


def read_spacecraft(path: Path) -> Spacecraft:
    """The spacecraft of ``--spacecraft``.

    Raises:
        UserError: the file cannot be read, or describes none.
    """
    with _one_line(f"--spacecraft {path}"):
        return Spacecraft.from_toml(path)


def read_world(name_or_path: str) -> World:
    """The world of ``--world``: one of the named ones, or that of a file.

    Raises:
        UserError: there is none of that name, or the file cannot be read or describes none.
    """
    if name_or_path in names():
        return World.named(name_or_path)
    path = Path(name_or_path).expanduser()
    if not path.exists() and not path.suffix:
        raise UserError(
            f"--world is {name_or_path}; it must be {' or '.join(names())}, or a TOML file"
        )
    with _one_line(f"--world {path}"):
        return World.from_toml(path)


def read_keep_out(path: Path) -> tuple[KeepOut, ...]:
    """The cones of ``--keep-out``.

    Raises:
        UserError: the file cannot be read, or describes none.
    """
    with _one_line(f"--keep-out {path}"):
        return keep_out.from_toml(path)


@contextlib.contextmanager
def _one_line(what):
    try:
        yield
    except OSError as error:
        raise UserError(f"{what} cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(f"{what} is no TOML: {error}") from None
    except ValueError as error:
        raise UserError(f"{what}: {error}") from None


def text(config: Config) -> str:
    """The file that reproduces a run, in ASCII, with a comment for each setting.

    Example:
        >>> text(Config("paper", 3, presets.PAPER)).splitlines()[:2]
        ['preset = "paper"', 'seed = 3']
    """
    lines = [f'preset = "{config.preset}"', f"seed = {config.seed}"]
    if config.resumed_from is not None:
        lines += [f"resume_from = {_toml(config.resumed_from.folder)}"]
    lines += ["", "[settings]"]
    for group, title in fields.GROUPS.items():
        lines += ["", f"# --- {title} ---"]
        for name, field in SETTINGS.items():
            if field.metadata["group"] == group:
                value = config.settings.flat[name]
                lines += [*_comment(field), f"{name} = {_toml(value)}"]
    lines += ["", "[spacecraft]", "# kg m^2, N m, rad/s, degrees and s; body frame"]
    values = dataclasses.asdict(config.spacecraft)
    lines += [f"{name} = {_toml(value)}" for name, value in values.items()]
    if not config.world.is_ideal:
        lines += _tables("world", config.world.table())
    return "\n".join(lines) + "\n"


def _tables(name, values):
    """A table and those in it, but for distributions, which stand in one line each."""
    nested = {x: y for x, y in values.items() if isinstance(y, dict) and not KINDS.keys() & y}
    lines = ["", f"[{name}]"]
    lines += [f"{x} = {_toml(y)}" for x, y in values.items() if x not in nested]
    for inner, table in nested.items():
        lines += _tables(f"{name}.{inner}", table)
    return lines


def _comment(field):
    described = "; ".join(filter(None, (help_text.meaning(field), fields.limits(field))))
    described = streams.plain(described)
    return textwrap.wrap(described, 100, initial_indent="# ", subsequent_indent="# ")


def _toml(value):
    """A value, in ASCII whatever the terminal; JSON's escapes of it would be no TOML's."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {_toml(x)}" for name, x in value.items()) + " }"
    shown = json.dumps(value, ensure_ascii=False)
    return "".join(c if c.isascii() else f"\\U{ord(c):08x}" for c in shown)
