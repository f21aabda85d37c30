"""Rigid-body rotation: attitude, inertia, the equations of motion and their integration."""

from attjax.dynamics.propagation import propagate, rate_after_impulse, rk4_step

__all__ = ["propagate", "rate_after_impulse", "rk4_step"]
