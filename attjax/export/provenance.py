"""Where a policy comes from, and whether it is used as it was trained: what exported files say."""

import dataclasses

import attjax
from attjax.config import presets
from attjax.config.run import FOREIGN, Config
from attjax.spacecraft import INTEGRATION_STEP, LM50, Spacecraft


@dataclasses.dataclass(frozen=True)
class Origin:
    """Where the parameters of a policy come from.

    Attributes:
        text: for people, one line.
        frameskips: those that it was trained at; none: untrained.
        spacecraft: that it was trained on.
        overridden: how what is used differs from what the run would use, one phrase each.
    """

    text: str
    frameskips: tuple[int, ...] = ()
    spacecraft: Spacecraft = LM50
    overridden: tuple[str, ...] = ()


def of_run(config: Config, update: int, newest: int) -> Origin:
    """The origin of a run's checkpoint after ``update``; its newest is that after ``newest``."""
    settings = config.settings
    text = f"preset {config.preset}{_changes(config)}, seed {config.seed}, update {update} of "
    overridden = (f"update {update}, not the newest, {newest}",) if update != newest else ()
    text += str(settings.ppo.num_updates)
    return Origin(text, tuple(sorted(set(settings.task.frameskips))), config.spacecraft, overridden)


def _changes(config):
    """The settings in which a run differs from its preset."""
    if config.preset in FOREIGN:
        return f" (learned by {FOREIGN[config.preset]}, no PPO)"
    preset = presets.PRESETS.get(config.preset)
    if preset is None:
        return " (unknown)"
    before, after = preset.flat, config.settings.flat
    changes = [f"{name} {_value(x)}" for name, x in after.items() if x != before[name]]
    return f" with {', '.join(changes)}" * bool(changes)


def _value(x):
    return " ".join(map(str, x)) if isinstance(x, tuple) else str(x)


def facts(origin: Origin, frameskip: int, spacecraft: Spacecraft, parameters: str) -> dict:
    """What every exported file says of itself, one line each, by name.

    Args:
        origin: where the parameters come from.
        frameskip, spacecraft: what they are exported for.
        parameters: their hash.
    """
    overridden = [*origin.overridden]
    if frameskip not in origin.frameskips:
        overridden.append(f"frameskip {frameskip}, which was not trained")
    if spacecraft != origin.spacecraft:
        overridden.append("the spacecraft, which is not as trained")
    lines = {
        "attjax": attjax.__version__,
        "parameters": f"SHA-256 {parameters} (its first {len(parameters)} digits)",
        "run": origin.text,
        "trained at": _trained(origin.frameskips),
        "exported at": f"{_rates([frameskip])}: {_standing(frameskip, origin.frameskips)}",
        "spacecraft": spacecraft.name,
        "overridden": "; ".join(overridden) or "nothing",
    }
    return {name: " ".join(line.split()) for name, line in lines.items()}


def _trained(frameskips):
    if not frameskips:
        return "no control rate: untrained"
    return f"{_rates(frameskips)}; at no other rate"


def _standing(frameskip, trained):
    if frameskip in trained:
        return "one of those trained"
    inside = trained and min(trained) < frameskip < max(trained)
    return "NOT TRAINED, " + ("between trained rates" if inside else "beyond what was trained")


def _rates(frameskips):
    hertz = ", ".join(f"{1 / INTEGRATION_STEP / (1 + k):.4g}" for k in frameskips)
    return f"frameskip{'s' * (len(frameskips) > 1)} {', '.join(map(str, frameskips))} ({hertz} Hz)"
