"""Kernels of energy and momentum: canonical momenta and the gradient of the kinetic energy."""

import casadi as ca

from .articulated import rigid_inertia
from .axes import AXIS, cross, into, unit_axis, vector
from .kinematics import Segment, Turning, Words, from_disc, from_thread, to_disc, to_thread


def carry_velocity(words: Words, seg: Segment, rates: Turning, w: ca.SX, v: ca.SX) -> ca.SX:
    """Velocity of disc i+1's origin, in frame i+1, from w and v of disc i, shape (3, 1)."""
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


def momentum_step(
    words: Words,
    seg: Segment,
    qd: ca.SX,
    rates: Turning,
    v: ca.SX,
    angular: ca.SX,
    linear: ca.SX,
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Momenta p and dT/dq of a segment from the momentum h of all discs beyond it.

    About a joint axis e carried by a frame of velocity V (spatial force product x*),

        p = e . h,      dT/dq = -e . (V x* h).

    Args: v is the velocity of disc i+1's origin; all vectors in frame i+1, about its origin.

    Returns:
        p and dT/dq, shape (n_q, 1) each, then h about disc i's origin in frame i.
    """
    k = len(words.thread)
    p: list = [None] * words.n_q
    dT: list = [None] * words.n_q
    h, w, swept = angular, rates.rate, cross(v, linear)
    for m in reversed(range(len(words.disc))):
        axis, c, s = AXIS[words.disc[m]], seg.c[k + m], seg.s[k + m]
        p[k + m], dT[k + m] = h[axis], -(swept + cross(w, h))[axis]
        w = w - unit_axis(words.disc[m]) * qd[k + m]
        h, swept, w = (into(words.disc[m], c, -s, x) for x in (h, swept, w))

    # At the thread's root: shift by l z, in the thread's frame.
    force, w = from_disc(words, seg, linear), rates.thread_rate
    h = from_disc(words, seg, angular) + seg.length * vector(-force[1], force[0], 0)
    root_velocity = from_disc(words, seg, v) - seg.length * vector(w[1], -w[0], 0)
    turned, swept = h, cross(root_velocity, force)
    for m in reversed(range(k)):
        axis, c, s = AXIS[words.thread[m]], seg.c[m], seg.s[m]
        p[m], dT[m] = turned[axis], -(swept + cross(w, turned))[axis]
        w = w - unit_axis(words.thread[m]) * qd[m]
        turned, swept, w = (into(words.thread[m], c, -s, x) for x in (turned, swept, w))

    h, force = from_thread(words, seg, h), from_thread(words, seg, force)
    none = ca.SX(0, 1)
    return (
        vector(*p) if p else none,
        vector(*dT) if dT else none,
        h + cross(seg.exit_point, force),
        force,
    )
