"""A tube, its beam theory, and what the tests ask of robots made from it."""

import math
from typing import Any

import casadi as ca
import numpy as np
from oracles.cases import numbers

import dtcasadi as dtc
from dtcasadi.robot import Robot

L, R, T, E, NU, RHO = 0.3, 0.02, 0.002, 6e5, 0.45, 1080.0
G = E / (2 * (1 + NU))
# Thin wall (Gere and Timoshenko): the oracle's own numbers.
EA, EI, GA = 2 * math.pi * E * R * T, math.pi * E * R**3 * T, math.pi * G * R * T
GJ = 2 * math.pi * G * R**3 * T


SHAPES = {
    "straight": ((0.0, 0.0), 0.0),
    "bent": ((1.2, 0.0), 0.0),
    "bent across": ((0.0, -0.8), 0.0),
    "wound": ((0.0, 0.0), 2.0),
    "helix": ((0.7, 0.5), 1.5),
}


def tube(n_discs: int, **options: Any) -> Robot:
    options = {"gravity": 0.0} | options
    return Robot.from_tube(L, R, T, E, NU, RHO, n_discs, **options)


def hessian(robot: Robot, chart: str = "cardan") -> np.ndarray:
    """Stiffness of the springs in the coordinates at rest, shape (n_q, n_q)."""
    model = dtc.build(robot, chart=chart)
    q = ca.SX.sym("q", model.n_q)
    slope = ca.jacobian(model.spring(q, model.theta0), q)
    return numbers(ca.Function("slope", [q], [slope]), np.zeros(model.n_q))


def centres(robot: Robot, q: np.ndarray | None = None) -> np.ndarray:
    model = dtc.build(robot)
    rotation, origin = numbers(model.poses, np.zeros(model.n_q) if q is None else q, model.theta0)
    rotations = rotation.reshape(3, robot.n_discs, 3).transpose(1, 0, 2)
    return origin.T + np.array(
        [r @ d.centroid for r, d in zip(rotations, robot.discs, strict=True)]
    )
