"""Plain kinematics of a Robot, segment by segment, in CasADi SX; numbers from the Robot only."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from dtcasadi.robot import Robot

# chart -> (axis letters of the thread, axis letters of the disc)
WORDS = {
    "cardan": ("xy", "xyz"),
    "paper": ("zx", "zxy"),
    "planar": ("x", "x"),
    "hinge": ("x", ""),
    "ball": ("", "xyz"),
    "rigid": ("", ""),
}
AXIS = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}


def spread(chart: str | Sequence[str], n: int) -> tuple[str, ...]:
    """One chart name for each of the n - 1 segments."""
    charts = (chart,) * (n - 1) if isinstance(chart, str) else tuple(chart)
    assert len(charts) == n - 1
    return charts


def size(charts: Sequence[str]) -> int:
    """Number of coordinates n_q."""
    return sum(len(letters) for chart in charts for letters in WORDS[chart])


def cross_matrix(v: ca.SX) -> ca.SX:
    """[v]x, so that [v]x w = v x w."""
    return ca.vertcat(
        ca.horzcat(0, -v[2], v[1]), ca.horzcat(v[2], 0, -v[0]), ca.horzcat(-v[1], v[0], 0)
    )


def turn(letters: str, angles: ca.SX) -> ca.SX:
    """Product of rotations about the lettered axes, each by Rodrigues' formula."""
    result = ca.SX.eye(3)
    for k, letter in enumerate(letters):
        s = cross_matrix(ca.SX(AXIS[letter]))
        result = result @ (ca.SX.eye(3) + ca.sin(angles[k]) * s + (1 - ca.cos(angles[k])) * s @ s)
    return result


@dataclass(frozen=True)
class Chain:
    """Poses in the root frame, disc 1 first; entry i of `threads` belongs to segment i + 1.

    Attributes:
        rotations: R of each disc, (3, 3).
        origins: r of each disc's frame, (3, 1) [m].
        directions: unit vector t of each thread, (3, 1).
        thread_rotations: rotation of the frame that the thread's angles have turned, (3, 3).
    """

    rotations: list
    origins: list
    directions: list
    thread_rotations: list

    def point(self, disc: int, local: np.ndarray) -> ca.SX:
        """A point fixed to a disc (1 is the root), in the root frame [m]."""
        return self.origins[disc - 1] + self.rotations[disc - 1] @ ca.SX(local)


def chain(robot: Robot, charts: Sequence[str], q: ca.SX, stretch: ca.SX | None = None) -> Chain:
    """R_rel = A R_thread B R_disc and r_{i+1} = r_i + R_i (s_i + l_i t_i), from disc 1.

    Args:
        robot: the numbers.
        charts: one for each segment.
        q: coordinates, shape (n_q,) [rad].
        stretch: added to each thread's length, shape (n_discs - 1,) [m]; its generalized forces
            are the thread tensions.
    """
    rotations, origins = [ca.SX.eye(3)], [ca.SX.zeros(3)]
    directions, thread_rotations = [], []
    at = 0
    for i, (thread, chart) in enumerate(zip(robot.threads, charts, strict=True)):
        first, second = WORDS[chart]
        middle, end = at + len(first), at + len(first) + len(second)
        carried = rotations[-1] @ ca.SX(thread.bend) @ turn(first, q[at:middle])
        length = thread.length if stretch is None else thread.length + stretch[i]
        t = carried[:, 2]
        origins.append(origins[-1] + rotations[-1] @ ca.SX(thread.exit_point) + length * t)
        rotations.append(carried @ ca.SX(thread.twist) @ turn(second, q[middle:end]))
        directions.append(t)
        thread_rotations.append(carried)
        at = end
    return Chain(rotations, origins, directions, thread_rotations)


def cartesian_velocities(robot: Robot, charts: Sequence[str]) -> ca.Function:
    """(q, qd) -> linear (3, N) and angular (3, N) velocities in the root frame, by AD."""
    q, qd = (ca.SX.sym(name, size(charts)) for name in ("q", "qd"))
    poses = chain(robot, charts, q)
    linear = ca.jtimes(ca.horzcat(*poses.origins), q, qd)
    angular = ca.horzcat(*(vee(ca.jtimes(R, q, qd) @ R.T) for R in poses.rotations))
    return ca.Function("velocities", [q, qd], [linear, angular])


def cartesian_accelerations(robot: Robot, charts: Sequence[str]) -> ca.Function:
    """(q, qd, qdd) -> linear (3, N) and angular (3, N) accelerations in the root frame, by AD."""
    q, qd, qdd = (ca.SX.sym(name, size(charts)) for name in ("q", "qd", "qdd"))
    velocities = cartesian_velocities(robot, charts)(q, qd)
    outputs = [ca.jtimes(v, q, qd) + ca.jtimes(v, qd, qdd) for v in velocities]
    return ca.Function("accelerations", [q, qd, qdd], outputs)


def vee(s: ca.SX) -> ca.SX:
    """The vector of a skew matrix [v]x."""
    return ca.vertcat(s[2, 1], s[0, 2], s[1, 0])
