"""The plain Lagrangian of the robot, differentiated by CasADi (Goldstein, Classical Mechanics).

Every thread also gets a stretch coordinate, held at zero: its generalized force is the tension.
"""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from dtcasadi.robot import Robot

from .chain import Chain, chain, size, vee


def lagrangian(robot: Robot, charts: Sequence[str]) -> ca.Function:
    """Every term of the equations of motion as one Function of (q, qd, qdd, pressure).

    Outputs: M, coriolis (full), coriolis_paper (Mdot qd), gravity, spring, damping (physical),
    damping_coordinate, inflation, T, V, p, dL_dq, J (Table I), R, r, tension (n_discs - 1,) and
    tau = M qdd + coriolis + gravity + spring + damping - inflation.
    """
    n_q, n = size(charts), robot.n_discs
    y, yd, ydd = (ca.SX.sym(name, n_q + n - 1) for name in ("y", "yd", "ydd"))
    pressure = ca.SX.sym("pressure", len(robot.chambers))
    poses = chain(robot, charts, y[:n_q], y[n_q:])
    spins = [vee(R.T @ ca.jtimes(R, y, yd)) for R in poses.rotations[1:]]
    kinetic = _kinetic(robot, poses, spins, y, yd)
    v_gravity, v_spring = _gravity(robot, poses), _springs(robot, poses)
    p = ca.gradient(kinetic, yd)
    mass = ca.jacobian(p, yd)
    mass_rate = ca.jtimes(p, y, yd)
    dt_dy = ca.gradient(kinetic, y)
    gravity, spring = ca.gradient(v_gravity, y), ca.gradient(v_spring, y)
    dampers = ca.gradient(_dampers(robot, poses, y, yd), yd)
    damping = ca.gradient(_dissipation(robot, poses, y, yd), yd) + dampers
    inflation = _inflation(robot, poses, y, yd, pressure)
    left = mass @ ydd + mass_rate - dt_dy + gravity + spring + damping - inflation
    coefficients = _coordinate_damping(robot, charts)
    free = slice(0, n_q)
    terms = {
        "M": mass[free, free],
        "coriolis": (mass_rate - dt_dy)[free],
        "coriolis_paper": mass_rate[free],
        "gravity": gravity[free],
        "spring": spring[free],
        "damping": damping[free],
        "damping_coordinate": coefficients * yd[free] + dampers[free],
        "inflation": inflation[free],
        "T": kinetic,
        "V": v_gravity + v_spring,
        "p": p[free],
        "dL_dq": (dt_dy - gravity - spring)[free],
        "J": ca.jacobian(ca.vertcat(*spins), yd[free]),
        "R": ca.horzcat(*poses.rotations),
        "r": ca.horzcat(*poses.origins),
        # d/dt dL/dsd - dL/ds - Q_s = -tension: the thread pulls its stretch closed.
        "tension": -left[n_q:],
        "tau": left[free],
    }
    return _unstretched(terms, (y, yd, ydd), pressure, n_q)


def _unstretched(terms: dict, states: tuple, pressure: ca.SX, n_q: int) -> ca.Function:
    """The Function of q, qd, qdd alone, every stretch held at zero."""
    names = ["q", "qd", "qdd"]
    inner = ca.Function("inner", [*states, pressure], list(terms.values()))
    free = [ca.SX.sym(name, n_q) for name in names]
    held = [ca.vertcat(v, ca.SX.zeros(states[0].numel() - n_q)) for v in free]
    outputs = inner(*held, pressure)
    return ca.Function(
        "lagrangian", [*free, pressure], outputs, [*names, "pressure"], list(terms), {"cse": True}
    )


def _kinetic(robot: Robot, poses: Chain, spins: list, y: ca.SX, yd: ca.SX) -> ca.SX:
    """T = sum over discs 2..N of m v_G^2 / 2 + w I w / 2; the root is fixed."""
    total = ca.SX(0)
    for number, (disc, w) in enumerate(zip(robot.discs[1:], spins, strict=True), 2):
        v = ca.jtimes(poses.point(number, disc.centre_of_mass), y, yd)
        total += disc.mass * ca.dot(v, v) / 2 + ca.dot(w, ca.SX(disc.inertia) @ w) / 2
    return total


def _gravity(robot: Robot, poses: Chain) -> ca.SX:
    """V = sum over discs 2..N of m g height, height 0 at the root's origin."""
    up = ca.SX(robot.up)
    return sum(
        disc.mass * robot.gravity * ca.dot(up, poses.point(number, disc.centre_of_mass))
        for number, disc in enumerate(robot.discs[1:], 2)
    )


def _lengths(robot: Robot, poses: Chain) -> list:
    """Length of each spring [m]."""
    return [
        ca.norm_2(poses.point(s.discs[1], s.end) - poses.point(s.discs[0], s.start))
        for s in robot.springs
    ]


def _springs(robot: Robot, poses: Chain) -> ca.SX:
    """V = sum of k (length - rest)^2 / 2."""
    total = ca.SX(0)
    for spring, length in zip(robot.springs, _lengths(robot, poses), strict=True):
        total += spring.stiffness * (length - spring.rest_length) ** 2 / 2
    return total


def _dampers(robot: Robot, poses: Chain, y: ca.SX, yd: ca.SX) -> ca.SX:
    """Rayleigh dissipation of the springs' dampers, sum of c (length rate)^2 / 2."""
    total = ca.SX(0)
    for spring, length in zip(robot.springs, _lengths(robot, poses), strict=True):
        total += spring.damping * ca.jtimes(length, y, yd) ** 2 / 2
    return total


def _dissipation(robot: Robot, poses: Chain, y: ca.SX, yd: ca.SX) -> ca.SX:
    """Rayleigh dissipation of the threads, from what each disc sees of the thread's direction.

    c_a |rate of t in disc i|^2 / 2 + c_b |rate of t in disc i+1|^2 / 2 + c_w (spin about t)^2 / 2
    + c_r |relative angular velocity|^2 / 2; the rates are plain derivatives of components.
    """
    total = ca.SX(0)
    assert isinstance(robot.damping, tuple)  # one for each segment, by Robot
    for i, damping in enumerate(robot.damping):
        before, after = poses.rotations[i], poses.rotations[i + 1]
        t = poses.directions[i]
        seen_before = ca.jtimes(before.T @ t, y, yd)
        seen_after = ca.jtimes(after.T @ t, y, yd)
        relative = before.T @ after
        w = vee(ca.jtimes(relative, y, yd) @ relative.T)
        spin = ca.dot(w, before.T @ t)
        total += damping.c_a * ca.sumsqr(seen_before) / 2 + damping.c_b * ca.sumsqr(seen_after) / 2
        total += damping.c_w * spin**2 / 2 + damping.c_r * ca.sumsqr(w) / 2
    return total


def _coordinate_damping(robot: Robot, charts: Sequence[str]) -> ca.DM:
    """The paper's b of each coordinate rate (section V): c_a of the coordinate's segment."""
    assert isinstance(robot.damping, tuple)
    each = [
        [damping.c_a] * size([chart]) for damping, chart in zip(robot.damping, charts, strict=True)
    ]
    return ca.DM(np.concatenate(each))


def _inflation(robot: Robot, poses: Chain, y: ca.SX, yd: ca.SX, pressure: ca.SX) -> ca.SX:
    """Virtual work of p A z at the centroid of each chamber's last disc and -p A z at its first's.

    z is the disc's own axis; the force acts at the area's centroid (section III-C).
    """
    power = ca.SX(0)
    for k, chamber in enumerate(robot.chambers):
        assert chamber.areas is not None and chamber.centroids is not None  # by Robot
        for number, at, sign in ((chamber.discs[1], -1, 1.0), (chamber.discs[0], 0, -1.0)):
            force = sign * pressure[k] * chamber.areas[at] * poses.rotations[number - 1][:, 2]
            velocity = ca.jtimes(poses.point(number, chamber.centroids[at]), y, yd)
            power += ca.dot(force, velocity)
    return ca.gradient(power, yd)


def inverse_dynamics_jacobian(oracle: ca.Function) -> Callable:
    """(q, qd, qdd, pressure) -> d tau/dq, d tau/dqd of the full equations, by forward mode.

    One direction at a time: the flattened derivative in all directions would be millions of
    operations.
    """
    forward = oracle.forward(1)
    tau = oracle.name_out().index("tau")

    def jacobian(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, pressure: np.ndarray) -> tuple:
        point = [q, qd, qdd, pressure]
        values = oracle(*point)
        columns: tuple[list, list] = ([], [])
        for which in (0, 1):
            for direction in np.eye(len(q)):
                seeds = [np.zeros(np.shape(v)) for v in point]
                seeds[which] = direction
                columns[which].append(np.array(forward(*point, *values, *seeds)[tau]).ravel())
        return np.array(columns[0]).T, np.array(columns[1]).T

    return jacobian
