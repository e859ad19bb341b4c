"""Integration methods by name."""

from .fixed import FixedStep
from .problem import Method, Problem, Trajectory
from .scipy_methods import Scipy
from .tableau import EULER, HEUN, RK4, Tableau

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        *(FixedStep(tableau) for tableau in (EULER, HEUN, RK4)),
        *(Scipy(name) for name in ("LSODA", "Radau", "BDF", "DOP853", "RK45", "RK23")),
    )
}

__all__ = ["METHODS", "FixedStep", "Method", "Problem", "Scipy", "Tableau", "Trajectory"]
