"""Recorded motions with noise of a linear model in steps, and scenes with sensors."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from linear_toy import LinearDiscrete

import dtcasadi as dtc
from dtcasadi.identify import Experiment, solve
from dtcasadi.identify.data import gridded
from dtcasadi.identify.problem import Problem, wanted_of
from dtcasadi.logs import Log
from dtcasadi.sampled import Sampled


def toy(seed: int = 0, n_theta: int = 2) -> LinearDiscrete:
    """A stable linear model of three states with two sensors, parameters in both."""
    rng = np.random.default_rng(seed)
    F = 0.9 * np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shapes = [(2, 3), (2, n_theta), (1, 3)]
    H, H_theta, one = (rng.normal(size=shape) for shape in shapes)
    measured = {
        "left": (H, 0.3 * H_theta, np.diag([0.01, 0.04])),
        "right": (one, np.zeros((1, n_theta)), np.array([[0.02]])),
    }
    blocks = {name: slice(k, k + 1) for k, name in enumerate("abcdef"[:n_theta])}
    B = rng.normal(size=(3, n_theta))
    G = rng.normal(size=(3, 1))
    return LinearDiscrete(F, G, B, measured, np.zeros(n_theta), blocks)


def toy_log(
    discrete: LinearDiscrete,
    theta: np.ndarray,
    x0: np.ndarray,
    n: int,
    seed: int = 1,
) -> Log:
    """n steps of it under a random command, noise as its sensors have it."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(n + 1, 1))
    x = np.array(x0, dtype=float)
    rows: dict[str, list[np.ndarray]] = {name: [] for name in discrete.measured}
    for k in range(n + 1):
        for name, (H_x, H_theta, R_v) in discrete.measured.items():
            e = rng.multivariate_normal(np.zeros(len(R_v)), R_v)
            rows[name].append(H_x @ x + H_theta @ theta + e)
        x = discrete.F @ x + discrete.G @ u[k] + discrete.B @ theta
    channels = {"command1": u[:, 0]}
    for name, values in rows.items():
        for k, column in enumerate(np.array(values).T):
            channels[f"{name}.y{k}"] = column
    t = discrete.step_s * np.arange(n + 1)
    return Log(t, channels, dict.fromkeys(channels, ""), "toy")


def sensed(scene: dtc.Scene, *sensors: Sampled) -> dtc.Scene:
    """The scene with these sensors."""
    return replace(scene, sensors=sensors)


def noisy(clean: Log, noise: Mapping[str, float], seed: int) -> Log:
    """Readings of silent sensors with white noise, a standard deviation for each sensor."""
    rng = np.random.default_rng(seed)
    channels = {
        name: column + noise.get(name.split(".")[0], 0.0) * rng.normal(size=len(column))
        for name, column in clean.channels.items()
    }
    return replace(clean, channels=channels)


def covered(problem: Problem, truth: np.ndarray, logs: Iterable[Log]) -> np.ndarray:
    """Share of the replications whose intervals hold the truth, by parameter.

    A search that comes to no end in its steps holds nothing.
    """
    wanted, (given,) = wanted_of(problem.discrete, problem.sensors), problem.data
    hits = []
    for log in logs:
        data = gridded(Experiment(log, given.x0, given.sigma), wanted)
        found = solve(replace(problem, data=(data,)))
        low, high = found.intervals.T
        hits.append(found.success & (low <= truth) & (truth <= high))
    return np.mean(hits, axis=0)
