"""Runs made up for the tests of pictures: any motion, nothing compiled or integrated."""

from dataclasses import replace
from typing import Any

import numpy as np

import dtcasadi as dtc
from dtcasadi import presets
from dtcasadi.recentring import recentre

HEXAGON = [
    (0.05 * np.sin(angle), 0.05 * (1 - np.cos(angle))) for angle in np.radians(range(0, 360, 60))
]


def robot_of(**fields: Any) -> dtc.Robot:
    """A robot from fields in any form that it accepts."""
    return dtc.Robot(**fields)


def made_up(model: dtc.Model, t: np.ndarray, q: np.ndarray, qd: np.ndarray, **fields) -> dtc.Run:
    """A run with the given coordinates, shape (n_q, n); what else it needs is plausible."""
    n = len(t)
    actuator = np.zeros((model.n_x - 2 * model.n_q, n))
    values: dict[str, Any] = {
        "model": model,
        "t": t,
        "x": np.vstack([q, qd, actuator]),
        "u": np.zeros((model.n_u, n)),
        "thetas": np.repeat(model.theta0[:, np.newaxis], n, axis=1),
        "success": True,
        "message": "made up",
        "method": "none",
        "energy": {
            "t": t,
            "kinetic": np.sin(t) ** 2,
            "potential": -5 * t,
            "stored": 0 * t,
            "supplied": t,
            "dissipated": 6 * t,
            "residual": 1e-7 * t,
        },
        "condition": 10 + t,
        "recentrings": (),
        "events": (),
        "steps": n - 1,
        "step_sizes": np.diff(t),
        "choice": "",
        "rejected": 0,
        "evaluations": 4 * n,
        "wall_time": 0.01,
    }
    values |= fields
    return dtc.Run(**values, dense=_between(model, values))


def _between(model: dtc.Model, values: dict[str, Any]):
    """Coordinates by cubic Hermite in each step; at constant rates in one that re-centres."""
    t, x, u, thetas = (values[name] for name in ("t", "x", "u", "thetas"))
    q, qd = slice(0, model.n_q), slice(model.n_q, 2 * model.n_q)

    def dense(times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        k = np.searchsorted(t, times, side="right") - 1
        after = np.minimum(k + 1, len(t) - 1)
        h = np.maximum(t[after] - t[k], 1e-12)
        s, v, w = (times - t[k]) / h, h * x[qd, k], h * x[qd, after]
        moved = x[q, after] - x[q, k]
        smooth = s * (v + s * (3 * moved - 2 * v - w + s * (v + w - 2 * moved)))
        same = np.all(thetas[:, k] == thetas[:, after], axis=0)
        states = x[:, k].copy()
        states[q] += np.where(same, smooth, s * v)
        return states, u[:, k], thetas[:, k]

    return dense


def swinging(model: dtc.Model, amplitude: float = 0.4, t_end: float = 3.0, **fields) -> dtc.Run:
    """Every coordinate swings, each with its own phase; the exact rates go along."""
    t = np.linspace(0.0, t_end, 121)
    phase = np.arange(model.n_q)[:, np.newaxis]
    q, qd = amplitude * np.sin(2 * t + phase), 2 * amplitude * np.cos(2 * t + phase)
    return made_up(model, t, q, qd, **fields)


def seed() -> dtc.Run:
    """The paper's robot in the plane at 12 Pa."""
    model = dtc.build(presets.seed_four_disc(), chart="planar")
    return swinging(model, u=np.full((1, 121), 12.0))


def three_chambers() -> dtc.Run:
    """Six hexagons in space with three chambers side by side behind regulators."""
    disc = dtc.Disc.polygon(0.05, HEXAGON)
    robot = robot_of(
        discs=[disc] * 6,
        threads=[dtc.Thread(0.04)] * 5,
        springs=[
            dtc.Spring((i, i + 1), presets.rim(0.05, a), presets.rim(0.05, b), 60.0)
            for i in range(1, 6)
            for a, b in ((1.6, 1.6), (3.1, 3.1), (1.6, 3.1))
        ],
        chambers=[
            dtc.Chamber((1, 6), np.full(6, 0.0015), np.array([centre] * 6))
            for centre in ((0.02, 0.03, 0), (-0.02, 0.03, 0), (0, 0.07, 0))
        ],
        up=(0, -1, 0),
    )
    model = dtc.build(robot, actuator="regulator")
    run = swinging(model, 0.25)
    run.x[2 * model.n_q :] = 2e4 * np.sin(run.t) ** 2 * np.array([[1.0], [0.5], [0.2]])
    run.u[:, 60:] = 2e4
    return run


def hanging_chain() -> dtc.Run:
    """Sixteen discs without outline, springs or chambers, hanging along gravity."""
    disc = dtc.Disc(1.0, np.eye(3) * 1e-3)
    robot = robot_of(discs=[disc] * 16, threads=[dtc.Thread(0.1)] * 15, up=(0, 0, -1))
    return swinging(dtc.build(robot, chart="hinge"), 0.05)


def weightless_column() -> dtc.Run:
    """Two discs, one of them a solid, without gravity, standing still."""
    discs = [dtc.Disc.hoop(1.0, 0.1), dtc.Disc.solid(1.0, 0.05)]
    robot = robot_of(
        discs=discs,
        threads=[dtc.Thread(0.2)],
        chambers=[dtc.Chamber((1, 2))],
        up=(1, 0, 0),
        gravity=0.0,
    )
    model = dtc.build(robot)
    return swinging(model, 0.0, u=np.full((1, 121), -3.0))


def recentred() -> dtc.Run:
    """The paper's robot in space, its second segment re-centred half way, in smooth motion."""
    model = dtc.build(presets.seed_four_disc())
    run = swinging(model, 0.2)
    k, moment, n_q = 60, run.t[60], model.n_q
    x, theta, _ = recentre(model, run.x[:, k], model.theta0, segments=[1])
    since, rate = 2 * (run.t[k:] - moment), x[n_q + 5 : n_q + 10, np.newaxis]
    run.x[5:10, k:] = rate * np.sin(since) / 2
    run.x[n_q + 5 : n_q + 10, k:] = rate * np.cos(since)
    run.thetas[:, k:] = theta[:, np.newaxis]
    return replace(run, recentrings=((float(moment), (2,)),))


ALL = (seed, three_chambers, hanging_chain, weightless_column, recentred)
