"""Damping of a segment that depends on no chart (`physical`)."""

from dataclasses import dataclass

import casadi as ca

from ..kernels.axes import cross
from .protocol import DiscState, Force, Wrench


@dataclass(frozen=True, eq=False)
class SegmentDamping(Force):
    """Damping of one segment [N m s/rad], see `dtcasadi.robot.Damping`.

    Dissipation 1/2 c_a |t-dot from disc i|^2 + 1/2 c_b |t-dot from disc i+1|^2 + 1/2 c_w (w . t)^2
    + 1/2 c_r |w|^2 with w the relative angular velocity and t the thread's direction. A moment m on
    the massless thread is carried to the discs by the couple m x t / l of forces at its ends.
    """

    discs: tuple[int, int]
    c_a: ca.SX
    c_b: ca.SX
    c_w: ca.SX
    c_r: ca.SX

    def wrenches(self, disc: DiscState) -> Wrench:
        """Wrench on disc i+1."""
        assert disc.thread is not None
        t, near_rate, far_rate, length = disc.thread
        near = self.c_a * cross(t, near_rate)  # moment of the thread on disc i
        far = self.c_b * cross(t, far_rate)  # moment of the thread on disc i+1
        torque = self.c_w * ca.dot(disc.w, t) * t + self.c_r * disc.w
        return Wrench(far - torque, cross(t, near + far) / length)
