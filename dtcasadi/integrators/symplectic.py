"""Gauss methods on the canonical form, eq (7): symplectic in (q, p), for long conservative runs.

The unknowns are the stage velocities V_i. With Q_i = q + h sum a_ij V_j and P_i = p(Q_i, V_i),

    P_i = p + h sum a_ij (dL/dq + Q)(Q_j, V_j),

so that M is never inverted inside the step (Hairer, Lubich, Wanner, Geometric Numerical
Integration, section II.1.3; p = M qd outside it).
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..errors import SimulationError
from ..linear import Factored
from .step import (
    At,
    Plant,
    Sensitivity,
    Step,
    butcher_stability,
    combined,
    differentiated,
    quadrature_defect,
)


@dataclass(frozen=True, eq=False)
class Symplectic:
    """A Gauss method on (q, p) with a fixed number of Newton steps.

    The Newton matrix delta_ij M + h a_ij D + h^2 (A^2)_ij K leaves out terms of the order of the
    velocity, which costs an iteration and no accuracy.

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
        """Symplecticity: b_i a_ij + b_j a_ji = b_i b_j (Hairer, Lubich, Wanner, eq (VI.4.2)).

        Raises:
            ValueError: the coefficients are not symplectic, or not of the order they claim.
        """
        if quadrature_defect(self.a, self.b, self.order) > 1e-12:
            raise ValueError(f"{self.name}: the coefficients are not of order {self.order}")
        weighted = np.diag(self.b) @ self.a
        if not np.allclose(weighted + weighted.T, np.outer(self.b, self.b), atol=1e-15):
            raise ValueError(f"{self.name}: the coefficients are not symplectic")

    @property
    def evaluations(self) -> int:
        """Calls of the dynamics in one step."""
        return 2 + (self.newton + 1) * len(self.b)

    @property
    def a_stable(self) -> bool:
        """Every method here is."""
        return True

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z), of modulus one on the imaginary axis."""
        return butcher_stability(self.a, self.b, z)

    def step(self, plant: Plant, at: At) -> Step:
        """The step; `slack` is the last correction of the stage velocities, relative.

        Raises:
            SimulationError: the actuator has states, which have no canonical form.
        """
        if plant.form.n_z:
            raise SimulationError(
                f"method {self.name} is for actuator 'direct', whose pressure is its command; "
                "use radau5 or rodas4 with actuator states"
            )
        s, n = len(self.b), plant.form.n_q
        q, v, _ = ca.vertsplit(at.x, plant.sizes)
        p = plant.momenta(q, v, at.theta)
        a = plant.ode(at.x, at.u, at.theta)[n:]
        z = at.zeros(0, 1)
        M, D, K, *_ = plant.form.jacobian(q, v, z, a, z, at.u, at.theta)
        twice = self.a @ self.a
        blocks = [
            [
                at.h * self.a[i, j] * D + at.h**2 * twice[i, j] * K + (M if i == j else 0)
                for j in range(s)
            ]
            for i in range(s)
        ]
        factor = Factored(ca.blockcat(blocks), native=plant.native)
        c = self.a.sum(axis=1)
        V = ca.vertcat(*(v + c[i] * at.h * a for i in range(s)))
        change = V
        for _ in range(self.newton):
            change = factor.solve(self._residuals(plant, at, q, p, V))
            V = V - change
        rates = ca.vertsplit(V, n)
        poses = [q + at.h * combined(self.a[i], rates) for i in range(s)]
        p_next = p + at.h * combined(self.b, self._pushes(plant, at, poses, rates))
        q_next = q + at.h * combined(self.b, rates)
        v_next = plant.rates(q_next, p_next, at.theta)
        slack = ca.norm_inf(change) / (1 + ca.norm_inf(V))
        residual = ca.norm_inf(self._residuals(plant, at, q, p, V))
        return Step(ca.vertcat(q_next, v_next), at.zeros(2 * n), slack, residual)

    def sensitivity(self, plant: Plant, at: At, *, exact: bool) -> tuple[Step, Sensitivity]:
        """The iteration differentiated; always exact."""
        return self.step(plant, at), differentiated(self, plant, at)

    def _residuals(self, plant: Plant, at: At, q: ca.MX, p: ca.MX, V: ca.MX) -> ca.MX:
        """The stage equations for the momenta, stacked."""
        stages = range(len(self.b))
        rates = ca.vertsplit(V, plant.form.n_q)
        poses = [q + at.h * combined(self.a[i], rates) for i in stages]
        pushes = self._pushes(plant, at, poses, rates)
        momenta = [plant.momenta(poses[i], rates[i], at.theta) for i in stages]
        return ca.vertcat(*(momenta[i] - p - at.h * combined(self.a[i], pushes) for i in stages))

    def _pushes(self, plant: Plant, at: At, poses: list[ca.MX], rates: list[ca.MX]) -> list[ca.MX]:
        """Force dL/dq + Q at the stages."""
        c = self.a.sum(axis=1)
        return [
            plant.force(poses[j], rates[j], at.u + c[j] * at.h * at.du, at.theta)
            for j in range(len(self.b))
        ]


_R3 = np.sqrt(3.0)
GAUSS2 = Symplectic(
    "gauss2", 2, np.array([[0.5]]), np.array([1.0]), 10, "implicit midpoint rule on (q, p)"
)
GAUSS4 = Symplectic(
    "gauss4",
    4,
    np.array([[1 / 4, 1 / 4 - _R3 / 6], [1 / 4 + _R3 / 6, 1 / 4]]),
    np.array([0.5, 0.5]),
    12,
    "Hairer, Lubich, Wanner, Geometric Numerical Integration, table II.1.1",
)
