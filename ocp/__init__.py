"""Optimal control of a discrete disc-thread model by its pressures."""

from .nlp import Instance, Nlp
from .plans import Cost, Rollout, limited, multi_start
from .problem import Band, Effort, HalfSpace, Limits, Problem, Sphere, Tracking
from .solution import Residuals, Solution, Status
from .solvers import Solver, available
from .stages import Stages, stages
from .target import Target, TargetCalculator, TargetStatus
from .terminal import TerminalCost
from .transcribe import transcribe

__all__ = [
    "Band",
    "Cost",
    "Effort",
    "HalfSpace",
    "Instance",
    "Limits",
    "Nlp",
    "Problem",
    "Residuals",
    "Rollout",
    "Solution",
    "Solver",
    "Sphere",
    "Stages",
    "Status",
    "Target",
    "TargetCalculator",
    "TargetStatus",
    "TerminalCost",
    "Tracking",
    "available",
    "limited",
    "multi_start",
    "stages",
    "transcribe",
]
