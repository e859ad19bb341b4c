"""A problem on a discrete model: every term as a Function or an array over the horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from dtcasadi import checks

from .base import Discrete
from .outputs import Outputs, picked_of
from .problem import Problem, refusal
from .rows import rows_of, weights_of


@dataclass(frozen=True, eq=False)
class Stages:
    """What a solver sees; N is the horizon, all arrays are read-only.

    The same Functions hold at every k; at k = 0 nothing of the state can be changed any more, so
    its tracking and its soft limits do not count.

    Attributes:
        discrete: the model.
        problem: where this comes from.
        residual: Function x, theta, reference (n_r,) -> r (n_r,) = y - reference, the tracked
            channels one after the other.
        inequality: Function x, theta -> g (n_g,), wished to be <= 0.
        linearize: Function x, theta, reference -> r, R_x (n_r, n_x), g, G_x (n_g, n_x).
        native: the same with hand-written C kernels inside, for code generation only.
        weight: W of r at k = 0 ... N, shape (N + 1, n_r); the last row is zero under a terminal
            cost.
        change: W_change of u_k - u_{k-1}, shape (N, n_u).
        level: W_level of u_k - u_s, shape (N, n_u).
        lower: of u_k, shape (N, n_u) [Pa].
        upper: shape (N, n_u) [Pa].
        rate: largest |u_k - u_{k-1}|, shape (N, n_u) [Pa]; inf where there is none.
        linear: price of each slack of g, shape (n_g,).
        quadratic: of its square, shape (n_g,).
        block_of: block of each interval, shape (N,); 0 ... N - 1 without move blocking.
        safe: the safe pressure, shape (n_u,).
        channels: name and unit of each entry of r.
        limits: name and unit of each entry of g.
    """

    discrete: Discrete
    problem: Problem
    residual: ca.Function
    inequality: ca.Function
    linearize: ca.Function
    native: ca.Function
    weight: np.ndarray
    change: np.ndarray
    level: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    rate: np.ndarray
    linear: np.ndarray
    quadratic: np.ndarray
    block_of: np.ndarray
    safe: np.ndarray
    channels: tuple[tuple[str, str], ...]
    limits: tuple[tuple[str, str], ...]

    @property
    def n_x(self) -> int:
        """Number of states."""
        return len(self.discrete.state_names)

    @property
    def n_u(self) -> int:
        """Number of commands."""
        return self.lower.shape[1]

    @property
    def horizon(self) -> int:
        """Number N of intervals."""
        return self.problem.horizon

    @property
    def tracked(self) -> list[tuple[str, list[int]]]:
        """Sensor and places of the tracked channels of each term, in the order of r."""
        return [
            (term.output, picked_of(self.discrete, term.output, term.channels, "channels"))
            for term in self.problem.tracking
        ]

    def references(self, t: float = 0.0) -> np.ndarray:
        """References at t, t + h, ..., t + N h, shape (N + 1, n_r).

        Raises:
            ControlError: a function of time gives something else than finite numbers.
        """
        N, h = self.horizon, self.discrete.step_s
        parts = []
        for i, term in enumerate(self.problem.tracking):
            name = f"tracking[{i + 1}].reference"
            m = len(picked_of(self.discrete, term.output, term.channels, name))
            value = term.reference
            if callable(value):
                value = [np.broadcast_to(value(t + k * h), (m,)) for k in range(N + 1)]
            parts.append(rows_of(name, value, N + 1, m))
        return np.hstack(parts) if parts else np.zeros((N + 1, 0))


def stages(discrete: Discrete, problem: Problem) -> Stages:
    """Put a problem on a model: check names and shapes, and build its Functions.

    Raises:
        ControlError: a term does not fit the model.
    """
    n_u = discrete.linearize.size1_in("u")
    if not n_u:
        raise refusal("discrete", "a model with a command", "one without")
    N = problem.horizon
    effort, limits = problem.effort, problem.limits
    lower, upper, rate = (
        rows_of(f"limits.{name}", getattr(limits, name), N, n_u, finite=False)
        for name in ("lower", "upper", "rate")
    )
    if np.any(lower > upper):
        raise refusal("limits", "lower limits up to the upper ones", "higher ones")
    if np.any(rate <= 0):
        raise refusal("limits.rate", "positive numbers", checks.shown(limits.rate))
    change, level = (
        weights_of(f"effort.{name}", getattr(effort, name), N, n_u) for name in ("change", "level")
    )
    read = Outputs(discrete, problem)
    block_of = np.arange(N)
    if problem.blocks is not None:
        block_of = np.repeat(np.arange(len(problem.blocks)), problem.blocks)
    values = {
        "weight": read.weight,
        "change": change,
        "level": level,
        "lower": lower,
        "upper": upper,
        "rate": rate * discrete.step_s,
        "linear": read.linear,
        "quadratic": read.quadratic,
        "block_of": block_of,
        "safe": _safe(problem.safe_pressure, lower, upper),
    }
    _check_terminal(problem.terminal, len(discrete.state_names) + n_u)
    for value in values.values():
        value.flags.writeable = False
    return Stages(
        discrete,
        problem,
        **read.functions(),
        **values,
        channels=read.channels,
        limits=read.limits,
    )


def _safe(value: Any, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    least, most = lower.max(axis=0), upper.min(axis=0)
    if value is None:
        return np.clip(0.0, least, most)
    safe = rows_of("safe_pressure", value, 1, len(least))[0]
    if np.any(safe < least) or np.any(safe > most):
        raise refusal("safe_pressure", "a command within the limits", checks.shown(value))
    return safe


def _check_terminal(terminal: Any, n: int) -> None:
    if terminal is None or isinstance(terminal, str):
        return
    P = checks.array("terminal", terminal, (n, n), error=refusal)
    scale = float(np.max(np.abs(P)))
    # Round-off of the product that made it.
    off = np.max(np.abs(P - P.T)) > 1e-9 * scale
    if off or np.min(np.linalg.eigvalsh((P + P.T) / 2)) < -1e-9 * scale:
        raise refusal("terminal", "a symmetric positive semidefinite matrix", "another one")
