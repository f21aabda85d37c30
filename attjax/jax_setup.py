"""JAX as the programs need it, whatever the user's environment says: settings, compile cache.

For programs alone: importing the library leaves JAX's settings to its user.
"""

import contextlib
import os
import re
import warnings
from collections.abc import Iterable
from pathlib import Path

SETTINGS = {
    "jax_check_tracer_leaks": False,
    "jax_debug_infs": False,
    "jax_debug_key_reuse": False,
    "jax_debug_nans": False,
    "jax_default_matmul_precision": None,
    "jax_default_prng_impl": "threefry2x32",
    "jax_disable_jit": False,
    "jax_disable_most_optimizations": False,
    "jax_enable_checks": False,
    "jax_enable_custom_prng": False,
    "jax_enable_x64": False,
    "jax_error_checking_behavior_divide": "ignore",
    "jax_error_checking_behavior_nan": "ignore",
    "jax_error_checking_behavior_oob": "ignore",
    "jax_exec_time_optimization_effort": 0.0,
    "jax_high_dynamic_range_gumbel": False,
    "jax_no_execution": False,
    "jax_no_tracing": False,
    "jax_numpy_dtype_promotion": "standard",
    "jax_numpy_rank_promotion": "allow",
    "jax_optimization_level": "UNKNOWN",
    "jax_random_seed_offset": 0,
    "jax_scan3": False,
    "jax_threefry_partitionable": True,
    "jax_transfer_guard": "allow",
}
"""On which the bits of a run depend, or whether there are any; JAX reads all from variables."""

CHOOSING_DEVICES = (
    "JAX_PLATFORMS", "JAX_PLATFORM_NAME", "CUDA_VISIBLE_DEVICES", "JAX_CUDA_VISIBLE_DEVICES",
    "ROCR_VISIBLE_DEVICES", "JAX_ROCM_VISIBLE_DEVICES",
)  # fmt: skip

LEAST_COMPILE_TIME = "jax_persistent_cache_min_compile_time_secs"
CACHE_WARNING = r"Error (?:reading|writing) persistent compilation cache entry for '(\w+)'"


def pin_settings() -> None:
    """Give JAX the settings that the programs are written for and tested with."""
    import jax

    for name, value in SETTINGS.items():
        if name in jax.config.values:  # JAX drops one now and then
            jax.config.update(name, value)


def set_variables(names: Iterable[str]) -> str:
    """Those of the environment's variables that are set, with their values, for an error."""
    return ", ".join(f"{name} is {os.environ[name]!r}" for name in names if name in os.environ)


def keep_compiled() -> None:
    """Keep compiled programs between runs, where the user has not set up JAX's cache and there is
    a folder for them.

    An entry that JAX cannot read or write, of a killed process for one, is removed: JAX would
    keep it, and warn of it at each start.
    """
    import jax

    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    if (folder := cache_folder()) is None:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    if LEAST_COMPILE_TIME.upper() not in os.environ:
        jax.config.update(LEAST_COMPILE_TIME, 0.5)
    show = warnings.showwarning

    def drop(message, *details, **more):
        found = re.match(CACHE_WARNING, str(message))
        if found is None:
            return show(message, *details, **more)
        for path in folder.glob(f"{found[1]}-*"):
            with contextlib.suppress(OSError):
                path.unlink()

    warnings.filterwarnings("always", CACHE_WARNING)
    warnings.showwarning = drop


def cache_folder() -> Path | None:
    """The folder of compiled programs, in the user's cache folder; None where it cannot be made.

    It is the user's alone, as what is in there is run.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        if not base.is_absolute():
            base = Path.home() / ".cache"
        folder = base / "attjax" / "compiled"
        if base.is_absolute():
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            return folder
    except (OSError, RuntimeError):  # the latter: there is no home
        pass
    return None
