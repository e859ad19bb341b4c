"""Robots known from the literature, and the paper's way of placing springs.

Those made from a tube or a rod can be cut into any number of discs. Their numbers stand in the
scenes of the same names (`dtcasadi/scenes/*.toml`), each with its source or marked as assumed.
"""

import math
from collections.abc import Sequence

import numpy as np

from .robot import Chamber, Damping, Disc, Robot, Spring, Thread


def rim(radius: float, angle: float) -> np.ndarray:
    r"""Point on the rim of a circular disc, in the disc's frame.

    .. math:: r (\sin\theta,\; 1 - \cos\theta,\; 0)

    The thread joins the disc at the origin and the centre lies at radius * y. The angle runs
    around the disc from the thread, counterclockwise as seen from +z (looking along -z, x to the
    right, y up): 90 degrees is (r, r, 0), 180 degrees (0, 2 r, 0), 270 degrees (-r, r, 0).
    Multiples of a right angle give exact zeros, so that a symmetric robot is exactly symmetric.

    Args:
        radius: r [m].
        angle: theta [rad].
    """
    sine, cosine = math.sin(angle), math.cos(angle)
    if min(abs(sine), abs(cosine)) < 1e-12:
        sine, cosine = float(round(sine)), float(round(cosine))
    return np.array([radius * sine, radius * (1.0 - cosine), 0.0])


def seed_four_disc(up: Sequence[float] = (0.0, -1.0, 0.0)) -> Robot:
    """The four-disc robot of the paper, section V.

    "Modeling the dynamics of soft robots by discs and threads".
    Unitless: hoops of radius 1 (masses 2, 2, 2, 4), threads of length 1, springs of constant 1 at
    90, 180 and 270 degrees, straight at rest, one chamber from end to end. Its damping constant
    b = 100 is given as c_a = c_b = c_w = 100, which is the same in the plane and holds in any
    chart; damping="coordinate" takes b = c_a.

    Args:
        up: direction against gravity in the root frame. The paper does not state it; with the
            thread on top (the default) the robot moves as its text says.
    """
    hoop, payload = Disc.hoop(2.0, 1.0), Disc.hoop(4.0, 1.0)
    points = [rim(1.0, math.radians(degrees)) for degrees in (90.0, 180.0, 270.0)]
    springs = [Spring((i, i + 1), p, p, stiffness=1.0) for i in (1, 2, 3) for p in points]
    return Robot(
        discs=(hoop, hoop, hoop, payload),
        threads=(Thread(1.0),) * 3,
        springs=tuple(springs),
        chambers=(Chamber((1, 4)),),
        damping=Damping(c_a=100.0, c_b=100.0, c_w=100.0),
        up=up,  # type: ignore[arg-type]
    )


def tentacle(n_discs: int = 4) -> Robot:
    """A silicone tentacle like "Squishy": a fabric strip winds round it and bends it in space.

    Dragon Skin 30; for pressures up to 20 kPa, rated for 30 kPa.
    """
    return _cut("tentacle", n_discs)


def grub(n_discs: int = 6) -> Robot:
    """A joint like BYU's "grub": two antagonistic pairs of bellows round an inextensible core.

    14.07 N m/rad, 2.73 N m s/rad, 5 kg over 0.23 m, 0.15 N m/kPa for each pair, at most 275 kPa.
    """
    return _cut("grub", n_discs)


def arm(n_discs: int = 9) -> Robot:
    """An arm like "Kaa": four chambers in series whose strips lie on top and aside in turn."""
    return _cut("arm", n_discs)


def _cut(name: str, n_discs: int) -> Robot:
    from .scene import load_scene  # which reads springs by `rim`

    return load_scene(name).rediscretised(n_discs).robot
