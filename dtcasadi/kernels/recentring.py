"""Kernels of re-centring: the exact change of one `cardan` segment's coordinates to new A and B.

They run in CasADi's virtual machine when a chart is re-centred, never inside a step.
"""

from functools import cache

import casadi as ca

from .axes import word_rotation
from .kinematics import Segment, Words, relative_pose

WORDS = Words("xy", "xyz")
FRAMES = 18  # numbers per segment: A, then B, column-major


@cache
def absorbed() -> ca.Function:
    """(q, frames) -> frames_new with A' = A R_thread, B' = B R_disc, orthogonal to round-off."""
    q, frames = ca.SX.sym("q", 5), ca.SX.sym("frames", FRAMES)
    seg = _segment(q, frames)
    turned = (
        _orthogonal(seg.bend @ word_rotation(WORDS.thread, seg.c[:2], seg.s[:2])),
        _orthogonal(seg.twist @ word_rotation(WORDS.disc, seg.c[2:], seg.s[2:])),
    )
    frames_new = ca.vertcat(*(ca.vec(ca.densify(R)) for R in turned))
    names = ["q", "frames"], ["frames_new"]
    return ca.Function("absorbed", [q, frames], [frames_new], *names, {"cse": True})


@cache
def chart_change() -> ca.Function:
    """The exact change of coordinates of one segment between two pairs A, B.

        t' = A'^T A R_thread z,   a' = atan2(-t'_y, t'_z),   b' = asin t'_x
        S = B'^T R_thread(a', b')^T A'^T R_rel
        d' = atan2(-S_yz, S_zz),   e' = asin S_xz,   f' = atan2(-S_xy, S_xx)

    Returns:
        (q, qd, frames, frames_new) -> q_new, D = d q_new / dq, and cross = d(D qd)/dq; frames are
        A then B, column-major, shape (18,).
    """
    q, qd = ca.SX.sym("q", 5), ca.SX.sym("qd", 5)
    frames, frames_new = ca.SX.sym("frames", FRAMES), ca.SX.sym("frames_new", FRAMES)
    R_rel, t = relative_pose(WORDS, _segment(q, frames))
    A_new, B_new = _rotations(frames_new)
    t = A_new.T @ t
    thread = ca.vertcat(ca.atan2(-t[1], t[2]), ca.asin(t[0]))
    R_thread = word_rotation(WORDS.thread, ca.cos(thread), ca.sin(thread))
    S = B_new.T @ R_thread.T @ A_new.T @ R_rel
    disc = (ca.atan2(-S[1, 2], S[2, 2]), ca.asin(S[0, 2]), ca.atan2(-S[0, 1], S[0, 0]))
    q_new = ca.vertcat(thread, *disc)
    D = ca.jacobian(q_new, q)
    outputs = [ca.densify(value) for value in (q_new, D, ca.jacobian(D @ qd, q))]
    names = ["q", "qd", "frames", "frames_new"], ["q_new", "D", "cross"]
    return ca.Function("chart_change", [q, qd, frames, frames_new], outputs, *names, {"cse": True})


@cache
def recentred(limit: float) -> ca.Function:
    """Re-centring of one segment where its angles ask for it, as one graph.

    Args:
        limit: of the second thread angle and the middle disc angle [rad].

    Returns:
        (q, qd, frames) -> q_new, qd_new, frames_new, D, cross, off; off is 1 where an angle had
        left the limit and 0 elsewhere, where D is the identity, cross zero and the rest unchanged.
    """
    q, qd, frames = ca.SX.sym("q", 5), ca.SX.sym("qd", 5), ca.SX.sym("frames", FRAMES)
    off = ca.fmax(ca.fabs(q[1]), ca.fabs(q[3])) > limit
    frames_new = absorbed()(q, frames)
    _, D, cross = chart_change()(q, qd, frames, frames_new)
    values = {
        "q_new": ca.if_else(off, 0, q),
        "qd_new": ca.if_else(off, D @ qd, qd),
        "frames_new": ca.if_else(off, frames_new, frames),
        "D": ca.if_else(off, D, ca.SX.eye(5)),
        "cross": ca.if_else(off, cross, 0),
        "off": off,
    }
    outputs = [ca.densify(value) for value in values.values()]
    names = ["q", "qd", "frames"], list(values)
    return ca.Function("recentred", [q, qd, frames], outputs, *names, {"cse": True})


def _rotations(frames: ca.SX) -> tuple[ca.SX, ca.SX]:
    """A and B, shape (3, 3), from their 18 numbers."""
    return ca.reshape(frames[:9], 3, 3), ca.reshape(frames[9:], 3, 3)


def _segment(q: ca.SX, frames: ca.SX) -> Segment:
    """The segment about A and B; length and exit point have no part in a chart change."""
    return Segment(ca.cos(q), ca.sin(q), *_rotations(frames), ca.SX(1), ca.SX.zeros(3))


def _orthogonal(R: ca.SX) -> ca.SX:
    """R (3 - R^T R) / 2: one Newton step to the nearest rotation, round-off from round-off."""
    return R @ (3 * ca.SX.eye(3) - R.T @ R) / 2
