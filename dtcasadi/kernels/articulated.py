"""Articulated-body kernels: forward dynamics in three sweeps (Featherstone 2008, chapter 7).

A disc's articulated inertia relates the wrench its thread must exert to its acceleration,

    moment = J alpha + H a + n,      force = H^T alpha + Mass a + f,

about the origin of frame i, in frame i; a contains minus gravity. Where the disc turns freely about
the thread's end and the thread about its root, all that passes inward is the thread's tension: a
rank-one inertia m_t w w^T, w = (s x t; t). The recursion then needs one scalar per thread.
"""

from typing import NamedTuple

import casadi as ca

from .axes import axes_at_end, cross, head, into, ldl, ldl_solve, skew, tail, vector
from .kinematics import (
    Segment,
    Turning,
    Words,
    direction,
    from_thread,
    relative_pose,
    to_disc,
    to_thread,
)


class Articulated(NamedTuple):
    """Articulated inertia and bias of a disc with all that hangs on it."""

    J: ca.SX
    H: ca.SX
    Mass: ca.SX
    n: ca.SX
    f: ca.SX


class Memory(NamedTuple):
    """What the inward sweep leaves for the outward sweep; the meaning is each joint's own."""

    a: ca.SX
    b: ca.SX
    c: ca.SX
    d: ca.SX


def rigid_inertia(mass: ca.SX, inertia: ca.SX, com: ca.SX) -> tuple[ca.SX, ca.SX]:
    """J about the frame's origin and the coupling H = m [c]x (moment = J alpha + H a)."""
    lever = skew(com)
    return inertia - mass * ca.mtimes(lever, lever), mass * lever


def body_bias(mass: ca.SX, inertia: ca.SX, com: ca.SX, w: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Gyroscopic moment w x J w and centripetal force m w x (w x c) of a disc, frame i."""
    J, _ = rigid_inertia(mass, inertia, com)
    return cross(w, ca.mtimes(J, w)), mass * cross(w, cross(w, com))


def inertial_wrench(
    mass: ca.SX, inertia: ca.SX, com: ca.SX, w: ca.SX, alpha: ca.SX, a: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Newton-Euler: moment about the origin and force that give a disc its motion, frame i."""
    J, H = rigid_inertia(mass, inertia, com)
    n, f = body_bias(mass, inertia, com, w)
    return n + ca.mtimes(J, alpha) + ca.mtimes(H, a), f + ca.mtimes(H.T, alpha) + mass * a


def exit_acceleration(seg: Segment, w: ca.SX, alpha: ca.SX, a: ca.SX) -> ca.SX:
    """Acceleration of the thread's exit point on disc i, in frame i."""
    return a + cross(alpha, seg.exit_point) + cross(w, cross(w, seg.exit_point))


def tip_acceleration(
    words: Words, seg: Segment, rates: Turning, thread_alpha: ca.SX, a_exit: ca.SX
) -> ca.SX:
    """Acceleration of disc i+1's origin, in frame i+1; thread_alpha and a_exit in T."""
    w = rates.thread_rate
    spin = vector(w[0] * w[2], w[1] * w[2], -(w[0] ** 2) - w[1] ** 2)  # w x (w x z)
    turn = vector(thread_alpha[1], -thread_alpha[0], 0)  # alpha x z
    return to_disc(words, seg, a_exit + seg.length * (turn + spin))


def accelerate(
    words: Words, seg: Segment, rates: Turning, qdd: ca.SX, w: ca.SX, alpha: ca.SX, a: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Outward Newton-Euler: alpha and a of disc i+1 in its frame from those of disc i."""
    k = len(words.thread)
    axes = ca.mtimes(axes_at_end(words.thread, seg.c, seg.s), head(qdd, k))
    thread_alpha = to_thread(words, seg, alpha) + rates.thread_bias + axes
    a_exit = to_thread(words, seg, exit_acceleration(seg, w, alpha, a))
    axes = ca.mtimes(axes_at_end(words.disc, tail(seg.c, k), tail(seg.s, k)), tail(qdd, k))
    alpha_next = to_disc(words, seg, thread_alpha) + rates.bias + axes
    return alpha_next, tip_acceleration(words, seg, rates, thread_alpha, a_exit)


def free_directions(planar: bool) -> tuple[list[int], list[int]]:
    """Indices of the angular and linear accelerations a free disc has: all, or the y-z plane's."""
    return ([0], [1, 2]) if planar else ([0, 1, 2], [0, 1, 2])


def inward_taut(
    words: Words,
    seg: Segment,
    rates: Turning,
    w: ca.SX,
    tau: ca.SX,
    body: Articulated,
    planar: bool,
) -> tuple[Articulated, Memory]:
    """Eliminate disc i+1 and its thread where only the thread's tension passes inward.

    With alpha = y - X a from the disc's moment balance and a = g lambda + h from its force balance,
    the thread's length fixes lambda = m_t t.a_exit + lambda_0, m_t = 1 / (z . g).
    """
    ang, lin = free_directions(planar)
    torque, lateral, reaction = _applied(words, seg, tau)
    J = ldl(body.J[ang, ang])
    X = ldl_solve(J, body.H[ang, lin])
    y = ldl_solve(J, (torque - body.n)[ang])
    mass = ldl(body.Mass[lin, lin] - ca.mtimes(body.H[ang, lin].T, X))
    z = to_disc(words, seg, vector(0, 0, 1))
    push = to_disc(words, seg, lateral) - body.f
    push = push[lin] - ca.mtimes(body.H[ang, lin].T, y)
    g = ldl_solve(mass, z[lin])
    h = ldl_solve(mass, push)
    m_t = 1 / ca.dot(z[lin], g)
    wt = rates.thread_rate
    tension = -m_t * (seg.length * (wt[0] ** 2 + wt[1] ** 2) + ca.dot(z[lin], h))

    t = direction(words, seg)
    arm = cross(seg.exit_point, t)
    offset = cross(w, cross(w, seg.exit_point))
    force = t * (tension + m_t * ca.dot(t, offset)) + from_thread(words, seg, lateral)
    moment = from_thread(words, seg, reaction) + cross(seg.exit_point, force)
    parent = Articulated(
        m_t * ca.mtimes(arm, arm.T),
        m_t * ca.mtimes(arm, t.T),
        m_t * ca.mtimes(t, t.T),
        moment,
        force,
    )
    return parent, Memory(ca.vertcat(m_t, tension), ca.horzcat(g, h), X, y)


def outward_taut(
    words: Words,
    seg: Segment,
    rates: Turning,
    w: ca.SX,
    tau: ca.SX,
    memory: Memory,
    alpha: ca.SX,
    a: ca.SX,
    planar: bool,
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Accelerations of disc i+1 and the segment's qdd, for `inward_taut`."""
    ang, lin = free_directions(planar)
    a_exit = to_thread(words, seg, exit_acceleration(seg, w, alpha, a))
    tension = memory.a[0] * a_exit[2] + memory.a[1]
    a_next, alpha_next = ca.SX.zeros(3), ca.SX.zeros(3)
    a_next[lin] = memory.b[:, 0] * tension + memory.b[:, 1]
    alpha_next[ang] = memory.d - ca.mtimes(memory.c, a_next[lin])

    # Lateral motion of the thread's end gives the thread's angles ...
    end = (from_disc_into_thread(words, seg, a_next) - a_exit) / seg.length
    wt = rates.thread_rate
    carried = to_thread(words, seg, alpha) + rates.thread_bias
    lateral = vector(wt[1] * wt[2] - end[1], end[0] - wt[0] * wt[2]) - carried[:2]
    k = len(words.thread)
    axes = axes_at_end(words.thread, seg.c, seg.s)
    qdd_thread = _solve_thread(words.thread, axes, lateral)
    thread_alpha = carried + ca.mtimes(axes, qdd_thread)

    # ... and the disc's angular acceleration relative to it the disc's angles.
    rest = alpha_next - to_disc(words, seg, thread_alpha) - rates.bias
    qdd_disc = _solve_disc(words.disc, tail(seg.c, k), tail(seg.s, k), rest)
    return ca.vertcat(qdd_thread, qdd_disc), alpha_next, a_next


def from_disc_into_thread(words: Words, seg: Segment, v: ca.SX) -> ca.SX:
    """B R_disc v: from frame i+1 to the thread's frame."""
    k = len(words.thread)
    for m in reversed(range(len(words.disc))):
        v = into(words.disc[m], seg.c[k + m], -seg.s[k + m], v)
    return ca.mtimes(seg.twist, v)


def _solve_thread(word: str, axes: ca.SX, lateral: ca.SX) -> ca.SX:
    """Thread angles from the x and y components (in T) of the thread's angular acceleration."""
    if len(word) == 1:
        return lateral[0] / axes[0, 0]
    det = axes[0, 0] * axes[1, 1] - axes[1, 0] * axes[0, 1]
    return vector(
        (axes[1, 1] * lateral[0] - axes[0, 1] * lateral[1]) / det,
        (axes[0, 0] * lateral[1] - axes[1, 0] * lateral[0]) / det,
    )


def _solve_disc(word: str, c: ca.SX, s: ca.SX, v: ca.SX) -> ca.SX:
    """Disc angles qdd with (axes at the word's end) qdd = v; three different letters, or x."""
    if len(word) == 1:
        return v["xyz".index(word)]
    i, j, k = ("xyz".index(letter) for letter in word)
    v = into(word[2], c[2], -s[2], v)
    first = axes_at_end(word[:2], c, s)[:, 0]
    q1 = v[i] / first[i]
    return vector(q1, v[j], v[k] - first[k] * q1)


def _applied(words: Words, seg: Segment, tau: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Wrenches equivalent to generalized forces on a segment.

    Returns the torque on disc i+1 (frame i+1), the lateral force on it (T, about its origin) and
    the moment that disc i passes to the thread (T, about the exit point).
    """
    k = len(words.thread)
    axes = axes_at_end(words.thread, seg.c, seg.s)
    torque = _disc_torque(words.disc, tail(seg.c, k), tail(seg.s, k), tail(tau, k))
    passed = from_disc_into_thread(words, seg, torque)
    rest = head(tau, k) - ca.mtimes(axes.T, passed)
    if k == 1:
        m = vector(rest[0] / axes[0, 0], 0, 0)
    else:
        det = axes[0, 0] * axes[1, 1] - axes[1, 0] * axes[0, 1]
        m = vector(
            (axes[1, 1] * rest[0] - axes[1, 0] * rest[1]) / det,
            (axes[0, 0] * rest[1] - axes[0, 1] * rest[0]) / det,
            0,
        )
    lateral = vector(m[1], -m[0], 0) / seg.length  # l z x lateral = m
    return torque, lateral, passed + m


def _disc_torque(word: str, c: ca.SX, s: ca.SX, tau: ca.SX) -> ca.SX:
    """The torque in frame i+1 with (axes at the word's end)^T torque = tau."""
    if len(word) == 1:
        torque = ca.SX.zeros(3)
        torque["xyz".index(word)] = tau[0]
        return torque
    i, j, k = ("xyz".index(letter) for letter in word)
    first = axes_at_end(word[:2], c, s)[:, 0]
    torque = ca.SX.zeros(3)
    torque[j], torque[k] = tau[1], tau[2]
    torque[i] = (tau[0] - first[k] * tau[2]) / first[i]
    return into(word[2], c[2], s[2], torque)


def subspace(words: Words, seg: Segment) -> ca.SX:
    """Motion subspace of the segment's joint (angular over linear, frame i+1), shape (6, n_q)."""
    k = len(words.thread)
    columns = []
    for axis in ca.horzsplit(axes_at_end(words.thread, seg.c, seg.s)):
        lever = seg.length * vector(axis[1], -axis[0], 0)  # axis x l z
        columns.append(ca.vertcat(to_disc(words, seg, axis), to_disc(words, seg, lever)))
    for axis in ca.horzsplit(axes_at_end(words.disc, tail(seg.c, k), tail(seg.s, k))):
        columns.append(ca.vertcat(axis, ca.SX.zeros(3)))
    return ca.horzcat(*columns) if columns else ca.SX(6, 0)


def inward_general(
    words: Words,
    seg: Segment,
    rates: Turning,
    w: ca.SX,
    tau: ca.SX,
    body: Articulated,
    planar: bool,
) -> tuple[Articulated, Memory]:
    """Eliminate a joint of any chart: I' = I - U D^-1 U^T with D = S^T I S by LDL^T."""
    S = subspace(words, seg)
    inertia = ca.blockcat([[body.J, body.H], [body.H.T, body.Mass]])
    bias = ca.vertcat(body.n, body.f)
    exit_bias = to_thread(words, seg, cross(w, cross(w, seg.exit_point)))
    turn = to_disc(words, seg, rates.thread_bias) + rates.bias
    shift = tip_acceleration(words, seg, rates, rates.thread_bias, exit_bias)
    drift = ca.vertcat(turn, shift)
    U = ca.mtimes(inertia, S)
    factor = ldl(ca.mtimes(S.T, U))
    gain = ldl_solve(factor, U.T)
    rest = ldl_solve(factor, tau - ca.mtimes(S.T, bias))
    passed = inertia - ca.mtimes(U, gain)
    wrench = bias + ca.mtimes(passed, drift) + ca.mtimes(U, rest)
    R, r = relative_pose(words, seg)
    J, H, mass = (
        ca.mtimes([R, passed[rows, columns], R.T])
        for rows, columns in (
            (slice(0, 3), slice(0, 3)),
            (slice(0, 3), slice(3, 6)),
            (slice(3, 6), slice(3, 6)),
        )
    )
    lever = skew(r)
    n, f = ca.mtimes(R, wrench[:3]), ca.mtimes(R, wrench[3:])
    shifted = H + ca.mtimes(lever, mass)
    parent = Articulated(
        J - ca.mtimes(H, lever) + ca.mtimes(lever, shifted.T),
        shifted,
        mass,
        n + cross(r, f),
        f,
    )
    return parent, Memory(gain, rest, drift, ca.SX(0, 1))


def outward_general(
    words: Words,
    seg: Segment,
    rates: Turning,
    w: ca.SX,
    tau: ca.SX,
    memory: Memory,
    alpha: ca.SX,
    a: ca.SX,
    planar: bool,
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Accelerations of disc i+1 and the segment's qdd, for `inward_general`."""
    R, r = relative_pose(words, seg)
    carried = ca.vertcat(ca.mtimes(R.T, alpha), ca.mtimes(R.T, a + cross(alpha, r)))
    carried = carried + memory.c
    qdd = memory.b - ca.mtimes(memory.a, carried)
    motion = carried + ca.mtimes(subspace(words, seg), qdd)
    return qdd, motion[:3], motion[3:]
