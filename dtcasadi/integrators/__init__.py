"""Integration methods by name."""

from .fixed import FixedStep
from .problem import Method, Problem, Trajectory
from .scipy_methods import Scipy
from .tableau import EULER, HEUN, RK4, Tableau

_ALL: tuple[Method, ...] = (
    *(FixedStep(tableau) for tableau in (EULER, HEUN, RK4)),
    *(Scipy(name) for name in ("LSODA", "Radau", "BDF", "DOP853", "RK45", "RK23")),
)
METHODS = {method.name: method for method in _ALL}

__all__ = ["METHODS", "FixedStep", "Method", "Problem", "Scipy", "Tableau", "Trajectory"]
