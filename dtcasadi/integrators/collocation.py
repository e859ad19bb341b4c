"""Implicit Runge-Kutta methods on the inverse dynamics: the unknowns are the accelerations.

With stage accelerations a_i, V_i = v + h sum a_ij a_j and Q_i = q + h c_i v + h^2 sum (A^2)_ij a_j,
each stage solves tau(Q_i, V_i, a_i) = 0; no forward dynamics, and M, D, K of the inverse dynamics
are all a Newton step needs:  d residual_i / d a_j = delta_ij M + h a_ij D + h^2 (A^2)_ij K.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..linear import Factored
from .step import At, Plant, Sensitivity, Step, butcher_stability, combined


@dataclass(frozen=True, eq=False)
class Collocation:
    """An implicit method with a fixed number of Newton steps on a Jacobian held for the step.

    Attributes:
        name: what `simulate(method=...)` calls it.
        order: order of consistency.
        a: Runge-Kutta matrix, shape (s, s).
        b: weights, shape (s,).
        newton: number of Newton steps.
        source: where the coefficients are from.
    """

    name: str
    order: int
    a: np.ndarray
    b: np.ndarray
    newton: int
    source: str
    error_order: int = 0

    def __post_init__(self) -> None:
        """Quadrature conditions up to the order and C(1)."""
        c = self.a.sum(axis=1)
        for k in range(1, self.order + 1):
            assert abs(self.b @ c ** (k - 1) - 1 / k) < 1e-12, self.name
        if self.order >= 3:
            assert abs(self.b @ self.a @ c - 1 / 6) < 1e-12, self.name

    @property
    def a_stable(self) -> bool:
        """Every method here is."""
        return True

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z), a rational function."""
        return butcher_stability(self.a, self.b, z)

    def step(self, plant: Plant, at: At) -> Step:
        """The step after `newton` corrections; `slack` is the last one relative to the stages."""
        xi, slack = self._stages(plant, at)
        return Step(self._end(plant, at, xi), ca.MX.zeros(at.x.shape[0]), slack)

    def sensitivity(self, plant: Plant, at: At, *, exact: bool) -> tuple[Step, Sensitivity]:
        """By the implicit function theorem, with Jacobians at the stages.

        Not exact: with the Jacobian of the step's start for all stages, off by O(h) in it.
        """
        xi, slack = self._stages(plant, at)
        parts = [
            self._jacobian(plant, at, xi, i) if exact else self._start_jacobian(plant, at)
            for i in range(len(self.b))
        ]
        s, n, n_z = len(self.b), plant.form.n_q, plant.form.n_z
        m, n_x = n + n_z, 2 * n + n_z
        c = self.a.sum(axis=1)
        rows = []
        for i, (_, D, K, U, T) in enumerate(parts):
            by_v = D[:, :n] + at.h * c[i] * K[:, :n]
            rows.append(ca.horzcat(K[:, :n], by_v, D[:, n:], U, T))
        d_xi = -Factored(self._matrix(at, parts), native=plant.native).solve(ca.vertcat(*rows))
        stages = [d_xi[i * m : (i + 1) * m, :] for i in range(s)]
        n_w = d_xi.shape[1] - n_x
        start = ca.horzcat(ca.MX.eye(n_x), ca.MX(n_x, n_w))
        bent = at.h * start[n : 2 * n, :] + at.h**2 * combined(self.b @ self.a, stages)[:n, :]
        total = start + ca.vertcat(bent, at.h * combined(self.b, stages))
        blocks = ca.horzsplit(total, [0, n_x, n_x + at.u.shape[0], n_x + n_w])
        step = Step(self._end(plant, at, xi), ca.MX.zeros(n_x), slack)
        return step, Sensitivity(*blocks)

    def _stages(self, plant: Plant, at: At) -> tuple[list[ca.MX], ca.MX]:
        """Accelerations (and rates of z) at the stages, and the size of the last correction."""
        s, m = len(self.b), plant.form.n_q + plant.form.n_z
        xdot = plant.ode(at.x, at.u, at.theta)
        xi = ca.repmat(xdot[plant.form.n_q :], s, 1)
        parts = [self._start_jacobian(plant, at)] * s
        factor = Factored(self._matrix(at, parts), native=plant.native)
        change = xi
        for _ in range(self.newton):
            stages = [xi[i * m : (i + 1) * m] for i in range(s)]
            residuals = [
                plant.form.residual(*self._arguments(plant, at, stages, i)) for i in range(s)
            ]
            change = factor.solve(ca.vertcat(*residuals))
            xi = xi - change
        slack = ca.norm_inf(change) / (1 + ca.norm_inf(xi))
        return [xi[i * m : (i + 1) * m] for i in range(s)], slack

    def _arguments(self, plant: Plant, at: At, stages: list[ca.MX], i: int) -> tuple[ca.MX, ...]:
        """Arguments of the implicit form at stage i."""
        n, h, c = plant.form.n_q, at.h, self.a.sum(axis=1)
        q, v, z = ca.vertsplit(at.x, plant.sizes)
        moved = ca.vertcat(v, z) + h * combined(self.a[i], stages)
        twice = self.a @ self.a
        Q = q + h * c[i] * v + h**2 * combined(twice[i], stages)[:n]
        u = at.u + c[i] * h * at.du
        return Q, moved[:n], moved[n:], stages[i][:n], stages[i][n:], u, at.theta

    def _jacobian(self, plant: Plant, at: At, stages: list[ca.MX], i: int) -> tuple[ca.MX, ...]:
        return tuple(plant.form.jacobian(*self._arguments(plant, at, stages, i)))

    def _start_jacobian(self, plant: Plant, at: At) -> tuple[ca.MX, ...]:
        q, v, z = ca.vertsplit(at.x, plant.sizes)
        _, a, zdot = ca.vertsplit(plant.ode(at.x, at.u, at.theta), plant.sizes)
        return tuple(plant.form.jacobian(q, v, z, a, zdot, at.u, at.theta))

    def _matrix(self, at: At, parts: list[tuple[ca.MX, ...]]) -> ca.MX:
        """D residual / d stages, shape (s m, s m)."""
        twice, rows = self.a @ self.a, []
        for i, (M, D, K, *_) in enumerate(parts):
            row = []
            for j in range(len(self.b)):
                block = at.h * self.a[i, j] * D + at.h**2 * twice[i, j] * K
                row.append(block + M if i == j else block)
            rows.append(ca.horzcat(*row))
        return ca.vertcat(*rows)

    def _end(self, plant: Plant, at: At, stages: list[ca.MX]) -> ca.MX:
        n = plant.form.n_q
        q, v, z = ca.vertsplit(at.x, plant.sizes)
        rest = ca.vertcat(v, z) + at.h * combined(self.b, stages)
        bent = at.h**2 * combined(self.b @ self.a, stages)[:n]
        return ca.vertcat(q + at.h * v + bent, rest)


_S6 = np.sqrt(6.0)
_G = 1 - 1 / np.sqrt(2)
RADAU3 = Collocation(
    "radau3",
    3,
    np.array([[5 / 12, -1 / 12], [3 / 4, 1 / 4]]),
    np.array([3 / 4, 1 / 4]),
    5,
    "Radau IIA, Hairer, Wanner II, table IV.5.5",
)
RADAU5 = Collocation(
    "radau5",
    5,
    np.array(
        [
            [(88 - 7 * _S6) / 360, (296 - 169 * _S6) / 1800, (-2 + 3 * _S6) / 225],
            [(296 + 169 * _S6) / 1800, (88 + 7 * _S6) / 360, (-2 - 3 * _S6) / 225],
            [(16 - _S6) / 36, (16 + _S6) / 36, 1 / 9],
        ]
    ),
    np.array([(16 - _S6) / 36, (16 + _S6) / 36, 1 / 9]),
    7,
    "Radau IIA, Hairer, Wanner II, table IV.5.6",
)
SDIRK2 = Collocation(
    "sdirk2",
    2,
    np.array([[_G, 0.0], [1 - _G, _G]]),
    np.array([1 - _G, _G]),
    4,
    "Alexander, SIAM J. Numer. Anal. 14 (1977); L-stable",
)
MIDPOINT = Collocation(
    "midpoint",
    2,
    np.array([[0.5]]),
    np.array([1.0]),
    4,
    "implicit midpoint rule on q and qd; A-stable",
)
