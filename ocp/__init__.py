"""Optimal control of a discrete disc-thread model by its pressures."""

from .problem import Band, Effort, HalfSpace, Limits, Problem, Sphere, Tracking
from .stages import Stages, stages
from .target import Target, TargetCalculator, TargetStatus
from .terminal import TerminalCost

__all__ = [
    "Band",
    "Effort",
    "HalfSpace",
    "Limits",
    "Problem",
    "Sphere",
    "Stages",
    "Target",
    "TargetCalculator",
    "TargetStatus",
    "TerminalCost",
    "Tracking",
    "stages",
]
