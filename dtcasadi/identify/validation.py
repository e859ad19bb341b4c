"""Prediction of data that the parameters were not fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .data import Data
from .gauss_newton import search
from .problem import Problem, node_steps
from .result import ChannelError, Validation
from .shooting import Point, followed, shoot, simulated


def judged(problem: Problem, z: np.ndarray, data: Data) -> Validation:
    """Predict another experiment; its first state is fitted, with the parameters as they are."""
    alone = _known(problem, z, data, problem.settings.nodes)
    nothing = np.zeros(0)
    point = followed(alone, nothing, alone.spread) or simulated(alone, nothing)
    found = None if point is None else search(alone, point).shots
    h = _read(data, None if found is None else found[0])
    return _validation(problem, data, h, data.y, "its first state fitted, nothing else")


def continued(problem: Problem, point: Point, k: int, whole: Data) -> Validation:
    """Predict what comes after the part of an experiment that was fitted."""
    alone = _known(problem, point.z, whole, 1)
    first = Point(np.zeros(0), (point.nodes[k][:1],), (point.frames[k][:1],))
    shots = shoot(alone, first)
    y = whole.y.copy()
    y[: problem.data[k].n + 1] = np.nan
    h = _read(whole, None if shots is None else shots[0])
    return _validation(problem, whole, h, y, "run on from the fitted part")


def _known(problem: Problem, z: np.ndarray, data: Data, nodes: int) -> Problem:
    """One experiment with every parameter known."""
    theta, _ = problem.theta(z)
    steps = (node_steps(data.n, nodes),)
    return replace(problem, parameters=(), theta0=theta, data=(data,), nodes=steps)


def _read(data: Data, stages: tuple | None) -> np.ndarray:
    """What the model reads, NaN where it could not run."""
    if stages is None:
        return np.full_like(data.y, np.nan)
    return np.vstack([stage.h for stage in stages])


def _validation(problem: Problem, data: Data, h: np.ndarray, y: np.ndarray, how: str) -> Validation:
    sigma = np.sqrt(np.diag(problem.R_v))
    channels = []
    for k, name in enumerate(problem.names):
        there = np.isfinite(y[:, k])
        if not np.any(there):
            continue
        e = (h - y)[there, k]
        rms, swing = float(np.sqrt(np.mean(e**2))), float(np.std(y[there, k]))
        fit = 100 * (1 - rms / swing) if swing else np.nan
        size = rms / float(sigma[k])
        unit = problem.units[k]
        channels.append(ChannelError(name, unit, int(there.sum()), rms, size, fit))
    total = sum(each.n * each.size**2 for each in channels)
    count = sum(each.n for each in channels)
    size = float(np.sqrt(total / count)) if count else np.nan
    return Validation(data.source, how, size, tuple(channels))
