"""Robots, oracles and models shared by the tests, each built once in a session."""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np

import dtcasadi as dtc
from dtcasadi.robot import Robot

from . import lagrangian, robots

Charts = tuple[str, ...]


@cache
def robot(n: int, *, bare: bool = False) -> Robot:
    """The random robot of n discs that the tests share."""
    return robots.random_robot(np.random.default_rng(n), n, bare=bare)


@cache
def oracle(n: int, charts: Charts) -> ca.Function:
    """The Lagrangian of that robot."""
    return lagrangian.lagrangian(robot(n), charts)


def model(n: int, charts: Charts, *, bare: bool = False, **options: Any) -> "dtc.Model":
    """The model of that robot with build options; the usual ones need not be told apart."""
    usual = {"velocity_terms": "full", "damping": "physical"}
    unusual = {k: v for k, v in options.items() if usual.get(k) != v}
    return _model(n, charts, bare, **unusual)


@cache
def _model(n: int, charts: Charts, bare: bool, **options: Any) -> "dtc.Model":
    return dtc.build(robot(n, bare=bare), chart=list(charts), **options)


def numbers(function: ca.Function, *arguments: object) -> Any:
    """The Function's outputs as arrays, a column as a vector; alone or as a tuple."""
    outputs = function.call([ca.DM(a) for a in arguments])
    arrays = tuple(o.full()[:, 0] if o.is_column() else o.full() for o in outputs)
    return arrays[0] if len(arrays) == 1 else arrays


def evaluate(function: ca.Function, *arguments: object) -> dict[str, np.ndarray]:
    """The Function's outputs by name."""
    return dict(zip(function.name_out(), numbers(function, *arguments), strict=True))


def error(value: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference relative to the largest entry expected (absolute when all are 0)."""
    value, expected = np.squeeze(value), np.squeeze(expected)
    assert value.shape == expected.shape, f"shape {value.shape}, expected {expected.shape}"
    scale = np.max(np.abs(expected), initial=0.0) or 1.0
    return float(np.max(np.abs(value - expected), initial=0.0) / scale)
