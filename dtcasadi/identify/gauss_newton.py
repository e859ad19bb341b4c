"""Gauss-Newton on the nodes and the parameters, damped, with an exact penalty on the jumps.

Each step solves the linearized problem (`elimination`). It is taken whole where the merit

    cost of the residuals + sum_j weights_j |jump_j|

falls as the linear model says, else shortened, then damped (Marquardt 1963); the weights stay above
the multipliers of the jumps, which makes the penalty exact (Nocedal and Wright, Numerical
Optimization, section 18.3). Huber's loss enters by weights that are computed anew at each step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from .elimination import ROUND_OFF, Reduced, first_change, reduced, without_state
from .problem import Problem
from .shooting import Point, Stages, shoot

# A step is the last when the linear model promises less than this of the cost, in half standard
# deviations squared: it then moves nothing by more than 1.5e-3 standard deviations ...
SMALL_GAIN = 1e-5
# ... and no jump at a node exceeds this share of the largest state.
SMALL_JUMP = 1e-7
SHARE = 1e-4  # of the promised gain that has to come true
LONGEST = 1.5  # of a step in z: a factor of 4.5, or one and a half times the scale
# A direction in which the data leave a factor of exp(20) open is not followed.
WEAKEST = 1 / 20
_SHORTER = (1.0, 0.5, 0.2, 0.05)
_DAMPINGS = 8


class Status:
    """How a search may end."""

    CONVERGED, STALLED, LIMIT, FAILED = "converged", "stalled", "limit", "failed"


@dataclass(frozen=True, eq=False)
class Found:
    """Where the search ended.

    Attributes:
        point: parameters and nodes.
        shots: the stages there; None where the model could not run even at the start.
        status: `converged`, `stalled`, `limit` or `failed`.
        message: a sentence.
        iterations: steps taken.
        costs: cost at the start and after each step.
        jump: largest jump at a node, over the largest state.
    """

    point: Point
    shots: tuple[Stages, ...] | None
    status: str
    message: str
    iterations: int
    costs: tuple[float, ...]
    jump: float


class Direction(NamedTuple):
    """A step of the linearized problem, and what it promises."""

    dz: np.ndarray
    nodes: tuple[np.ndarray, ...]
    gain: float
    multipliers: tuple[np.ndarray, ...]


def search(
    problem: Problem,
    point: Point,
    progress: Callable[[int, float], None] | None = None,
) -> Found:
    """Improve a point until nothing is left to gain."""
    shots, max_iterations = shoot(problem, point), problem.settings.max_iterations
    if shots is None:
        message = "the model cannot run from the start: try other starting values or a smaller step"
        return Found(point, None, Status.FAILED, message, 0, (), math.inf)
    weights = tuple(np.zeros_like(nodes) for nodes in point.nodes)
    costs, mu, taken = [cost_of(problem, point, shots)], 0.0, 0
    status, message = Status.LIMIT, f"stopped after {max_iterations} steps that still gained"
    while taken < max_iterations:
        rows = linearized(problem, point, shots)
        trial = None
        for _ in range(_DAMPINGS):
            way = _direction(problem, point, shots, rows, mu)
            weights = _raised(weights, way.multipliers)
            promised = way.gain + _penalty(shots, weights)
            if way.gain < SMALL_GAIN and relative_jump(point, shots) < SMALL_JUMP and not mu:
                status, message = Status.CONVERGED, "no step gains any more"
                break
            trial = _tried(problem, point, shots, way, weights, promised)
            if trial is not None:
                break
            mu = max(1e-3, 10 * mu)
        if status == Status.CONVERGED:
            break
        if trial is None:
            status, message = _stalled(problem, point, shots, rows)
            break
        point, shots = trial
        mu = 0.0 if mu < 1e-5 else mu / 10
        taken += 1
        costs.append(cost_of(problem, point, shots))
        if progress:
            progress(taken, costs[-1])
    found = (point, shots, status, message, taken, tuple(costs))
    return Found(*found, relative_jump(point, shots))


def cost_of(problem: Problem, point: Point, shots: tuple[Stages, ...]) -> float:
    """Half the sum of squares, or Huber's, of residuals, first states and priors."""
    total = 0.0
    for k, stages in enumerate(shots):
        for stage in stages:
            total += _loss(problem, stage.r)
        sigma = problem.data[k].sigma
        known = (sigma > 0) & np.isfinite(sigma)
        off = (point.nodes[k][0] - problem.data[k].x0)[known] / sigma[known]
        total += 0.5 * float(off @ off)
    prior = priors(problem, point.z)[:, -1]
    return total + 0.5 * float(prior @ prior)


def linearized(problem: Problem, point: Point, shots: tuple[Stages, ...]) -> tuple[Reduced, ...]:
    """Each experiment reduced to its first state and the parameters."""
    found = []
    for k, stages in enumerate(shots):
        data = problem.data[k]
        roots = [root_weights(problem, stage.r) for stage in stages]
        found.append(reduced(stages, roots, point.nodes[k][0] - data.x0, data.sigma))
    return tuple(found)


def root_weights(problem: Problem, r: np.ndarray) -> np.ndarray:
    """Square roots of the weights: of Huber's loss min(1, threshold / |r|)."""
    if problem.settings.loss == "squares":
        return np.ones_like(r)
    return np.sqrt(problem.settings.threshold / np.maximum(np.abs(r), problem.settings.threshold))


def priors(problem: Problem, z: np.ndarray) -> np.ndarray:
    """Rows [A b] of what is known of the parameters, shape (m, n_p + 1)."""
    rows = []
    for k, parameter in enumerate(problem.parameters):
        if parameter.prior:
            mean, sigma = parameter.prior
            row = np.zeros(problem.n_p + 1)
            row[k] = parameter.slope(z[k]) / sigma
            row[-1] = (parameter.value(z[k]) - mean) / sigma
            rows.append(row)
    return np.array(rows).reshape(len(rows), problem.n_p + 1)


def relative_jump(point: Point, shots: tuple[Stages, ...]) -> float:
    """The largest jump at a node over the largest state of its kind."""
    worst = 0.0
    for nodes, stages in zip(point.nodes, shots, strict=True):
        size = np.maximum(np.max(np.abs(nodes), axis=0), 1e-6)
        worst = max(worst, *(float(np.max(np.abs(s.jump) / size, initial=0.0)) for s in stages))
    return worst


def _loss(problem: Problem, r: np.ndarray) -> float:
    if problem.settings.loss == "squares":
        return 0.5 * float(r @ r)
    a, c = np.abs(r), problem.settings.threshold
    return float(np.sum(np.where(a <= c, 0.5 * a * a, c * (a - 0.5 * c))))


def _direction(
    problem: Problem, point: Point, shots: tuple[Stages, ...], rows: tuple[Reduced, ...], mu: float
) -> Direction:
    """The step of the linearized problem."""
    stacked = np.vstack([*(without_state(each, mu) for each in rows), priors(problem, point.z)])
    A, b = stacked[:, :-1], stacked[:, -1]
    if mu:
        norms = np.linalg.norm(A, axis=0)
        A = np.vstack([A, np.sqrt(mu) * np.diag(np.where(norms > 0, norms, 1.0))])
        b = np.concatenate([b, np.zeros(problem.n_p)])
    dz = _bounded(problem, point.z, A, b)
    nodes, multipliers, ahead = [], [], 0.0
    for each, stages in zip(rows, shots, strict=True):
        ds = first_change(each, dz, mu)
        ahead += 0.5 * float(np.sum((each.A_s @ ds[each.free] + each.A_p @ dz + each.b) ** 2))
        changes, pulls = [ds], [np.zeros_like(ds)]
        for stage, C in zip(stages[:-1], each.triangles[1:], strict=True):
            ds = stage.X @ ds + stage.G @ dz + stage.jump
            changes.append(ds)
            pulls.append(C[:, : len(ds)].T @ (C @ np.concatenate([ds, dz, [1.0]])))
        nodes.append(np.array(changes))
        multipliers.append(np.array(pulls))
    prior = priors(problem, point.z)
    ahead += 0.5 * float(np.sum((prior[:, :-1] @ dz + prior[:, -1]) ** 2))
    gain = _weighted_cost(problem, point, shots) - ahead
    return Direction(dz, tuple(nodes), gain, tuple(multipliers))


def _weighted_cost(problem: Problem, point: Point, shots: tuple[Stages, ...]) -> float:
    """What the linear model says the cost is now: Huber's weights as they are."""
    if problem.settings.loss == "squares":
        return cost_of(problem, point, shots)
    rest = cost_of(problem, point, tuple(() for _ in shots))
    return rest + sum(
        0.5 * float(np.sum((root_weights(problem, stage.r) * stage.r) ** 2))
        for stages in shots
        for stage in stages
    )


def _bounded(problem: Problem, z: np.ndarray, A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The dz of least |A dz + b| in bounds and the longest step; open directions stay."""
    lower, upper = limits(problem, z)
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    kept = s > max(ROUND_OFF * s[0], WEAKEST) if len(s) else s > 0
    if not np.any(kept):
        return np.zeros(problem.n_p)
    target = -(U[:, kept].T @ b)
    dz = Vt[kept].T @ (target / s[kept])
    if np.all(dz >= lower) and np.all(dz <= upper):
        return dz
    matrix = s[kept][:, np.newaxis] * Vt[kept]
    return lsq_linear(matrix, target, bounds=(lower, upper), method="bvls").x


def limits(problem: Problem, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far each parameter may go in one step, down and up."""
    low, high = np.empty(problem.n_p), np.empty(problem.n_p)
    for k, parameter in enumerate(problem.parameters):
        far = LONGEST if parameter.value0 else math.inf
        low[k] = max(parameter.place(parameter.lower) - z[k], -far)
        high[k] = min(parameter.place(parameter.upper) - z[k], far)
    # On a bound to round-off is on it; the solver wants an interval.
    return np.minimum(low, -1e-12), np.maximum(high, 1e-12)


def _raised(
    weights: tuple[np.ndarray, ...], multipliers: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, ...]:
    """Weights of the jumps, above the multipliers, falling slowly."""
    pairs = zip(weights, multipliers, strict=True)
    return tuple(np.maximum(1.1 * np.abs(m), 0.5 * (w + np.abs(m))) for w, m in pairs)


def _penalty(shots: tuple[Stages, ...], weights: tuple[np.ndarray, ...]) -> float:
    """Sum of the weighted jumps."""
    return sum(
        float(np.abs(stage.jump) @ weight)
        for stages, rows in zip(shots, weights, strict=True)
        for stage, weight in zip(stages[:-1], rows[1:], strict=True)
    )


def _tried(
    problem: Problem,
    point: Point,
    shots: tuple[Stages, ...],
    way: Direction,
    weights: tuple[np.ndarray, ...],
    promised: float,
) -> tuple[Point, tuple[Stages, ...]] | None:
    """The first of ever shorter steps that gains what it should; None: none of them does."""
    before = cost_of(problem, point, shots) + _penalty(shots, weights)

    def gains(new: Point, found: tuple[Stages, ...] | None, share: float) -> bool:
        if found is None:
            return False
        after = cost_of(problem, new, found) + _penalty(found, weights)
        return after <= before - SHARE * share * promised

    for share in _SHORTER:
        nodes = zip(point.nodes, way.nodes, strict=True)
        new = point._replace(
            z=point.z + share * way.dz, nodes=tuple(x + share * dx for x, dx in nodes)
        )
        found = shoot(problem, new)
        if gains(new, found, share):
            return new, found  # type: ignore[return-value]
        if share == 1 and found is not None:
            new = _closed(new, found)
            found = shoot(problem, new)
            if gains(new, found, share):
                return new, found  # type: ignore[return-value]
    return None


def _closed(point: Point, shots: tuple[Stages, ...]) -> Point:
    """The point with its jumps closed to first order, from each first state on.

    A whole step bends the motion and leaves jumps of second order, which the penalty would take for
    a loss (Nocedal and Wright, section 15.6, second-order correction).
    """
    nodes = []
    for states, stages in zip(point.nodes, shots, strict=True):
        changes = [np.zeros_like(states[0])]
        for stage in stages[:-1]:
            changes.append(stage.X @ changes[-1] + stage.jump)
        nodes.append(states + np.array(changes))
    return point._replace(nodes=tuple(nodes))


def _stalled(
    problem: Problem, point: Point, shots: tuple[Stages, ...], rows: tuple[Reduced, ...]
) -> tuple[str, str]:
    """What to say where no step gains: round-off at the solution, or a real stall."""
    left = _direction(problem, point, shots, rows, 0.0).gain
    noise = 1e-9 * (1 + cost_of(problem, point, shots))
    if left < max(100 * SMALL_GAIN, noise) and relative_jump(point, shots) < 1e-4:
        return Status.CONVERGED, "no step gains any more, to round-off"
    return (
        Status.STALLED,
        f"no step in the computed direction gains (a gain of {left:.3g} is promised): try other "
        "starting values, bounds, more nodes or nodes='data'",
    )
