"""Explicit Runge-Kutta methods."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .step import At, Plant, Sensitivity, Step, combined, first_order
from .tableau import Tableau


@dataclass(frozen=True)
class Explicit:
    """A method given by its tableau; sensitivities are the chain rule over its stages."""

    tableau: Tableau

    @property
    def name(self) -> str:
        """The tableau's name."""
        return self.tableau.name

    @property
    def order(self) -> int:
        """The tableau's order."""
        return self.tableau.order

    @property
    def error_order(self) -> int:
        """The tableau's."""
        return self.tableau.error_order

    def step(self, plant: Plant, at: At) -> Step:
        """x_next = x + h sum b_i k_i."""
        return self.following(plant, at, plant.ode(at.x, at.u, at.theta))

    def following(self, plant: Plant, at: At, rates: ca.MX) -> Step:
        """The step where xdot at its start, the first stage, is known: `rates`."""
        slopes = [rates]
        for i, share in enumerate(self.tableau.c[1:], 1):
            state = self._stage(at, i, slopes)
            slopes.append(plant.ode(state, at.u + share * at.h * at.du, at.theta))
        return self._finished(at, slopes)

    def sensitivity(self, plant: Plant, at: At, *, exact: bool) -> tuple[Step, Sensitivity]:
        """Chain rule d k_i = J(x_i) (I + h sum a_ij D k_j); always exact."""
        slopes: list[ca.MX] = []
        by_x: list[ca.MX] = []
        by_w: list[ca.MX] = []
        n_x = at.x.shape[0]
        for i in range(len(self.tableau.c)):
            state = self._stage(at, i, slopes)
            slopes.append(plant.ode(state, at.u, at.theta))
            F_x, F_w = first_order(plant, at._replace(x=state))
            weights = self.tableau.a[i, :i]
            if i:
                inner = at.eye(n_x) + at.h * combined(weights, by_x)
                by_w.append(F_w + at.h * ca.mtimes(F_x, combined(weights, by_w)))
                by_x.append(ca.mtimes(F_x, inner))
            else:
                by_x.append(F_x)
                by_w.append(F_w)
        b = self.tableau.b
        F_w = at.h * combined(b, by_w)
        F_u, F_theta = ca.horzsplit(F_w, [0, at.u.shape[0], F_w.shape[1]])
        F_x = at.eye(n_x) + at.h * combined(b, by_x)
        return self._finished(at, slopes), Sensitivity(F_x, F_u, F_theta)

    @property
    def evaluations(self) -> int:
        """Calls of the dynamics in one step."""
        return len(self.tableau.b)

    @property
    def a_stable(self) -> bool:
        """No explicit method is."""
        return False

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z) = 1 + sum z^(k+1) b^T A^k 1, a polynomial."""
        power, value = np.ones(len(self.tableau.b)), np.ones_like(np.asarray(z, dtype=complex))
        for k in range(len(power)):
            value = value + np.asarray(z) ** (k + 1) * (self.tableau.b @ power)
            power = self.tableau.a @ power
        return value

    def _stage(self, at: At, i: int, slopes: list[ca.MX]) -> ca.MX:
        return at.x + at.h * combined(self.tableau.a[i, :i], slopes) if i else at.x

    def _finished(self, at: At, slopes: list[ca.MX]) -> Step:
        error = at.zeros(at.x.shape[0])
        if self.tableau.b_error is not None:
            error = at.h * combined(self.tableau.b_error, slopes)
        return Step(at.x + at.h * combined(self.tableau.b, slopes), error, at.zeros(1), at.zeros(1))
