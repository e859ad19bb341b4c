"""What a controller needs of a discrete model."""

from __future__ import annotations

from typing import Protocol

import casadi as ca

from dtcasadi import waist


class Discrete(waist.Discrete, Protocol):
    """What a controller needs of a model; `dtcasadi.discrete.DiscreteModel` is one.

    As for estimators; direct collocation also reads `ode`, a Function of x, u, theta.
    """

    @property
    def ode(self) -> ca.Function:
        """Function x, u, theta -> xdot."""
