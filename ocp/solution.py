"""What a solver gives back, with the proof that it may be used."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np
from scipy.optimize import lsq_linear

from .nlp import Nlp


class Status(Enum):
    """How a solver ended, checked by the conditions of Karush, Kuhn and Tucker."""

    SOLVED = "an optimum: bounds and optimality hold"
    INACCURATE = "the solver reports success, but its solution fails the check"
    LIMIT = "the solver stopped at its limit of iterations before the optimum"
    INFEASIBLE = "the solver found no point within the constraints"
    FAILED = "the solver gave up"

    @property
    def sentence(self) -> str:
        """What it means."""
        return self.value


@dataclass(frozen=True)
class Residuals:
    """Of the scaled program (Nocedal and Wright, Numerical Optimization, section 12.3).

    Attributes:
        stationarity: largest entry of the Lagrangian's gradient over 1 + that of the cost's.
        feasibility: largest violation of bounds and constraints.
        complementarity: largest multiplier times distance from its bound; of a multiplier of the
            wrong sign, the multiplier itself.
    """

    stationarity: float
    feasibility: float
    complementarity: float

    @property
    def largest(self) -> float:
        """The largest of the three."""
        return max(self.stationarity, self.feasibility, self.complementarity)


@dataclass(frozen=True, eq=False)
class Solution:
    """A plan and its certificate.

    Attributes:
        x: states, shape (N + 1, n_x).
        u: commands, shape (N, n_u) [Pa].
        slack: violations of the soft limits at k = 1 ... N, shape (N, n_g).
        cost: J, in the units of the problem.
        status: how the solver ended.
        residuals: what the check found.
        iterations: of the solver.
        build_s: time to build the solver [s].
        solve_s: time of this solve [s].
        solver: its name.
        message: its own words.
        w: the program's variables, for a warm start.
        lam_x: multipliers of their bounds.
        lam_g: of the constraints.
    """

    x: np.ndarray
    u: np.ndarray
    slack: np.ndarray
    cost: float
    status: Status
    residuals: Residuals
    iterations: int
    build_s: float
    solve_s: float
    solver: str
    message: str
    w: np.ndarray
    lam_x: np.ndarray
    lam_g: np.ndarray

    @property
    def good(self) -> bool:
        """Whether it is an optimum."""
        return self.status is Status.SOLVED

    @property
    def text(self) -> str:
        """One line for people."""
        return f"{self.solver}: {self.status.sentence} ({self.message})"


def lagrangian(nlp: Nlp) -> ca.Function:
    """Function w, p, lam_g -> f, g, gradient of the cost, of the cost and the constraints."""
    w, p, f, g = (nlp.parts[name] for name in ("x", "p", "f", "g"))
    lam = ca.MX.sym("lam_g", g.shape[0])
    slopes = [ca.gradient(f, w), ca.gradient(f + ca.dot(lam, g), w)]
    names = ["f", "g", "df", "dl"]
    return ca.Function("lagrangian", [w, p, lam], [f, g, *slopes], ["w", "p", "lam_g"], names)


def certificate(
    nlp: Nlp,
    found: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    w: np.ndarray,
    lam_x: np.ndarray,
    lam_g: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
) -> Residuals:
    """Check a solution without a word of its solver.

    Args:
        nlp: the program.
        found: outputs of `lagrangian` at w, lam_g.
        w: variables.
        lam_x: multipliers of the bounds, positive at upper ones.
        lam_g: of the constraints.
        bounds: lower and upper bounds of w.
    """
    _, g, df, dl = found
    with np.errstate(all="ignore"):
        stationarity = np.max(np.abs(dl + lam_x), initial=0.0) / (
            1 + np.max(np.abs(df), initial=0.0)
        )
        off, gap = 0.0, 0.0
        for value, lam, lower, upper in ((w, lam_x, *bounds), (g, lam_g, nlp.lbg, nlp.ubg)):
            off = max(off, np.max(np.maximum(lower - value, value - upper), initial=0.0))
            gap = max(gap, _gap(value, lam, lower, upper))
    values = [float(part) for part in (stationarity, off, gap)]
    return Residuals(*(value if np.isfinite(value) else float("inf") for value in values))


def _gap(value: np.ndarray, lam: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Largest |multiplier| times distance from the bound that it belongs to."""
    room = np.where(lam > 0, upper - value, value - lower)
    room = np.where(lower == upper, 0.0, np.clip(room, 0.0, 1.0))
    return float(np.max(np.abs(lam) * room, initial=0.0))


def multipliers(
    nlp: Nlp,
    jacobian: np.ndarray,
    df: np.ndarray,
    points: tuple[np.ndarray, np.ndarray],
    bounds: tuple[np.ndarray, np.ndarray],
    within: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of a point by least squares over its active constraints, of the right signs.

    Some QP solvers return a good point with multipliers that are not its own; these prove it.

    Args:
        nlp: the program.
        jacobian: of its constraints, shape (n_g, n_w).
        df: gradient of the cost.
        points: w and g there.
        bounds: lower and upper bounds of w.
        within: distance from a bound that counts as active.

    Returns:
        Those of the bounds of w, and those of the constraints.
    """
    rows, signs = [], []
    for value, (lower, upper) in zip(points, (bounds, (nlp.lbg, nlp.ubg)), strict=True):
        rows.append(np.stack([value - lower <= within, upper - value <= within]))
        signs.append([np.where(side, np.inf, 0.0) for side in rows[-1]])
    active = np.concatenate([np.any(part, axis=0) for part in rows])
    whole = np.vstack([np.eye(len(df)), jacobian])[active]
    low, high = (np.concatenate([part[k] for part in signs])[active] for k in (0, 1))
    lam = np.zeros(len(active))
    if np.any(active):
        lam[active] = lsq_linear(whole.T, -df, (-low, high), tol=1e-14).x
    return lam[: len(df)], lam[len(df) :]
