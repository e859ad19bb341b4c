"""What every one-step method is given and gives back, as CasADi expressions (SX or MX)."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from ..contact.stepping import Rims
from ..jacobians import ImplicitForm
from ..linear import Factored


@dataclass(frozen=True)
class Plant:
    """A model's state equation in the forms that steps are built from.

    Attributes:
        ode: xdot(x, u, theta).
        form: the implicit form, its residual and derivatives.
        momenta: p(q, qd, theta).
        force: dL/dq + Q (q, qd, pressure, theta), the right side of eq (7).
        rates: M^-1 p (q, p, theta).
        projection: x, theta -> x on the robot's constraints; None without any.
        rims: the robot's rigid contacts; None without any.
        native: whether C kernels may be embedded (generated code only).
        kind: SX for small models, whose steps are one flat graph, else MX.
    """

    ode: ca.Function
    form: ImplicitForm
    momenta: ca.Function
    force: ca.Function
    rates: ca.Function
    projection: ca.Function | None
    rims: Rims | None
    native: bool
    kind: Any

    @property
    def sizes(self) -> list[int]:
        """Offsets of q, v and z in x."""
        n = self.form.n_q
        return [0, n, 2 * n, 2 * n + self.form.n_z]


class At(NamedTuple):
    """Where a step starts: state, command and its rate of change, step and parameters."""

    x: ca.MX
    u: ca.MX
    du: ca.MX
    h: ca.MX
    theta: ca.MX

    def zeros(self, rows: int, columns: int = 1) -> ca.MX:
        """Zeros of the symbols' kind."""
        return type(self.x)(rows, columns)

    def eye(self, n: int) -> ca.MX:
        """The identity of the symbols' kind."""
        return type(self.x).eye(n)


class Step(NamedTuple):
    """One step.

    x_next (n_x,); error (n_x,), the embedded estimate, zero without one; slack, the last correction
    of the stages relative to them, and residual, the largest entry of the stage equations after it
    [N m, or kg m^2/s for methods on (q, p)]; both zero for methods that iterate nothing.
    """

    x_next: ca.MX
    error: ca.MX
    slack: ca.MX
    residual: ca.MX


class Sensitivity(NamedTuple):
    """Derivatives of x_next for x, a constant command u, and theta (but its block `frames`)."""

    F_x: ca.MX
    F_u: ca.MX
    F_theta: ca.MX


class OneStep(Protocol):
    """A method as a value: coefficients, order, and how to take a step and differentiate it."""

    @property
    def name(self) -> str:
        """What `simulate(method=...)` and `model.discrete(method=...)` call it."""

    @property
    def order(self) -> int:
        """Order of consistency."""

    @property
    def error_order(self) -> int:
        """Order of the lower of two embedded solutions; 0 without an error estimate."""

    @property
    def evaluations(self) -> int:
        """Calls of the state equation, or of its residual, in one step."""

    def step(self, plant: Plant, at: At) -> Step:
        """The step from `at`."""

    def sensitivity(self, plant: Plant, at: At, *, exact: bool) -> tuple[Step, Sensitivity]:
        """The step and its derivatives at du = 0; not exact: the method's cheaper form."""

    @property
    def a_stable(self) -> bool:
        """Whether no decaying mode limits the step."""

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z) on x' = lambda x, z = h lambda, shape (n,)."""


def combined(weights: np.ndarray, terms: list[ca.MX]) -> ca.MX:
    """Sum of weights[i] * terms[i], terms with weight zero left out."""
    kept = [w * term for w, term in zip(weights, terms, strict=False) if w != 0]
    return sum(kept[1:], kept[0]) if kept else type(terms[0])(*terms[0].shape)


def butcher_stability(a: np.ndarray, b: np.ndarray, z: np.ndarray) -> np.ndarray:
    """R(z) = 1 + z b^T (I - z A)^-1 1 of a Runge-Kutta method (Hairer, Wanner II, eq (IV.3.2))."""
    one, eye = np.ones(len(b)), np.eye(len(b))
    systems = eye - np.asarray(z)[:, np.newaxis, np.newaxis] * a
    return 1 + z * (
        np.linalg.solve(systems, np.tile(one[:, np.newaxis], (len(z), 1, 1)))[..., 0] @ b
    )


def quadrature_defect(a: np.ndarray, b: np.ndarray, order: int) -> float:
    """Largest defect of b^T c^(k-1) = 1/k, k <= order, and of b^T A c = 1/6 from order 3 on."""
    c = a.sum(axis=1)
    defects = [b @ c ** (k - 1) - 1 / k for k in range(1, order + 1)]
    if order >= 3:
        defects.append(b @ a @ c - 1 / 6)
    return float(np.max(np.abs(defects)))


def first_order(plant: Plant, at: At) -> tuple[ca.MX, ca.MX]:
    """F_x of the state equation, and its derivative for the columns [u, theta], at the start."""
    q, v, z = ca.vertsplit(at.x, plant.sizes)
    xdot = plant.ode(at.x, at.u, at.theta)
    _, a, zdot = ca.vertsplit(xdot, plant.sizes)
    M, D, K, U, T = plant.form.jacobian(q, v, z, a, zdot, at.u, at.theta)
    n, n_z = plant.form.n_q, plant.form.n_z
    by = -Factored(M, native=plant.native).solve(ca.horzcat(K[:, :n], D, U, T))
    top = ca.horzcat(at.zeros(n, n), at.eye(n), at.zeros(n, n_z))
    F_x = ca.vertcat(top, by[:, : 2 * n + n_z])
    return F_x, ca.vertcat(at.zeros(n, U.shape[1] + T.shape[1]), by[:, 2 * n + n_z :])


def taken(method: OneStep, plant: Plant, at: At) -> Step:
    """The method's step, its end put back onto the robot's constraints."""
    step = method.step(plant, at)
    if plant.projection is None:
        return step
    return step._replace(x_next=plant.projection(step.x_next, at.theta))


def differentiated(method: OneStep, plant: Plant, at: At) -> Sensitivity:
    """Exact derivatives of any step by automatic differentiation of its graph.

    Hand-written C has no derivative in CasADi but finite differences: solves are CasADi's own here.
    """
    plant = replace(plant, native=False)
    x, u, du, h, theta = (
        plant.kind.sym(name, *part.shape) for name, part in zip(At._fields, at, strict=True)
    )
    n_theta = theta.shape[0]
    n_free = plant.form.jacobian.size2_out(4)  # the columns of T, without block `frames`
    halves = [0, n_theta - n_free, n_theta]
    free = plant.kind.sym("free", n_free)
    frames, _ = ca.vertsplit(theta, halves)
    value = taken(method, plant, At(x, u, du, h, ca.vertcat(frames, free))).x_next
    blocks = [ca.jacobian(value, by) for by in (x, u, free)]
    function = ca.Function("differentiated", [x, u, du, h, theta, free], blocks)
    return Sensitivity(*function.call([*at, ca.vertsplit(at.theta, halves)[1]]))
