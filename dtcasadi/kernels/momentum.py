"""Kernels of energy and momentum: canonical momenta and the gradient of the kinetic energy."""

import casadi as ca

from .articulated import rigid_inertia
from .axes import AXIS, cross, into, vector
from .kinematics import Segment, Turning, Words, from_disc, from_thread, to_disc, to_thread


def carry_velocity(words: Words, seg: Segment, rates: Turning, w: ca.SX, v: ca.SX) -> ca.SX:
    """Velocity of disc i+1's origin in frame i+1 from w and v of disc i in frame i, shape (3, 1)."""
    exit_velocity = to_thread(words, seg, v + cross(w, seg.exit_point))
    wt = rates.thread_rate
    return to_disc(words, seg, exit_velocity + seg.length * vector(wt[1], -wt[0], 0))


def body_momentum(
    mass: ca.SX, inertia: ca.SX, com: ca.SX, w: ca.SX, v: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Angular momentum about the origin, linear momentum (frame i) and kinetic energy of a disc."""
    J, H = rigid_inertia(mass, inertia, com)
    angular = ca.mtimes(J, w) + ca.mtimes(H, v)
    linear = mass * v + ca.mtimes(H.T, w)
    return angular, linear, (ca.dot(w, angular) + ca.dot(v, linear)) / 2


def gyration(w: ca.SX, v: ca.SX, angular: ca.SX, linear: ca.SX) -> tuple[ca.SX, ca.SX]:
    """V x* h: the wrench that turns a momentum with its disc."""
    return cross(w, angular) + cross(v, linear), cross(w, linear)


def momentum_step(
    words: Words,
    seg: Segment,
    rates: Turning,
    v: ca.SX,
    angular: ca.SX,
    linear: ca.SX,
    gyro_moment: ca.SX,
    gyro_force: ca.SX,
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    """Momenta p and dT/dq of a segment from the sums over the discs beyond it.

    With h the momentum and G = sum V x* h of those discs about a joint axis e,

        p = e . h,      dT/dq = e . (G - V x* h),      V the velocity of the axis.

    Args: v is the velocity of disc i+1's origin; all vectors in frame i+1, about its origin.

    Returns:
        p and dT/dq, shape (n_q, 1) each, then h and G about disc i's origin in frame i.
    """
    k = len(words.thread)
    p: list = [None] * words.n_q
    dT: list = [None] * words.n_q
    w, force = rates.rate, linear
    rest = gyro_moment - cross(v, linear)
    h = angular
    for m in reversed(range(len(words.disc))):
        axis, c, s = AXIS[words.disc[m]], seg.c[k + m], seg.s[k + m]
        p[k + m], dT[k + m] = h[axis], (rest - cross(w, h))[axis]
        h, rest, w = (into(words.disc[m], c, -s, x) for x in (h, rest, w))

    # At the thread's root: shift by l z, in the thread's frame.
    force = from_disc(words, seg, linear)
    G, Gf = from_disc(words, seg, gyro_moment), from_disc(words, seg, gyro_force)
    h = from_disc(words, seg, angular) + seg.length * vector(-force[1], force[0], 0)
    G = G + seg.length * vector(-Gf[1], Gf[0], 0)
    wt = rates.thread_rate
    root_velocity = from_disc(words, seg, v) - seg.length * vector(wt[1], -wt[0], 0)
    rest, turned, w = G - cross(root_velocity, force), h, wt
    for m in reversed(range(k)):
        axis, c, s = AXIS[words.thread[m]], seg.c[m], seg.s[m]
        p[m], dT[m] = turned[axis], (rest - cross(w, turned))[axis]
        turned, rest, w = (into(words.thread[m], c, -s, x) for x in (turned, rest, w))

    h, force, G, Gf = (from_thread(words, seg, x) for x in (h, force, G, Gf))
    none = ca.SX(0, 1)
    return (
        vector(*p) if p else none,
        vector(*dT) if dT else none,
        h + cross(seg.exit_point, force),
        force,
        G + cross(seg.exit_point, Gf),
        Gf,
    )
