"""Chamber pressure as wrenches on discs, III-C."""

import casadi as ca

from ..kernels.axes import cross, vector


def last_disc(pressure: ca.SX, area: ca.SX, centroid: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Wrench pressure * area * z at the area's centroid, in the disc's frame.

    A chamber's last disc gets it with the chamber's gauge pressure [Pa], its first disc with the
    negative one; between them the pressure on a disc's two faces cancels (III-C). A follower load.

    Returns:
        moment about the frame's origin and force, shape (3, 1) each.
    """
    force = vector(0, 0, pressure * area)
    return cross(centroid, force), force
