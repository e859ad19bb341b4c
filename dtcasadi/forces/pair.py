"""What the forces between two neighbouring discs see, and what they give back."""

from typing import NamedTuple

import casadi as ca

from ..kernels.axes import cross
from ..kernels.kinematics import Segment, Turning, Words, direction, from_thread, relative_pose


class Pair(NamedTuple):
    """State of disc i+1 relative to disc i, all in frame i.

    R (3, 3) and r (3, 1): eq (1); t: the thread's direction; w: relative angular velocity;
    w_thread: the thread's, with a spin about t that no force may depend on.
    """

    R: ca.SX
    r: ca.SX
    t: ca.SX
    w: ca.SX
    w_thread: ca.SX
    length: ca.SX
    exit_point: ca.SX

    @property
    def t_rate(self) -> ca.SX:
        """Rate of the thread's direction seen from disc i."""
        return cross(self.w_thread, self.t)


class PairWrench(NamedTuple):
    """Wrenches on disc i and on disc i+1, each about its own origin, in frame i."""

    moment: ca.SX
    force: ca.SX
    moment_next: ca.SX
    force_next: ca.SX

    def __add__(self, other: "PairWrench") -> "PairWrench":  # type: ignore[override]
        """Sum of two forces on the same pair."""
        return PairWrench(*(a + b for a, b in zip(self, other, strict=True)))


def pair_state(words: Words, seg: Segment, relative: Turning) -> Pair:
    """The pair's state from the segment and its `turning` with w = 0."""
    R, r = relative_pose(words, seg)
    return Pair(
        R,
        r,
        direction(words, seg),
        ca.mtimes(R, relative.rate),
        from_thread(words, seg, relative.thread_rate),
        seg.length,
        seg.exit_point,
    )


def no_wrench() -> PairWrench:
    """The zero of the sum."""
    return PairWrench(*(ca.SX.zeros(3) for _ in range(4)))
