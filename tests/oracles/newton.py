"""Newton's law of the last disc, every force on it written out: the tension of the last thread."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from dtcasadi.robot import Robot

from .chain import cartesian_accelerations, chain, size


def last_disc_tension(
    robot: Robot,
    charts: Sequence[str],
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    pressure: np.ndarray,
) -> float:
    """Tension of the last thread [N]: t . (weight + springs + pressure - m a) of the last disc.

    Torques on the thread (its damping, tau) act across it and drop out along t.
    """
    n = robot.n_discs
    disc = robot.discs[-1]
    pose = _poses(robot, charts)
    R, r, R_before, r_before, t = (v.full() for v in pose(q))
    w, v, w_before, v_before, _ = _rates(pose, q, qd)
    linear, angular = (a.full()[:, -1] for a in cartesian_accelerations(robot, charts)(q, qd, qdd))
    arm = R @ disc.centre_of_mass
    acceleration = linear + np.cross(angular, arm) + np.cross(w, np.cross(w, arm))
    force = -disc.mass * robot.gravity * robot.up - disc.mass * acceleration
    for spring in robot.springs:
        if spring.discs[1] == n:
            end, start = R @ spring.end, R_before @ spring.start
            gap = r[:, 0] + end - r_before[:, 0] - start
            rate = v + np.cross(w, end) - v_before - np.cross(w_before, start)
            reach = np.linalg.norm(gap)
            along = gap / reach
            assert spring.rest_length is not None  # filled in by Robot
            pull = spring.stiffness * (reach - spring.rest_length) + spring.damping * along @ rate
            force = force - pull * along
    for chamber, p in zip(robot.chambers, pressure, strict=True):
        if chamber.discs[1] == n:
            assert chamber.areas is not None
            force = force + p * chamber.areas[-1] * R[:, 2]
    return float(t[:, 0] @ force)


def _poses(robot: Robot, charts: Sequence[str]) -> ca.Function:
    """q -> R, r of the last disc, R, r of the one before it, direction of the thread between."""
    q = ca.SX.sym("q", size(charts))
    all_ = chain(robot, charts, q)
    last = [all_.rotations[-1], all_.origins[-1], all_.rotations[-2], all_.origins[-2]]
    return ca.Function("poses", [q], [*last, all_.directions[-1]])


def _rates(pose: ca.Function, q: np.ndarray, qd: np.ndarray) -> list[np.ndarray]:
    """Angular and linear velocities of what `_poses` returns, in the root frame."""
    values = pose(q)
    rates = pose.forward(1)(q, *values, qd)
    result = []
    for value, rate in zip(values, rates, strict=True):
        value, rate = value.full(), rate.full()
        skew = rate @ value.T
        turning = value.shape == (3, 3)
        result.append(np.array([skew[2, 1], skew[0, 2], skew[1, 0]]) if turning else rate[:, 0])
    return result
