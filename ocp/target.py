r"""Where a controller is to come to rest: the reachable equilibrium nearest to a reference.

.. math:: \min_{x_s, u_s} |y(x_s) - y^{ref}|^2_W \quad x_s = f(x_s, u_s, \theta),
    \quad u_{min} \le u_s \le u_{max}

With the disturbance of an estimator in theta, a load or a wrong stiffness leaves no steady error in
as many outputs as there are independent commands (Pannocchia and Rawlings, AIChE Journal 49(2),
2003; Rawlings, Mayne, Diehl, Model Predictive Control, section 1.5). Where more outputs are asked
for, what is left is the distance of the nearest equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np
from scipy.optimize import lsq_linear

from dtcasadi.bound import Bound
from dtcasadi.compile import twin

from .problem import refusal
from .slopes import inside
from .stages import Stages

# Largest change of a state in a step at an equilibrium, relative to the size of the states.
_REST = 1e-10
# A command's last change and the slope along it, relative to its range and to the outputs.
_SETTLED = 1e-9
_MOST = 60
_SETTLING, _SHORTEST = 400, 1 / 256
# Damping of the commands that the outputs do not fix: they stay near the start.
_LEVENBERG = 1e-9


class TargetStatus(Enum):
    """How the search for a target ended."""

    REACHED = "the reference is an equilibrium"
    NEAREST = "the reference is no equilibrium; the target is the nearest one"
    SATURATED = "the target is the nearest equilibrium within the limits of the commands"
    FAILED = "no equilibrium was found"

    @property
    def sentence(self) -> str:
        """What it means."""
        return self.value


@dataclass(frozen=True, eq=False)
class Target:
    """An equilibrium to go to.

    Attributes:
        x: states, shape (n_x,).
        u: commands that hold it, shape (n_u,) [Pa].
        distance: y - reference of each tracked channel, in its unit, shape (n_r,).
        cost: the weighted square of it.
        slope: derivative of the outputs for the commands along equilibria, shape (n_r, n_u).
        residual: largest |f(x, u) - x| over its scale.
        stable: whether all eigenvalues of the step are inside the unit circle.
        iterations: linearizations.
        status: how it ended.
    """

    x: np.ndarray
    u: np.ndarray
    distance: np.ndarray
    cost: float
    slope: np.ndarray
    residual: float
    stable: bool
    iterations: int
    status: TargetStatus

    @property
    def found(self) -> bool:
        """Whether it is an equilibrium."""
        return self.status is not TargetStatus.FAILED


class TargetCalculator:
    """Finds targets of a problem on its model; the Functions are built once.

    Gauss-Newton steps in (x, u) together, the states eliminated by the linearized equilibrium, the
    commands within their limits; steps are halved until the equilibrium's residual or the distance
    improves. A start that is a target already costs one linearization.
    """

    def __init__(self, stages: Stages):
        """Build the Functions."""
        if not stages.channels:
            raise refusal("tracking", "at least one output", "none")
        self._stages = stages
        discrete = stages.discrete
        source = discrete.native("linearize_checked")
        step = twin(discrete.linearize_checked, source=source)
        self._step = Bound(step, matrices={"F_x", "F_u", "F_theta"})
        outputs = twin(stages.linearize, source=stages.native)
        self._outputs = Bound(outputs, matrices={"R_x", "G_x"})
        lower, upper = stages.lower.max(axis=0), stages.upper.min(axis=0)
        self._limits = lower, upper
        span = np.where(np.isfinite(upper - lower), upper - lower, 1.0)
        self._span = np.where(span > 0, span, 1.0)
        weight = stages.weight[:-1].max(axis=0)
        self._root = np.sqrt(weight)

    def __call__(
        self,
        reference: np.ndarray,
        theta: np.ndarray,
        x: np.ndarray,
        u: np.ndarray,
        *,
        most: int = _MOST,
        patient: bool = True,
    ) -> Target:
        """The target of a reference.

        Args:
            reference: of each tracked channel, shape (n_r,).
            theta: parameters, disturbances included, shape (n_theta,).
            x: where to start the search, shape (n_x,); of several equilibria a near one is found.
            u: commands to start with, shape (n_u,); where the outputs leave commands free, those
                near to these are taken.
            most: most linearizations from the start.
            patient: where that finds none, or an unstable one, let the model settle at u and follow
                its equilibria from there to the reference; takes some hundred steps.
        """
        found = self._search(reference, theta, x, u, most)
        if not patient or (found.found and found.stable):
            return found
        other = self._followed(reference, theta, x, u)
        return other if other.found and (other.stable or not found.found) else found

    def _followed(
        self, reference: np.ndarray, theta: np.ndarray, x: np.ndarray, u: np.ndarray
    ) -> Target:
        """The target at the end of a path of references that starts where the robot settles."""
        u = np.clip(u, *self._limits)
        for _ in range(_SETTLING):
            found = self._step(x, u, theta)
            if found.status[0] != 0 or not np.all(np.isfinite(found.x_next)):
                break
            x = found.x_next
        start = np.asarray(reference) + self._outputs(x, theta, reference).r
        at = self._search(start, theta, x, u, _MOST)
        done, stride = 0.0, 0.5
        while at.found and done < 1.0 and stride > _SHORTEST:
            to = min(done + stride, 1.0)
            trial = self._search(start + to * (reference - start), theta, at.x, at.u, _MOST)
            if trial.found:
                at, done, stride = trial, to, 2 * stride
            else:
                stride /= 2
        return at if done == 1.0 else self._search(reference, theta, at.x, at.u, _MOST)

    def _search(
        self, reference: np.ndarray, theta: np.ndarray, x: np.ndarray, u: np.ndarray, most: int
    ) -> Target:
        """Gauss-Newton from a start."""
        lower, upper = self._limits
        at = _Point(self, np.array(x, float), np.clip(u, lower, upper), reference, theta)
        if not at.good:
            return self._target(at, 1, failed=True)
        damping = _LEVENBERG
        count, settled = 1, False
        while count < most and not settled:
            dx, du = at.step(damping)
            share, moved = 1.0, None
            for _ in range(8):
                trial = _Point(self, at.x + share * dx, at.u + share * du, reference, theta)
                count += 1
                if trial.good and trial.merit < at.merit * (1 + 1e-12) + 1e-24:
                    moved = trial
                    break
                share /= 2
            if moved is None:
                damping = max(damping * 100, 1e-6)
                settled = bool(damping > 1e3)
                continue
            change = np.max(np.abs(share * du) / self._span)
            settled = bool(change < _SETTLED and moved.residual < _REST)
            damping = max(_LEVENBERG, damping / 10)
            at = moved
        return self._target(at, count, failed=at.residual > 1e3 * _REST)

    def _target(self, at: _Point, count: int, *, failed: bool) -> Target:
        status = TargetStatus.REACHED
        lower, upper = self._limits
        off = np.abs(self._root * at.r)
        scale = np.max(self._root * (1 + np.abs(at.reference)))
        if failed:
            status = TargetStatus.FAILED
        elif np.max(off) > 1e-6 * scale:
            bound = (at.u <= lower) | (at.u >= upper)
            status = TargetStatus.SATURATED if np.any(bound) else TargetStatus.NEAREST
        with np.errstate(all="ignore"):
            finite = np.all(np.isfinite(at.F_x))
            stable = bool(finite and np.max(np.abs(np.linalg.eigvals(at.F_x))) < 1)
        slope = at.R_x @ at.solve(at.F_u) if finite else np.zeros((len(at.r), len(at.u)))
        return Target(at.x, at.u, at.r, at.cost, slope, at.residual, stable, count, status)


class _Point:
    """Step, outputs and their derivatives at one (x, u)."""

    def __init__(
        self,
        owner: TargetCalculator,
        x: np.ndarray,
        u: np.ndarray,
        reference: np.ndarray,
        theta: np.ndarray,
    ):
        self.owner, self.x, self.u, self.reference = owner, x, u, reference
        found = owner._step(x, u, theta)
        within = np.array(inside(owner._stages, ca.DM(u))).ravel()
        slopes = found if np.array_equal(within, u) else owner._step(x, within, theta)
        self.F_x, self.F_u = slopes.F_x, slopes.F_u
        self.gap = found.x_next - x
        outputs = owner._outputs(x, theta, reference)
        self.r, self.R_x = outputs.r, outputs.R_x
        self.good = bool(
            found.status[0] == 0
            and np.all(np.isfinite(self.F_x))
            and np.all(np.isfinite(self.gap))
            and np.all(np.isfinite(self.r))
        )
        with np.errstate(all="ignore"):
            self.residual = float(np.max(np.abs(self.gap) / (1 + np.abs(x)), initial=0.0))
            self.cost = float(np.sum((owner._root * self.r) ** 2))
            # The distance counts where an equilibrium would be reached by the linearized step.
            self.merit = float("inf")
            if self.good:
                self.to_rest = self.solve(self.gap)
                ahead = self.r + self.R_x @ self.to_rest
                self.cost_ahead = float(np.sum((owner._root * ahead) ** 2))
                size = float(np.max(np.abs(self.to_rest) / (1 + np.abs(x)), initial=0.0))
                scale = np.sum((owner._root * (1 + np.abs(reference))) ** 2)
                self.merit = self.cost_ahead / scale + size**2

    def step(self, damping: float) -> tuple[np.ndarray, np.ndarray]:
        """Changes of x and u to the nearest linearized equilibrium."""
        owner = self.owner
        lower, upper = owner._limits
        span = owner._span
        slope = self.solve(self.F_u)
        A = owner._root[:, None] * (self.R_x @ slope) * span
        b = -owner._root * (self.r + self.R_x @ self.to_rest)
        scale = max(float(np.max(np.abs(A), initial=0.0)), 1e-30)
        A = np.vstack([A, np.sqrt(damping) * scale * np.eye(len(span))])
        b = np.concatenate([b, np.zeros(len(span))])
        bounds = (lower - self.u) / span, (upper - self.u) / span
        wide = bounds[1] - bounds[0] > 0
        du = np.zeros(len(span))
        if np.any(wide):
            box = tuple(bound[wide] for bound in bounds)
            du[wide] = lsq_linear(A[:, wide], b, box, tol=1e-14).x
        du = np.clip(du, *bounds) * span
        return self.to_rest + slope @ du, du

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """(1 - F_x)^-1 rhs; where an equilibrium is not isolated, the shortest solution."""
        matrix = np.eye(len(self.x)) - self.F_x
        try:
            found = np.linalg.solve(matrix, rhs)
            if np.all(np.isfinite(found)) and np.max(np.abs(matrix @ found - rhs), initial=0.0) < (
                1e-6 * (1 + np.max(np.abs(rhs), initial=0.0))
            ):
                return found
        except np.linalg.LinAlgError:
            pass
        return np.linalg.lstsq(matrix, rhs, rcond=1e-12)[0]
