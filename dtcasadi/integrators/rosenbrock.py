"""Linearly implicit (Rosenbrock-Wanner) methods: a fixed number of linear solves, no Newton.

With W = I/(h gamma) - J and J, f_t the derivatives at the start of the step,

    W k_i = f(t + alpha_i h, x + sum_j<i A_ij k_j) + sum_j<i C_ij k_j / h + gamma_i h f_t,
    x_next = x + sum m_i k_i,      error = sum e_i k_i

(Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.7, eq (7.25)). The state is
x = [q; v; z] with q' = v, so that q is eliminated by hand and what is factored is
M/(h gamma) + D + h gamma K with d tau/d qdd = M, d tau/d v = D, d tau/d q = K.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ..linear import Factored, product
from .step import At, Plant, Sensitivity, Step, butcher_stability, combined, differentiated
from .tableau import lower


@dataclass(frozen=True, eq=False)
class Rosenbrock:
    """Coefficients in the form above; every method here is L-stable.

    Attributes:
        name: what `simulate(method=...)` calls it.
        order: order of consistency.
        gamma: diagonal coefficient.
        A: stage weights, strictly lower triangular, shape (s, s).
        C: coupling weights, strictly lower triangular, shape (s, s).
        m: weights of the solution, shape (s,).
        e: weights of the embedded error estimate, shape (s,); zero without one.
        error_order: order of the lower of the two embedded solutions; 0 without an estimate.
        source: where the coefficients are from.
    """

    name: str
    order: int
    gamma: float
    A: np.ndarray
    C: np.ndarray
    m: np.ndarray
    e: np.ndarray
    error_order: int
    source: str

    def __post_init__(self) -> None:
        """Order conditions of both solutions and R(infinity) = 0.

        Raises:
            ValueError: the coefficients do not have the order they claim, or are not L-stable.
        """
        b, alpha, beta = self.classical()
        solutions = [(b, self.order)]
        if self.error_order:
            solutions.append((b - self.e @ self._gammas(), self.error_order))
        for weights, order in solutions:
            defects = _defects(weights, alpha, beta)[: (1, 2, 4, 8)[order - 1]]
            if np.max(np.abs(defects)) > 1e-9:
                raise ValueError(f"{self.name}: the coefficients are not of order {order}")
        if abs(1 - b @ np.linalg.solve(beta, np.ones(len(b)))) > 1e-9:
            raise ValueError(f"{self.name}: the coefficients are not L-stable")

    def _gammas(self) -> np.ndarray:
        """Gamma = (I/gamma - C)^-1, shape (s, s)."""
        return np.linalg.inv(np.eye(len(self.m)) / self.gamma - self.C)

    def classical(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """b, alpha and beta = alpha + Gamma of the untransformed method."""
        gammas = self._gammas()
        alpha = self.A @ gammas
        return self.m @ gammas, alpha, alpha + gammas

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.m)

    @cached_property
    def evaluations(self) -> int:
        """Calls of the dynamics in one step."""
        return 1 + sum(bool(np.any(row)) for row in self.A)

    @property
    def a_stable(self) -> bool:
        """Every method here is."""
        return True

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z) = 1 + z b^T (I - z beta)^-1 1."""
        b, _, beta = self.classical()
        return butcher_stability(beta, b, z)

    def step(self, plant: Plant, at: At) -> Step:
        """All stages with one factorization."""
        x_next, error, _ = self._solved(plant, at)
        return Step(x_next, error, at.zeros(1), at.zeros(1))

    def sensitivity(self, plant: Plant, at: At, *, exact: bool) -> tuple[Step, Sensitivity]:
        """Exact: the step differentiated, second derivatives of the dynamics included (slow).

        Otherwise J is taken as constant over the step, F_x = R(h J): off by O(h^2) terms of the
        dynamics' second derivatives, at the cost of one solve and a product per stage.
        """
        if exact:
            return self.step(plant, at), differentiated(self, plant, at)
        x_next, error, (M, _, K, UT, W) = self._solved(plant, at)
        n, n_z = plant.form.n_q, plant.form.n_z
        n_x, n_w, native = 2 * n + n_z, UT.shape[1], plant.native
        sigma = 1 / (at.h * self.gamma)
        # The powers of S = (I - h gamma J)^-1 by their rows for the rates and actuator states, from
        # which those for q follow: one solve for S itself, then products.
        first = W.solve(ca.horzcat(-K[:, :n], sigma * M, -sigma * UT))
        by_q, by_v = first[:, :n], first[:, n:n_x]
        bent = by_v + ca.horzcat(by_q, at.zeros(n + n_z, n_z)) / sigma
        begin = ca.horzcat(by_q, at.zeros(n + n_z, n_x - n + n_w))
        powers, before = [first], at.zeros(n, n_x + n_w)
        for k in range(1, self.stages):
            power = begin + product(bent, powers[-1], native=native)
            if k > 1:
                power = power + product(by_q, before, native=native)
            before = before + powers[-1][:n, :] / sigma
            powers.append(power)
        moved, pushed = self._polynomials()
        # Of S^k in the rows of rates, and of what they add to q.
        weights = [(moved[k:], pushed[k:]) for k in range(1, self.stages + 1)]
        sides = [ca.horzsplit(power, [0, n_x, n_x + n_w]) for power in powers]
        rates = [
            _sum([(w[side][0], part[side]) for w, part in zip(weights, sides, strict=True)])
            for side in (0, 1)
        ]
        turns = [
            _sum(
                [(w[side].sum(), part[side][:n, :]) for w, part in zip(weights, sides, strict=True)]
            )
            for side in (0, 1)
        ]
        same = ca.horzcat(at.eye(n), at.zeros(n, n_x - n))
        F_x = ca.vertcat(same + turns[0] / sigma, rates[0])
        F_w = at.h * ca.vertcat(turns[1] / sigma, rates[1])
        blocks = ca.horzsplit(F_w, [0, at.u.shape[0], n_w])
        return Step(x_next, error, at.zeros(1), at.zeros(1)), Sensitivity(F_x, *blocks)

    def _polynomials(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of R in the powers of s = 1 / (1 - gamma z), and those for an input over h.

        The stages of x' = lambda x + w, each a polynomial in s by the form above; both have no
        constant term, as R(infinity) = 0. Shape (stages + 1,) each.
        """
        n = self.stages + 1

        def shifted(values: np.ndarray) -> np.ndarray:
            return np.concatenate([[0.0], values[:-1]])

        found = []
        for start, push in ((1.0, 0.0), (0.0, 1.0)):
            begin, stages = np.eye(1, n)[0] * start, np.zeros((self.stages, n))
            for i in range(self.stages):
                moved = begin + self.A[i] @ stages
                driven = np.eye(1, n)[0] * push + self.C[i] @ stages
                stages[i] = shifted(moved) - moved + self.gamma * shifted(driven)
            found.append(begin + self.m @ stages)
        return found[0], found[1]

    def _solved(self, plant: Plant, at: At) -> tuple[ca.MX, ca.MX, tuple]:
        """x_next, the error estimate and the matrices of the step."""
        n, n_z = plant.form.n_q, plant.form.n_z
        q, v, z = ca.vertsplit(at.x, plant.sizes)
        first = plant.ode(at.x, at.u, at.theta)
        _, a, zdot = ca.vertsplit(first, plant.sizes)
        M, D, K, U, T = plant.form.jacobian(q, v, z, a, zdot, at.u, at.theta)
        sigma = 1 / (at.h * self.gamma)
        W = Factored(sigma * M + D + K / sigma, native=plant.native)
        drift = -ca.mtimes(U, at.du)  # M f_t: what a changing command adds to the force balance
        gamma = self._gammas().sum(axis=1)
        alpha = self.classical()[1].sum(axis=1)
        stages: list[ca.MX] = []
        for i in range(self.stages):
            rate = first
            if np.any(self.A[i]):
                moved = at.x + combined(self.A[i], stages)
                rate = plant.ode(moved, at.u + alpha[i] * at.h * at.du, at.theta)
            if i:
                rate = rate + combined(self.C[i], stages) / at.h
            r_q, r_v = ca.vertsplit(rate, [0, n, 2 * n + n_z])
            rhs = ca.mtimes(M, r_v) - ca.mtimes(K[:, :n], r_q) / sigma + gamma[i] * at.h * drift
            k_v = W.solve(rhs)
            stages.append(ca.vertcat((r_q + k_v[:n]) / sigma, k_v))
        matrices = (M, D, K, ca.horzcat(U, T), W)
        return at.x + combined(self.m, stages), combined(self.e, stages), matrices


def _sum(terms: list[tuple[float, ca.MX]]) -> ca.MX:
    """Weighted sum."""
    return sum((weight * part for weight, part in terms[1:]), terms[0][0] * terms[0][1])


def _defects(b: np.ndarray, alpha: np.ndarray, beta: np.ndarray) -> list[float]:
    """Order conditions 1 to 4 of Rosenbrock methods, Hairer-Wanner II, table IV.7.1."""
    one = np.ones(len(b))
    a, B = alpha @ one, beta @ one
    return [
        b @ one - 1,
        b @ B - 1 / 2,
        b @ a**2 - 1 / 3,
        b @ beta @ B - 1 / 6,
        b @ a**3 - 1 / 4,
        b @ (a * (alpha @ B)) - 1 / 8,
        b @ beta @ a**2 - 1 / 12,
        b @ beta @ beta @ B - 1 / 24,
    ]


_G2 = 1 - 1 / np.sqrt(2)
ROS1 = Rosenbrock(
    "ros1",
    1,
    1.0,
    lower(),
    lower(),
    np.array([1.0]),
    np.array([0.0]),
    0,
    "linearly implicit Euler",
)
ROS2 = Rosenbrock(
    "ros2",
    2,
    _G2,
    lower([1 / _G2]),
    lower([-2 / _G2]),
    np.array([1.5, 0.5]) / _G2,
    np.array([0.5, 0.5]) / _G2,
    1,
    "Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20 (1999)",
)
ROS3 = Rosenbrock(
    "ros3",
    3,
    0.43586652150845899941601945119356,
    lower([1.0], [1.0, 0.0]),
    lower(
        [-1.0156171083877702091975600115545],
        [4.0759956452537699824805835358067, 9.2076794298330791242156818474003],
    ),
    np.array([1.0, 6.1697947043828245592553615689730, -0.42772256543218573326238373806514]),
    np.array([0.5, -2.9079558716805469821718236208017, 0.22354069897811569627360909276199]),
    2,
    "Sandu, Verwer, Blom, Spee, Carmichael, Potra, Atmos. Environ. 31 (1997)",
)
RODAS4 = Rosenbrock(
    "rodas4",
    4,
    0.25,
    lower(
        [1.544],
        [0.9466785280815826, 0.2557011698983284],
        [3.314825187068521, 2.896124015972201, 0.9986419139977817],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950],
        [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0],
    ),
    lower(
        [-5.6688],
        [-2.430093356833875, -0.2063599157091915],
        [-0.1073529058151375, -9.594562251023355, -20.47028614809616],
        [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160],
        [
            *(8.083246795921522, -7.981132988064893, -31.52159432874371),
            *(16.31930543123136, -6.058818238834054),
        ],
    ),
    np.array([1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1, 1]),
    np.array([0.0, 0, 0, 0, 0, 1]),
    3,
    "Hairer, Wanner, Solving Ordinary Differential Equations II, RODAS",
)
