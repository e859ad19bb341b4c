"""Kernels of one segment's kinematics, from disc i (frame i) to disc i+1.

Every kernel takes the chart's words, c = cos(q), s = sin(q) of the segment's coordinates and the
rotations A (bend) and B (twist). T names the thread's frame: z along the thread, eq (1).
"""

from typing import NamedTuple

import casadi as ca

from .axes import (
    AXIS,
    cross,
    head,
    into,
    tail,
    unit_axis,
    vector,
    word_back,
    word_into,
    word_rotation,
)


class Words(NamedTuple):
    """A chart: the axis letters of the thread's and of the disc's rotations."""

    thread: str
    disc: str

    @property
    def n_q(self) -> int:
        """Coordinates per segment."""
        return len(self.thread) + len(self.disc)


class Segment(NamedTuple):
    """What every kernel of a segment needs: trigonometry and geometry."""

    c: ca.SX
    s: ca.SX
    bend: ca.SX
    twist: ca.SX
    length: ca.SX
    exit_point: ca.SX


def to_thread(words: Words, seg: Segment, v: ca.SX) -> ca.SX:
    """(A R_thread)^T v: from frame i to the thread's frame, shape (3, 1)."""
    return word_into(words.thread, seg.c, seg.s, ca.mtimes(seg.bend.T, v))


def from_thread(words: Words, seg: Segment, v: ca.SX) -> ca.SX:
    """A R_thread v: from the thread's frame to frame i, shape (3, 1)."""
    return ca.mtimes(seg.bend, word_back(words.thread, seg.c, seg.s, v))


def to_disc(words: Words, seg: Segment, v: ca.SX) -> ca.SX:
    """(B R_disc)^T v: from the thread's frame to frame i+1, shape (3, 1)."""
    k = len(words.thread)
    return word_into(words.disc, tail(seg.c, k), tail(seg.s, k), ca.mtimes(seg.twist.T, v))


def from_disc(words: Words, seg: Segment, v: ca.SX) -> ca.SX:
    """B R_disc v: from frame i+1 to the thread's frame, shape (3, 1)."""
    k = len(words.thread)
    return ca.mtimes(seg.twist, word_back(words.disc, tail(seg.c, k), tail(seg.s, k), v))


def direction(words: Words, seg: Segment) -> ca.SX:
    """The thread's direction t = A R_thread z in frame i, shape (3, 1)."""
    return from_thread(words, seg, ca.SX(ca.densify(unit_axis("z"))))


def relative_pose(words: Words, seg: Segment) -> tuple[ca.SX, ca.SX]:
    """Eq (1): R_rel (frame i+1 in frame i), shape (3, 3), and s + l t, shape (3, 1)."""
    k = len(words.thread)
    thread = ca.mtimes(seg.bend, word_rotation(words.thread, head(seg.c, k), head(seg.s, k)))
    disc = ca.mtimes(seg.twist, word_rotation(words.disc, tail(seg.c, k), tail(seg.s, k)))
    return ca.mtimes(thread, disc), seg.exit_point + seg.length * thread[:, 2]


def carry_pose(words: Words, seg: Segment, R: ca.SX, r: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Pose of disc i+1 in the root frame from that of disc i."""
    R_rel, r_rel = relative_pose(words, seg)
    return ca.mtimes(R, R_rel), r + ca.mtimes(R, r_rel)


class Turning(NamedTuple):
    """Angular velocities along a segment, and the accelerations they cause at zero qdd."""

    thread_rate: ca.SX  # w of the thread's frame, in T
    thread_bias: ca.SX  # its angular acceleration with alpha_i = 0, qdd = 0, in T
    rate: ca.SX  # w of disc i+1, in frame i+1
    bias: ca.SX  # its angular acceleration relative to alpha_T = 0, qdd = 0, in frame i+1


def turning(words: Words, seg: Segment, qd: ca.SX, w: ca.SX) -> Turning:
    """Eq (4) axis by axis: w' = R^T w + e qd, bias' = R^T bias + (R^T w) x e qd.

    With w = 0 the rates are those relative to disc i.
    """
    k = len(words.thread)
    zero = ca.SX.zeros(3)
    thread_rate, thread_bias = _turn(words.thread, seg.c, seg.s, qd, ca.mtimes(seg.bend.T, w), zero)
    rate, bias = _turn(
        words.disc,
        tail(seg.c, k),
        tail(seg.s, k),
        tail(qd, k),
        ca.mtimes(seg.twist.T, thread_rate),
        zero,
    )
    return Turning(thread_rate, thread_bias, rate, bias)


def _turn(word: str, c: ca.SX, s: ca.SX, qd: ca.SX, w: ca.SX, bias: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Carry angular velocity and bias through a word."""
    for n, letter in enumerate(word):
        w, bias = into(letter, c[n], s[n], w), into(letter, c[n], s[n], bias)
        bias = bias + cross(w, unit_axis(letter)) * qd[n]
        w = w + unit_axis(letter) * qd[n]
    return w, bias


def project(words: Words, seg: Segment, moment: ca.SX, force: ca.SX) -> ca.SX:
    """Generalized forces of a wrench on disc i+1 (about its origin, in frame i+1), shape (n_q, 1).

    Disc angles: e . moment. Thread angles: e . (moment + l z x force), in the thread's frame.
    """
    k = len(words.thread)
    entries: list = [None] * words.n_q
    n = moment
    for m in reversed(range(len(words.disc))):
        letter = words.disc[m]
        entries[k + m] = n[AXIS[letter]]
        n = into(letter, seg.c[k + m], -seg.s[k + m], n)
    n = ca.mtimes(seg.twist, n)
    f = from_disc(words, seg, force)
    n = n + seg.length * vector(-f[1], f[0], 0)
    for m in reversed(range(k)):
        letter = words.thread[m]
        entries[m] = n[AXIS[letter]]
        n = into(letter, seg.c[m], -seg.s[m], n)
    return vector(*entries) if entries else ca.SX(0, 1)


def to_parent(words: Words, seg: Segment, moment: ca.SX, force: ca.SX) -> tuple[ca.SX, ca.SX]:
    """A wrench on disc i+1 (about its origin, frame i+1) about frame i's origin, in frame i."""
    n, f = from_disc(words, seg, moment), from_disc(words, seg, force)
    n = n + seg.length * vector(-f[1], f[0], 0)
    n, f = from_thread(words, seg, n), from_thread(words, seg, f)
    return n + cross(seg.exit_point, f), f
