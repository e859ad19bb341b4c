"""Implicit Runge-Kutta methods on the inverse dynamics: the unknowns are the accelerations.

With stage accelerations a_i, V_i = v + h sum a_ij a_j and Q_i = q + h c_i v + h^2 sum (A^2)_ij a_j,
each stage solves tau(Q_i, V_i, a_i) = 0; no forward dynamics, and M, D, K of the inverse dynamics
are all a Newton step needs:  d residual_i / d a_j = delta_ij M + h a_ij D + h^2 (A^2)_ij K.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..linear import Factored
from .step import At, Plant, Sensitivity, Step, butcher_stability, combined, quadrature_defect


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
        """Quadrature conditions up to the order, and b^T A c = 1/6 from order 3.

        Raises:
            ValueError: the coefficients do not have the order they claim.
        """
        if quadrature_defect(self.a, self.b, self.order) > 1e-12:
            raise ValueError(f"{self.name}: the coefficients are not of order {self.order}")

    @property
    def evaluations(self) -> int:
        """Calls of the dynamics in one step."""
        return 1 + self.newton * len(self.b)

    @property
    def a_stable(self) -> bool:
        """Every method here is."""
        return True

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z), a rational function."""
        return butcher_stability(self.a, self.b, z)

    def step(self, plant: Plant, at: At) -> Step:
        """The step after `newton` corrections; `slack` is the last one relative to the stages."""
        stages, slack, _ = self._solved(plant, at)
        return self._finished(plant, at, stages, slack)

    def sensitivity(self, plant: Plant, at: At, *, exact: bool) -> tuple[Step, Sensitivity]:
        """By the implicit function theorem, with Jacobians at the stages.

        Not exact: with the Jacobian of the step's start for all stages, off by O(h) in it.
        """
        stages, slack, (factor, start) = self._solved(plant, at)
        s, n, n_z = len(self.b), plant.form.n_q, plant.form.n_z
        m, n_x = n + n_z, 2 * n + n_z
        parts = [start] * s
        if exact:
            parts = [
                tuple(plant.form.jacobian.call(self._arguments(plant, at, stages, i)))
                for i in range(s)
            ]
            factor = Factored(self._matrix(at, parts), native=plant.native)
        c = self.a.sum(axis=1)
        rows = []
        for i, (_, D, K, U, T) in enumerate(parts):
            by_v = D[:, :n] + at.h * c[i] * K[:, :n]
            rows.append(ca.horzcat(K[:, :n], by_v, D[:, n:], U, T))
        d_all = -factor.solve(ca.vertcat(*rows))
        d_stages = ca.vertsplit(d_all, m)
        n_w = d_all.shape[1] - n_x
        same = ca.horzcat(at.eye(n_x), at.zeros(n_x, n_w))
        bent = at.h * same[n : 2 * n, :] + at.h**2 * combined(self.b @ self.a, d_stages)[:n, :]
        total = same + ca.vertcat(bent, at.h * combined(self.b, d_stages))
        blocks = ca.horzsplit(total, [0, n_x, n_x + at.u.shape[0], n_x + n_w])
        return self._finished(plant, at, stages, slack), Sensitivity(*blocks)

    def _solved(self, plant: Plant, at: At) -> tuple[list[ca.MX], ca.MX, tuple]:
        """The stages, their last correction, and the Newton matrix with what it is made of.

        A stage is (a; zdot); the matrix holds the Jacobian at the start of the step.
        """
        s, n = len(self.b), plant.form.n_q
        q, v, z = ca.vertsplit(at.x, plant.sizes)
        xdot = plant.ode(at.x, at.u, at.theta)
        a, zdot = xdot[n : 2 * n], xdot[2 * n :]
        start = tuple(plant.form.jacobian.call([q, v, z, a, zdot, at.u, at.theta]))
        factor = Factored(self._matrix(at, [start] * s), native=plant.native)
        stages = [xdot[n:]] * s
        change = xdot[n:]
        for _ in range(self.newton):
            change = factor.solve(self._residuals(plant, at, stages))
            corrections = ca.vertsplit(change, n + plant.form.n_z)
            stages = [x - d for x, d in zip(stages, corrections, strict=True)]
        slack = ca.norm_inf(change) / (1 + ca.norm_inf(ca.vertcat(*stages)))
        return stages, slack, (factor, start)

    def _arguments(self, plant: Plant, at: At, stages: list[ca.MX], i: int) -> tuple[ca.MX, ...]:
        """Arguments of the implicit form at stage i."""
        n, h, c = plant.form.n_q, at.h, self.a.sum(axis=1)
        q, v, z = ca.vertsplit(at.x, plant.sizes)
        moved = ca.vertcat(v, z) + h * combined(self.a[i], stages)
        twice = self.a @ self.a
        Q = q + h * c[i] * v + h**2 * combined(twice[i], stages)[:n]
        u = at.u + c[i] * h * at.du
        return Q, moved[:n], moved[n:], stages[i][:n], stages[i][n:], u, at.theta

    def _matrix(self, at: At, parts: list[tuple[ca.MX, ...]]) -> ca.MX:
        """Derivative d residual / d stages, shape (s m, s m)."""
        twice, rows = self.a @ self.a, []
        for i, (M, D, K, *_) in enumerate(parts):
            row = []
            for j in range(len(self.b)):
                block = at.h * self.a[i, j] * D + at.h**2 * twice[i, j] * K
                row.append(block + M if i == j else block)
            rows.append(ca.horzcat(*row))
        return ca.vertcat(*rows)

    def _residuals(self, plant: Plant, at: At, stages: list[ca.MX]) -> ca.MX:
        """The stage equations, stacked."""
        arguments = (self._arguments(plant, at, stages, i) for i in range(len(stages)))
        return ca.vertcat(*(plant.form.residual(*each) for each in arguments))

    def _finished(self, plant: Plant, at: At, stages: list[ca.MX], slack: ca.MX) -> Step:
        residual = ca.norm_inf(self._residuals(plant, at, stages))
        error = at.zeros(at.x.shape[0])
        return Step(self._end(plant, at, stages), error, slack, residual)

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
    7,
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
    10,
    "Radau IIA, Hairer, Wanner II, table IV.5.6",
)
SDIRK2 = Collocation(
    "sdirk2",
    2,
    np.array([[_G, 0.0], [1 - _G, _G]]),
    np.array([1 - _G, _G]),
    6,
    "Alexander, SIAM J. Numer. Anal. 14 (1977); L-stable",
)
MIDPOINT = Collocation(
    "midpoint",
    2,
    np.array([[0.5]]),
    np.array([1.0]),
    5,
    "implicit midpoint rule on q and qd; A-stable",
)
