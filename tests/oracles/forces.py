"""Generalized forces by virtual power on plain kinematics, and robots that carry forces."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from dtcasadi.robot import Robot

from .cases import numbers
from .chain import chain, size, vee
from .robots import coordinates


class Motion:
    """Poses and velocities of every disc as expressions of q and qd, by differentiation."""

    def __init__(self, robot: Robot, charts: Sequence[str]):
        self.q, self.qd = (ca.SX.sym(name, size(charts)) for name in ("q", "qd"))
        self.poses = chain(robot, charts, self.q)

    def R(self, disc: int) -> ca.SX:
        """Rotation of a disc (from 1) in the root frame."""
        return self.poses.rotations[disc - 1]

    def place(self, disc: int, point: np.ndarray) -> ca.SX:
        """Position of a point of a disc in the root frame."""
        return self.poses.point(disc, point)

    def velocity(self, disc: int, point: np.ndarray) -> ca.SX:
        """Its velocity."""
        return ca.jtimes(self.place(disc, point), self.q, self.qd)

    def w(self, disc: int) -> ca.SX:
        """Angular velocity of a disc along the root's axes."""
        R = self.R(disc)
        return vee(ca.jtimes(R, self.q, self.qd) @ R.T)


Loads = Sequence[tuple[ca.SX, ca.SX]]  # (what pushes, the velocity it works on)


def by_power(
    robot: Robot, charts: Sequence[str], loads: Callable[[Motion], Loads]
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """(q, qd) -> Q with Q . qd' = sum of load . velocity(qd') for every qd'."""
    motion = Motion(robot, charts)
    rates = ca.SX.sym("rates", motion.qd.shape[0])
    power = ca.SX(0)
    for push, velocity in loads(motion):
        power += ca.dot(push, ca.substitute(velocity, motion.qd, rates))
    Q = ca.Function("Q", [motion.q, motion.qd], [ca.gradient(power, rates)])
    return lambda q, qd: numbers(Q, q, qd)


def slope(
    robot: Robot, charts: Sequence[str], energy: Callable[[Motion], ca.SX]
) -> Callable[[np.ndarray], np.ndarray]:
    """Q -> -dU/dq."""
    motion = Motion(robot, charts)
    Q = ca.Function("Q", [motion.q], [-ca.gradient(energy(motion), motion.q)])
    return lambda q: numbers(Q, q)


def with_forces(robot: Robot, *forces: Any) -> Robot:
    """The robot with these forces."""
    return replace(robot, forces=forces)


def state(
    rng: np.random.Generator, charts: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random q, qd and qdd away from the charts' singularities."""
    q = coordinates(rng, charts)
    qd, qdd = rng.normal(size=(2, len(q)))
    return q, qd, qdd
