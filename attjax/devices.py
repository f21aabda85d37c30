"""The devices that the programs compute on.

JAX is imported where it is needed: what it raises then is a line for the user.
"""

from __future__ import annotations

import contextlib
import os
import typing

from attjax import errors, jax_setup

if typing.TYPE_CHECKING:
    import jax


def select_device(name: str) -> jax.Device:
    """The JAX device for ``--device``, made the default, of JAX as the programs need it.

    On CPU each core becomes a device of its own, for training to share its work out to.

    Raises:
        errors.UserError: there is no such device, or JAX refuses a variable of the environment.
    """
    try:
        import jax
    except ValueError as error:
        named = [x for x in os.environ if x.startswith("JAX_") and x.lower() in str(error).lower()]
        values = jax_setup.set_variables(named)
        raise errors.UserError(f"JAX refuses its settings: {values or error}") from None
    if name == "cpu":
        jax.config.update("jax_platforms", "cpu")
        jax.config.update("jax_platform_name", "cpu")
    with contextlib.suppress(RuntimeError):  # called where JAX runs already, as it is set up there
        jax.config.update("jax_num_cpu_devices", available_cores())
    jax_setup.pin_settings()
    jax_setup.keep_compiled()
    try:
        device = jax.devices(None if name == "auto" else name)[0]
    except (RuntimeError, AssertionError):  # the latter: JAX_PLATFORMS=cuda, but no such plug-in
        found = jax_setup.set_variables(jax_setup.CHOOSING_DEVICES)
        if not found:
            found = f"it finds {jax.default_backend()}"
        raise errors.UserError(f"--device is {name}, and JAX finds none; {found}") from None
    jax.config.update("jax_default_device", device)
    return device


def available_cores() -> int:
    """The cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
