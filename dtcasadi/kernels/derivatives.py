"""Mass matrix and derivatives of the inverse dynamics by recursion, in root-frame spatial vectors.

Motion vectors are (angular; linear at the root's origin). With J_c the axis of coordinate c, V and
A the spatial velocity and acceleration of the frame that carries it (A minus gravity),

    Pd_c = V x J_c,        Pdd_c = A x J_c + V x Pd_c,

and I, B, f the inertia, velocity matrix and net wrench of all discs beyond it,

    d tau_c / d q_d  = J_c^T (2B Pd_d + I Pdd_d),        d tau_c / d qd_d = J_c^T (2B J_d + 2I Pd_d)
    d tau_d / d q_c  = J_d^T (2B Pd_c + I Pdd_c + J_c x* f)     (d before c)

(S. Singh, R. P. Russo, P. M. Wensing, "Efficient analytical derivatives of rigid-body dynamics
using spatial vector algebra", IEEE RA-L 7(2), 2022, for single-axis joints). For rigid bodies 2B
acts on angular parts only: 2B = [-2 [w] S - 2 [h] [v]; -2 [P]] with S = tr(I_o)/2 - I_o and P the
linear momentum.
"""

from typing import NamedTuple

import casadi as ca

from .axes import cross, rotation, skew, unit_axis
from .kinematics import Segment, Words


class RootState(NamedTuple):
    """Pose, spatial velocity and spatial acceleration of a frame, in the root frame."""

    R: ca.SX
    r: ca.SX
    w: ca.SX
    v: ca.SX
    alpha: ca.SX
    a: ca.SX


class Columns(NamedTuple):
    """J, Pd and Pdd of a segment's coordinates, shape (6, n_q) each."""

    J: ca.SX
    Pd: ca.SX
    Pdd: ca.SX


class Composite(NamedTuple):
    """Sums over a disc and all beyond it, about the root's origin."""

    inertia: ca.SX  # (3, 3)
    h: ca.SX  # mass times centre of mass
    mass: ca.SX
    K: ca.SX  # upper half of 2B
    P: ca.SX  # linear momentum; the lower half of 2B is -2 [P]
    n: ca.SX
    f: ca.SX
    stiff: ca.SX  # (6, 6): stiffness of the world's forces, see `forces.world`


class Factors(NamedTuple):
    """What a segment contributes to every pair with it."""

    U: ca.SX  # I J
    W: ca.SX  # 2B^T J, angular part
    D: ca.SX  # stiff^T J
    Z: ca.SX  # 2B Pd + I Pdd + J x* f + stiff J
    Y: ca.SX  # 2B J + 2 I Pd


def motion_cross(w: ca.SX, v: ca.SX, e: ca.SX, m: ca.SX) -> tuple[ca.SX, ca.SX]:
    """(w; v) x (e; m) of spatial motion vectors."""
    return cross(w, e), cross(w, m) + cross(v, e)


def root_step(
    words: Words, seg: Segment, qd: ca.SX, qdd: ca.SX, state: RootState
) -> tuple[RootState, Columns]:
    """Carry the root-frame state over a segment, axis by axis, and give its columns."""
    R, r, w, v, alpha, a = state
    k = len(words.thread)
    point, R = r + ca.mtimes(R, seg.exit_point), ca.mtimes(R, seg.bend)
    columns: list[tuple[ca.SX, ca.SX, ca.SX]] = []
    for n, letter in enumerate(words.thread + words.disc):
        if n == k:
            point, R = point + seg.length * R[:, 2], ca.mtimes(R, seg.twist)
        e = ca.mtimes(R, unit_axis(letter))
        m = cross(point, e)
        pd = motion_cross(w, v, e, m)
        first, second = motion_cross(alpha, a, e, m), motion_cross(w, v, *pd)
        pdd = (first[0] + second[0], first[1] + second[1])
        columns.append(tuple(ca.vertcat(*pair) for pair in ((e, m), pd, pdd)))
        alpha, a = alpha + e * qdd[n] + pd[0] * qd[n], a + m * qdd[n] + pd[1] * qd[n]
        w, v = w + e * qd[n], v + m * qd[n]
        R = ca.mtimes(R, rotation(letter, seg.c[n], seg.s[n]))
    if k == words.n_q:
        point, R = point + seg.length * R[:, 2], ca.mtimes(R, seg.twist)
    stacked = [ca.horzcat(*c) for c in zip(*columns, strict=True)] or [ca.SX(6, 0)] * 3
    return RootState(R, point, w, v, alpha, a), Columns(*stacked)


def composite_step(
    mass: ca.SX,
    inertia: ca.SX,
    com: ca.SX,
    state: RootState,
    moment: ca.SX,
    force: ca.SX,
    stiff: ca.SX,
    outboard: Composite | tuple,
) -> Composite:
    """A disc's share of the composite sums, with what lies beyond it.

    Args: moment and force are the world's loads on the disc in its own frame, stiff the matrix of
        `dtcasadi.forces.world.world_jacobian`.
    """
    R, r, w, v, alpha, a = state
    h = mass * (r + ca.mtimes(R, com))
    own = ca.mtimes([R, inertia, R.T])
    I_o = own - ca.mtimes(skew(h), skew(h)) / mass
    S = ca.trace(I_o) / 2 * ca.SX.eye(3) - I_o
    angular, P = ca.mtimes(I_o, w) + cross(h, v), mass * v - cross(h, w)
    f_ext = ca.mtimes(R, force)
    n_ext = ca.mtimes(R, moment) + cross(r, f_ext)
    n = ca.mtimes(I_o, alpha) + cross(h, a) + cross(w, angular) + cross(v, P) - n_ext
    f = mass * a - cross(h, alpha) + cross(w, P) - f_ext
    K = -2 * ca.mtimes(skew(w), S) - 2 * ca.mtimes(skew(h), skew(v))
    mine = Composite(I_o, h, ca.SX(mass), K, P, n, f, stiff)
    if not outboard:
        return mine
    return Composite(*(x + y for x, y in zip(mine, outboard, strict=True)))


def factors(columns: Columns, body: Composite) -> Factors:
    """Products of the columns with the composite matrices."""
    J, Pd, Pdd = columns
    lower = -2 * skew(body.P)
    turned = ca.vertcat(*(ca.SX(m) for m in _force_cross(J, body.n, body.f)))
    Z = _double_b(body, Pd[:3, :]) + _times_inertia(body, Pdd) + turned
    return Factors(
        _times_inertia(body, J),
        ca.mtimes(body.K.T, J[:3, :]) + ca.mtimes(lower.T, J[3:, :]),
        ca.mtimes(body.stiff.T, J),
        Z + ca.mtimes(body.stiff, J),
        _double_b(body, J[:3, :]) + 2 * _times_inertia(body, Pd),
    )


def mass_block(J: ca.SX, U: ca.SX) -> ca.SX:
    """Block of M between an inner segment (J) and an outer one (U): J^T I J."""
    return ca.mtimes(J.T, U)


def lower_blocks(outer: Factors, inner: Columns) -> tuple[ca.SX, ca.SX]:
    """Rows of the outer segment, columns of the inner: d tau / d q and d tau / d qd."""
    dq = ca.mtimes(outer.W.T, inner.Pd[:3, :]) + ca.mtimes(outer.U.T, inner.Pdd)
    dq = dq + ca.mtimes(outer.D.T, inner.J)
    dqd = ca.mtimes(outer.W.T, inner.J[:3, :]) + 2 * ca.mtimes(outer.U.T, inner.Pd)
    return dq, dqd


def upper_blocks(inner: ca.SX, Z: ca.SX, Y: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Rows of the inner segment (its J), columns of the outer: d tau / d q and d tau / d qd."""
    return ca.mtimes(inner.T, Z), ca.mtimes(inner.T, Y)


def diagonal_blocks(own: Factors, columns: Columns) -> tuple[ca.SX, ca.SX]:
    """A segment with itself: lower form up to the diagonal, upper form above it."""
    low = lower_blocks(own, columns)
    high = upper_blocks(columns.J, own.Z, own.Y)
    n = columns.J.shape[1]
    blocks = []
    for below, above in zip(low, high, strict=True):
        rows = [[below[i, j] if j <= i else above[i, j] for j in range(n)] for i in range(n)]
        blocks.append(ca.blockcat(rows) if n else ca.SX(0, 0))
    return blocks[0], blocks[1]


def drag_blocks(row: ca.SX, column: ca.SX, column_Pd: ca.SX, drag: ca.SX) -> tuple[ca.SX, ca.SX]:
    """What drag on the discs beyond two segments adds to d tau / d q and d tau / d qd.

    J_row^T drag Pd and J_row^T drag J: a rate of the column's coordinates changes the velocity
    that the discs see of themselves by J, an angle by Pd (in the root frame).
    """
    gain = ca.mtimes(row.T, drag)
    return ca.mtimes(gain, column_Pd), ca.mtimes(gain, column)


def _times_inertia(body: Composite, X: ca.SX) -> ca.SX:
    """Spatial inertia times motion columns."""
    H = skew(body.h)
    angular = ca.mtimes(body.inertia, X[:3, :]) + ca.mtimes(H, X[3:, :])
    return ca.vertcat(angular, body.mass * X[3:, :] - ca.mtimes(H, X[:3, :]))


def _double_b(body: Composite, angular: ca.SX) -> ca.SX:
    """2B times motion columns, given their angular parts."""
    return ca.vertcat(ca.mtimes(body.K, angular), -2 * ca.mtimes(skew(body.P), angular))


def _force_cross(J: ca.SX, n: ca.SX, f: ca.SX) -> tuple[ca.SX, ca.SX]:
    """J x* (n; f) for each column: (e x n + m x f; e x f)."""
    N, F = skew(n), skew(f)
    return (
        -ca.mtimes(N, J[:3, :]) - ca.mtimes(F, J[3:, :]),
        -ca.mtimes(F, J[:3, :]),
    )
