"""Optimal control of a discrete disc-thread model by its pressures."""

from .info import Check, StepInfo
from .mpc import PressureMPC
from .nlp import Instance, Nlp
from .plans import Cost, Rollout, limited, multi_start
from .problem import Band, Effort, HalfSpace, Limits, Problem, Sphere, Tracking
from .solution import Residuals, Solution, Status
from .solvers import Solver, available
from .stages import Stages, stages
from .status import Action, ControlStatus
from .target import Target, TargetCalculator, TargetStatus
from .terminal import TerminalCost
from .transcribe import transcribe

__all__ = [
    "Action",
    "Band",
    "Check",
    "ControlStatus",
    "Cost",
    "Effort",
    "HalfSpace",
    "Instance",
    "Limits",
    "Nlp",
    "PressureMPC",
    "Problem",
    "Residuals",
    "Rollout",
    "Solution",
    "Solver",
    "Sphere",
    "Stages",
    "Status",
    "StepInfo",
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
