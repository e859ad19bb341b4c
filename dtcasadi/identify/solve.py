"""From a problem to a result: the search, then statistics, tests and validation."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .data import Data
from .elimination import ROUND_OFF, Reduced, without_state
from .gauss_newton import Found, Status, linearized, priors, search
from .parameters import Parameter
from .problem import Problem
from .result import Fit, Identified, Validation
from .shooting import Point, followed, simulated
from .statistics import huber_factor, sentences, spread_of
from .validation import continued, judged
from .whiteness import ResidualTests, residual_tests

RESTARTS = 3
_SIGMAS, _BETTER = 5.0, 0.01
OUTLIER = 4.0  # standard deviations; Huber's loss takes what is beyond for a fault of the sensor


def solve(
    problem: Problem,
    *,
    held_out: Sequence[Data] = (),
    later: Sequence[Data] = (),
    progress: Callable[[int, float], None] | None = None,
) -> Identified:
    """Find the parameters.

    Args:
        problem: what `build` made.
        held_out: other experiments to predict; their first states are fitted, nothing else.
        later: the experiments in full where the problem has only their beginnings; the rest is
            predicted from the fitted motion.
        progress: called with iteration and cost after each step.
    """
    began = time.perf_counter()
    found = _searched(problem, progress)
    return _result(problem, found, (tuple(held_out), tuple(later)), began)


def _searched(problem: Problem, progress: Callable[[int, float], None] | None) -> Found:
    """The search, begun anew near the readings where it ends far from what noise would leave.

    Such an end may be a minimum of its own, with first states that make up for wrong parameters.
    """
    found = search(problem, first_point(problem), progress)
    for _ in range(RESTARTS):
        if found.shots is None or not _far(problem, found):
            break
        point = followed(problem, found.point.z, problem.spread)
        other = None if point is None else search(problem, point, progress)
        if other is None or not other.costs or other.costs[-1] > (1 - _BETTER) * found.costs[-1]:
            break
        found = replace(other, iterations=found.iterations + other.iterations)
    return found


def _far(problem: Problem, found: Found) -> bool:
    """Whether the cost is beyond what noise would leave, or the search came to no end."""
    count = sum(int(np.sum(np.isfinite(data.y))) for data in problem.data)
    return found.status != Status.CONVERGED or found.costs[-1] > 0.5 * (
        count + _SIGMAS * math.sqrt(2 * count)
    )


def first_point(problem: Problem) -> Point:
    """Where the search starts."""
    z = np.zeros(problem.n_p)
    point = followed(problem, z, problem.spread) if problem.settings.begin == "data" else None
    point = point or simulated(problem, z)
    if point is None:
        pairs = zip(problem.data, problem.nodes, strict=True)
        nodes = tuple(np.tile(data.x0, (len(steps), 1)) for data, steps in pairs)
        frames = problem.theta0[problem.discrete.theta_blocks.get("frames", slice(0, 0))]
        point = Point(z, nodes, tuple(np.tile(frames, (len(each), 1)) for each in nodes))
    return point


class Local(NamedTuple):
    """The problem about its solution.

    Attributes:
        r: residuals in standard deviations.
        rows: their derivatives for the parameters, with the first states eliminated.
        fitted: how many numbers were fitted.
        factor: on the covariance: what Huber's loss costs.
        fits: readings and model.
    """

    r: np.ndarray
    rows: np.ndarray
    fitted: int
    factor: float
    fits: tuple[Fit, ...]


def _local(problem: Problem, found: Found) -> Local:
    n_p = problem.n_p
    if found.shots is None:
        fits = tuple(Fit(d.source, d.t, d.y, np.full_like(d.y, np.nan)) for d in problem.data)
        return Local(np.zeros(0), np.zeros((0, n_p)), n_p, 1.0, fits)
    fits = tuple(
        Fit(d.source, d.t, d.y, np.vstack([stage.h for stage in stages]))
        for d, stages in zip(problem.data, found.shots, strict=True)
    )
    r = np.concatenate([stage.r for stages in found.shots for stage in stages])
    # Of Huber's loss the factor knows the weights.
    rows = linearized(_squares(problem), found.point, found.shots)
    pairs = zip(rows, problem.data, strict=True)
    fitted = n_p + round(sum(states_fitted(each, data.sigma) for each, data in pairs))
    alone = np.vstack([without_state(each)[:, :-1] for each in rows])
    huber = problem.settings.loss == "huber" and len(r)
    factor = huber_factor(r, problem.settings.threshold) if huber else 1.0
    return Local(r, alone, fitted, factor, fits)


def states_fitted(rows: Reduced, sigma: np.ndarray) -> float:
    """How many numbers of a first state the data settled rather than what was known of it."""
    known = (sigma > 0) & np.isfinite(sigma)
    if not np.any(rows.free):
        return 0.0
    _, s, Vt = np.linalg.svd(rows.A_s, full_matrices=False)
    told = s > ROUND_OFF * s[0]
    spread = np.sum((Vt[told] / s[told][:, np.newaxis]) ** 2, axis=0)
    weighed = known[rows.free]
    return float(np.sum(told) - np.sum(spread[weighed] / sigma[rows.free][weighed] ** 2))


def _result(
    problem: Problem,
    found: Found,
    others: tuple[tuple[Data, ...], tuple[Data, ...]],
    began: float,
) -> Identified:
    z, parameters = found.point.z, problem.parameters
    local, level = _local(problem, found), problem.settings.level
    at_bound = np.array([_on_bound(p, v) for p, v in zip(parameters, z, strict=True)], dtype=bool)
    joint = np.vstack([local.rows, priors(problem, z)[:, :-1]])
    spread = spread_of(parameters, z, joint, local.factor, level, fixed=at_bound)
    silent = spread_of(parameters, z, local.rows, local.factor, level).directions
    tests, notes = _tests(problem, local)
    judged_ones: tuple[Validation, ...] = ()
    if found.shots is not None:
        own = (continued(problem, found.point, k, data) for k, data in enumerate(others[1]))
        judged_ones = (*own, *(judged(problem, z, data) for data in others[0]))
    return Identified(
        names=tuple(p.name for p in parameters),
        values=np.array([p.value(v) for p, v in zip(parameters, z, strict=True)]),
        starts=np.array([p.value0 for p in parameters]),
        units=tuple(p.unit for p in parameters),
        covariance=spread.covariance,
        intervals=spread.intervals,
        level=level,
        correlation=spread.correlation,
        unidentifiable=sentences(parameters, silent) if found.shots is not None else (),
        at_bound=tuple(p.name for p, on in zip(parameters, at_bound, strict=True) if on),
        tests=tests,
        validation=judged_ones,
        status=found.status,
        message=_message(problem, found, tests, len(silent)),
        iterations=found.iterations,
        cost=found.costs[-1] if found.costs else math.nan,
        theta=problem.theta(z)[0],
        x0=tuple(nodes[0] for nodes in found.point.nodes),
        fits=local.fits,
        notes=notes,
        problem=problem,
        build_s=problem.build_s,
        solve_s=time.perf_counter() - began,
    )


def _tests(problem: Problem, local: Local) -> tuple[ResidualTests, tuple[str, ...]]:
    """Tests of the residuals, and the notes; with Huber's loss outliers are told, not tested."""
    notes = [f"{data.source}: {note}" for data in problem.data for note in data.notes]
    sigma = np.sqrt(np.diag(problem.R_v))
    residuals, r = [fit.h - fit.y for fit in local.fits], local.r
    if problem.settings.loss == "huber":
        with np.errstate(invalid="ignore"):
            residuals = [np.where(np.abs(e) > OUTLIER * sigma, np.nan, e) for e in residuals]
        out = np.abs(r) > OUTLIER
        r = r[~out]
        notes.append(
            f"{int(out.sum())} of {len(out)} readings are outliers, beyond {OUTLIER:g} standard "
            "deviations"
        )
    sides = (problem.names, problem.units, sigma)
    return residual_tests(residuals, *sides, r, local.fitted), tuple(notes)


def _on_bound(parameter: Parameter, z: float) -> bool:
    ends = (parameter.place(parameter.lower), parameter.place(parameter.upper))
    return any(math.isfinite(end) and abs(z - end) < 1e-9 for end in ends)


def _message(problem: Problem, found: Found, tests: ResidualTests, n_silent: int) -> str:
    """The status as a sentence with what most needs saying."""
    parts = [found.message]
    if found.status != Status.FAILED:
        if n_silent:
            told = problem.n_p - n_silent
            parts.append(f"the data tell {told} of {problem.n_p} parameters or combinations")
        if not tests.passed:
            parts.append("the residuals are not what the stated noise would leave")
    return "; ".join(parts)


def _squares(problem: Problem) -> Problem:
    """The problem with the loss of least squares."""
    return replace(problem, settings=replace(problem.settings, loss="squares"))
