"""Optimal control of a discrete disc-thread model by its pressures."""

from .problem import Band, Effort, HalfSpace, Limits, Problem, Sphere, Tracking
from .stages import Stages, stages

__all__ = [
    "Band",
    "Effort",
    "HalfSpace",
    "Limits",
    "Problem",
    "Sphere",
    "Stages",
    "Tracking",
    "stages",
]
