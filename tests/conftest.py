import jax
import pytest


@pytest.fixture
def x64():
    """Run a test in float64."""
    with jax.enable_x64(True):
        yield


@pytest.fixture
def strict_promotion():
    """Arrays of different types must not be combined (optax itself does, so not for all)."""
    with jax.numpy_dtype_promotion("strict"):
        yield
