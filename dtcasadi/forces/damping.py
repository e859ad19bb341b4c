"""Damping of a segment that depends on no chart (`physical`).

Dissipation 1/2 c_a |t-dot from disc i|^2 + 1/2 c_b |t-dot from disc i+1|^2 + 1/2 c_w (w . t)^2 +
1/2 c_r |w|^2 with w the relative angular velocity and t the thread's direction. A moment m on the
massless thread is carried to the discs by the couple m x t / l of forces at its ends.
"""

from typing import NamedTuple

import casadi as ca

from ..kernels.axes import cross
from .pair import Pair, PairWrench


class DampingNumbers(NamedTuple):
    """Coefficients of one segment [N m s/rad], see `dtcasadi.robot.Damping`."""

    c_a: ca.SX
    c_b: ca.SX
    c_w: ca.SX
    c_r: ca.SX


def damping_wrench(pair: Pair, numbers: DampingNumbers) -> PairWrench:
    """Wrenches of the dissipation function on the two discs."""
    near = -numbers.c_a * cross(pair.t, pair.t_rate)  # moment of disc i on the thread
    t_rate_next = cross(pair.w_thread - pair.w, pair.t)
    far = -numbers.c_b * cross(pair.t, t_rate_next)  # moment of disc i+1 on the thread
    couple = cross(near + far, pair.t) / pair.length
    torque = -numbers.c_w * ca.dot(pair.w, pair.t) * pair.t - numbers.c_r * pair.w
    return PairWrench(
        -near - torque - cross(pair.exit_point, couple), -couple, torque - far, couple
    )
