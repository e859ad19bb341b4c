"""Persistent external loads: a wrench on a named disc, fixed in the root frame."""

import casadi as ca


def dead_load(R: ca.SX, load: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Wrench in the disc's frame from load = [force; moment about the origin] in the root frame."""
    return ca.mtimes(R.T, load[3:]), ca.mtimes(R.T, load[:3])
