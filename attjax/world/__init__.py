"""The world that a spacecraft flies in, as a user describes it; by default the paper's, ideal.

This package imports nothing heavy, so that errors in a description are instant.
"""

from attjax.world.aboard import Actuators, Uncertainty
from attjax.world.description import IDEAL, World, made_for, names
from attjax.world.distributions import LogUniform, Normal, Uniform
from attjax.world.keep_out import KeepOut
from attjax.world.moving import Flexible, Wheels, check_moving
from attjax.world.outside import Disturbances, Drag, Orbit, RadiationPressure, Sinusoid
from attjax.world.telling import Gyro, Sensors, StarTracker

__all__ = [
    "IDEAL",
    "Actuators",
    "Disturbances",
    "Drag",
    "Flexible",
    "Gyro",
    "KeepOut",
    "LogUniform",
    "Normal",
    "Orbit",
    "RadiationPressure",
    "Sensors",
    "Sinusoid",
    "StarTracker",
    "Uncertainty",
    "Uniform",
    "Wheels",
    "World",
    "check_moving",
    "made_for",
    "names",
]
