"""Kernels of the forces by which the world acts on one disc; the reference is the root's frame."""

import casadi as ca

from ..kernels.axes import cross, skew
from .protocol import DiscState, Packed, Wrench
from .span import given_by


def world_wrench(R: ca.SX, r: ca.SX, w: ca.SX, v: ca.SX, *forces: Packed) -> tuple[ca.SX, ca.SX]:
    """Moment about the origin and force on a disc along its axes, from w and v along them."""
    outer, own = _sums(DiscState(R, r, own_rates=(w, v)), forces)
    moment = ca.mtimes(R.T, outer.moment) + own.moment
    return moment, ca.mtimes(R.T, outer.force) + own.force


def world_energy(R: ca.SX, r: ca.SX, *forces: Packed) -> ca.SX:
    """Energy of the forces on a disc [J]."""
    total = ca.SX(0)
    for force in forces:
        total = total + force.force().energy(DiscState(R, r))
    return total


def world_jacobian(R: ca.SX, r: ca.SX, w: ca.SX, v: ca.SX, *forces: Packed) -> tuple[ca.SX, ca.SX]:
    """Stiffness and damping of the wrench on a disc, in root-frame spatial vectors.

    For a small motion x = (angle; shift at the root's origin) of the disc and a change y of its
    spatial velocity as seen from it, d(wrench) = x x* wrench - stiff x - drag y: a wrench that
    follows the disc has neither.

    Returns:
        stiff and drag, shape (6, 6) each, on (moment about the root's origin; force).
    """
    x, y = ca.SX.sym("x", 6), ca.SX.sym("y", 6)
    turned = R + ca.mtimes(skew(x[:3]), R)
    placed = r + x[3:] + cross(x[:3], r)
    w_own = w + ca.mtimes(R.T, y[:3])
    v_own = v + ca.mtimes(R.T, y[3:] + cross(y[:3], r))
    outer, own = _sums(DiscState(turned, placed, own_rates=(w_own, v_own)), forces)
    # What is lost of the wrench when the disc is turned back.
    moment = cross(x[:3], outer.moment) - outer.moment - ca.mtimes(R, own.moment)
    force = cross(x[:3], outer.force) - outer.force - ca.mtimes(R, own.force)
    loss = ca.vertcat(moment + cross(r, force), force)
    blocks = [ca.jacobian(loss, x), ca.jacobian(loss, y)]
    stiff, drag = ca.substitute(blocks, [x, y], [ca.SX.zeros(6), ca.SX.zeros(6)])
    return ca.sparsify(stiff), ca.sparsify(drag)


def _sums(disc: DiscState, forces: tuple[Packed, ...]) -> tuple[Wrench, Wrench]:
    """Sums of the wrenches along the root's axes and along the disc's."""
    zero = ca.SX.zeros(3)
    outer, own = Wrench(zero, zero), Wrench(zero, zero, own=True)
    for force in forces:
        (wrench,) = given_by(force.force(), [disc])
        if wrench.own:
            own = own + wrench
        else:
            outer = outer + wrench
    return outer, own
