"""The paper's validation (section IV): two discs, equations written by hand in the paper's chart.

Written out for q = (alpha, beta, gamma, psi, phi), no rest rotations, thread from the root's
origin. Newton-Euler resolves forces and moments in the root frame by vectors; Euler-Lagrange
differentiates T and V by hand as trigonometric components in the disc's frame. Plain NumPy.
"""

from typing import NamedTuple

import numpy as np

from dtcasadi.robot import Robot


class Terms(NamedTuple):
    """M (5, 5), gravity (5,) and spring forces (5,), on the left of the equations of motion."""

    M: np.ndarray
    gravity: np.ndarray
    spring: np.ndarray


def _about(axis: np.ndarray, angle: float, v: np.ndarray) -> np.ndarray:
    """Turn v about a unit axis (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    return c * v + s * np.cross(axis, v) + (1 - c) * np.dot(axis, v) * axis


def newton_euler(robot: Robot, q: np.ndarray) -> Terms:
    """Force and moment balances of the disc and of disc with thread, in the root frame.

    The massless thread is free to turn at the root, so the moment about the root's origin has no
    component along the thread's axes e_1, e_2, e_3; the disc is free to turn on the thread's end,
    so the moment about its own origin has none along e_4, e_5. Balancing the inertial wrench of
    a unit acceleration about each axis gives a column of M.
    """
    disc, length = robot.discs[1], robot.threads[0].length
    alpha, beta, gamma, psi, phi = q
    x, y, z = np.eye(3)
    # Axes in the order of turning, each carried by the turns before it.
    e1 = z
    e2 = _about(e1, alpha, x)
    t = _about(e2, beta, z)
    e4 = _about(t, gamma, e2)
    y_thread = np.cross(t, e4)
    e5 = _about(e4, psi, y_thread)
    ez = _about(e5, phi, _about(e4, psi, t))
    ex = np.cross(e5, ez)
    R = np.column_stack([ex, e5, ez])
    r = length * t
    axes = [e1, e2, t, e4, e5]
    pivots = [np.zeros(3)] * 3 + [r] * 2

    arm = R @ disc.centre_of_mass
    inertia = R @ disc.inertia @ R.T
    M = np.empty((5, 5))
    for k in range(5):
        force = disc.mass * np.cross(axes[k], r + arm - pivots[k])
        moment = inertia @ axes[k]
        for j in range(5):
            M[j, k] = axes[j] @ (np.cross(r + arm - pivots[j], force) + moment)

    weight = -disc.mass * robot.gravity * robot.up
    gravity = [-e @ np.cross(r + arm - o, weight) for e, o in zip(axes, pivots, strict=True)]
    spring = np.zeros(5)
    for s in robot.springs:
        point = r + R @ s.end
        reach = np.linalg.norm(point - s.start)
        assert s.rest_length is not None  # filled in by Robot
        pull = s.stiffness * (reach - s.rest_length) * (s.start - point) / reach
        spring -= [e @ np.cross(point - o, pull) for e, o in zip(axes, pivots, strict=True)]
    return Terms(M, np.array(gravity), spring)


def euler_lagrange(robot: Robot, q: np.ndarray) -> Terms:
    """T and V differentiated by hand; w_j = d omega/d qd_j and t_j = d t/d q_j in components.

    With R = Rz(alpha) Rx(beta) Rz(gamma) Rx(psi) Ry(phi) and a point c of the disc:
    T = m/2 |sum_j (l t_j + R (w_j x c)) qd_j|^2 + 1/2 (sum_j w_j qd_j) . I (sum_k w_k qd_k).
    """
    disc, length = robot.discs[1], robot.threads[0].length
    R, w = _orientation(q), _partial_spins(q)
    (ca, cb), (sa, sb) = np.cos(q[:2]), np.sin(q[:2])
    t = np.array([sa * sb, -ca * sb, cb])
    t_partial = np.zeros((5, 3))
    t_partial[0] = [ca * sb, sa * sb, 0.0]
    t_partial[1] = [sa * cb, -ca * cb, -sb]

    def partials(c: np.ndarray) -> np.ndarray:
        """d(position of point c)/dq_j, one row for each coordinate."""
        return length * t_partial + np.cross(w, c) @ R.T

    v = partials(disc.centre_of_mass)
    M = disc.mass * v @ v.T + w @ disc.inertia @ w.T
    gravity = disc.mass * robot.gravity * v @ robot.up
    spring = np.zeros(5)
    for s in robot.springs:
        d = length * t + R @ s.end - s.start
        reach = np.sqrt(d @ d)
        assert s.rest_length is not None
        spring += s.stiffness * (1 - s.rest_length / reach) * partials(s.end) @ d
    return Terms(M, gravity, spring)


def _partial_spins(q: np.ndarray) -> np.ndarray:
    """d omega/d qd_j in the disc's frame, row j; multiplied out by hand."""
    (cb, cg, cp, cf), (sb, sg, sp, sf) = np.cos(q[1:]), np.sin(q[1:])
    along = cp * cb - sp * cg * sb
    return np.array(
        [
            [cf * sg * sb - sf * along, cp * cg * sb + sp * cb, sf * sg * sb + cf * along],
            [cf * cg - sf * sg * sp, -sg * cp, sf * cg + cf * sg * sp],
            [-sf * cp, sp, cf * cp],
            [cf, 0.0, sf],
            [0.0, 1.0, 0.0],
        ]
    )


def _orientation(q: np.ndarray) -> np.ndarray:
    """R of the disc in the root frame, multiplied out by hand."""
    (ca, cb, cg, cp, cf), (sa, sb, sg, sp, sf) = np.cos(q), np.sin(q)
    # Columns of Rz(alpha) Rx(beta) Rz(gamma): x'', y'' and the thread.
    x2 = np.array([ca * cg - sa * cb * sg, sa * cg + ca * cb * sg, sb * sg])
    y2 = np.array([-ca * sg - sa * cb * cg, -sa * sg + ca * cb * cg, sb * cg])
    t = np.array([sa * sb, -ca * sb, cb])
    # Then Rx(psi) Ry(phi).
    y3, z3 = cp * y2 + sp * t, -sp * y2 + cp * t
    return np.column_stack([cf * x2 - sf * z3, y3, sf * x2 + cf * z3])
