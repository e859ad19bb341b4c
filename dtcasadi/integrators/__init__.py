"""Integration methods by name."""

from .auto import Auto
from .package import Package
from .problem import Method, Problem, Trajectory
from .scipy_methods import Scipy
from .step import OneStep
from .steppers import ONE_STEP, linearly_implicit
from .sundials import Sundials
from .symplectic import GAUSS2, GAUSS4

_ALL: tuple[Method, ...] = (
    Auto(),
    *(Package(method) for method in ONE_STEP.values()),
    *(Scipy(name) for name in ("LSODA", "Radau", "BDF", "DOP853", "RK45", "RK23")),
    *(Sundials(name) for name in ("cvodes", "idas")),
)
METHODS = {method.name: method for method in _ALL}

# Methods on (q, p), which know nothing of multipliers.
SYMPLECTIC = (GAUSS2.name, GAUSS4.name)

__all__ = [
    "METHODS",
    "ONE_STEP",
    "SYMPLECTIC",
    "Method",
    "OneStep",
    "Package",
    "Problem",
    "Scipy",
    "Trajectory",
    "linearly_implicit",
]
