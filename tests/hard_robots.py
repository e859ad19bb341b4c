"""Robots and motions that are hard to integrate, in SI units, for `test_hard_scenes`."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import dtcasadi as dtc
from dtcasadi.presets import rim, seed_four_disc
from dtcasadi.robot import Chamber, Damping, Disc, Robot, Spring, Thread


class Hard(NamedTuple):
    """A model, how it starts, what drives it and for how long."""

    model: dtc.Model
    x0: np.ndarray
    pressure: float | dtc.Profile
    t_end: float


def tube_springs(
    n: int, radius: float, k: float, k_diagonal: float, damping: float, posts: int = 8
) -> tuple[Spring, ...]:
    """A tube's wall between each pair of discs: posts and, both ways, diagonals to the next post.

    The diagonals carry shear and twist, which posts alone leave floppy.

    Args:
        n: number of discs.
        radius: of the wall [m].
        k: stiffness of a post [N/m].
        k_diagonal: stiffness of a diagonal [N/m].
        damping: of every one of them [N s/m].
        posts: how many there are around the rim.
    """
    ends = [rim(radius, 2 * np.pi * i / posts) for i in range(posts)]
    springs = []
    for i in range(1, n):
        for a in range(posts):
            springs.append(Spring((i, i + 1), ends[a], ends[a], k, damping=damping))
            springs += [
                Spring((i, i + 1), ends[a], ends[(a + s) % posts], k_diagonal, damping=damping)
                for s in (1, -1)
            ]
    return tuple(springs)


def silicone() -> Hard:
    """30 mm of silicone tube, 16 discs of 2 g: 5e3 rad/s, and decay at up to 1.2e5 1/s.

    Wall 1.5 mm at radius 5 mm, E = 0.5 MPa: a post carries E 2 pi r t / (8 l) = 1.5 kN/m over a
    segment of 2 mm, with a material time (damping over stiffness) of 3 ms. Pressed with 20 kPa
    from a bent, twisted pose.
    """
    n, radius, length = 16, 5e-3, 2e-3
    springs = tube_springs(n, radius, 1500.0, 500.0, 5.0)
    robot = Robot(
        (Disc.hoop(2e-3, radius),) * n,
        (Thread(length),) * (n - 1),
        springs,
        (Chamber((1, n)),),
        Damping(c_a=1e-6, c_b=1e-6, c_w=1e-6),
    )
    model = dtc.build(robot)
    x0 = np.zeros(model.n_x)
    x0[0 : model.n_q : 5], x0[4 : model.n_q : 5] = 0.05, 0.02
    return Hard(model, x0, 2e4, 0.3)


def large() -> Hard:
    """3 m long, 0.6 m wide, six discs of 1 kg of fabric; 5 kPa blown in within half a second."""
    n, radius = 6, 0.3
    robot = Robot(
        (Disc.hoop(1.0, radius),) * n,
        (Thread(0.6),) * (n - 1),
        tube_springs(n, radius, 200.0, 100.0, 2.0, posts=6),
        (Chamber((1, n)),),
        Damping(c_a=5.0, c_b=5.0, c_w=5.0),
        up=np.array([0.0, -1.0, 0.2]),
    )
    model = dtc.build(robot)
    x0 = np.zeros(model.n_x)
    x0[: model.n_q] = 0.05 * np.sin(np.arange(model.n_q))
    blown = dtc.Profile(np.array([0.0, 0.5]), np.array([0.0, 5e3]), "linear")
    return Hard(model, x0, blown, 5.0)


def spinning() -> Hard:
    """The paper's robot, thread below, at 20: above 14 it has no equilibrium and spins for ever."""
    model = dtc.build(seed_four_disc(up=(0.0, 1.0, 0.0)))
    x0 = np.zeros(model.n_x)
    x0[[0, 5, 10]] = 0.1, 0.01, 0.01
    x0[: model.n_q] += 1e-3 * np.cos(np.arange(model.n_q))
    return Hard(model, x0, 20.0, 60.0)


def pre_curved() -> Hard:
    """A coil: rest bends of 30 degrees and twists of 10, springs without force there.

    Held straight and let go, it snaps back.
    """
    n, radius = 6, 0.05
    A = Rotation.from_rotvec(np.radians(30) * np.array([0.8, 0.6, 0.0]))
    B = Rotation.from_rotvec([0.0, 0.0, np.radians(10)])
    robot = Robot(
        (Disc.solid(0.05, radius),) * n,
        (Thread(0.1, bend=A.as_matrix(), twist=B.as_matrix()),) * (n - 1),
        tube_springs(n, radius, 400.0, 150.0, 0.5, posts=6),
        damping=Damping(c_a=2e-3, c_b=2e-3, c_w=2e-3),
        gravity=0.0,
    )
    model = dtc.build(robot)
    # A R_thread z = z, and the disc's angles undo the rest: A R_thread B R_disc = 1.
    x, y, z = A.inv().apply([0.0, 0.0, 1.0])
    thread = np.array([np.arctan2(-y, z), np.arcsin(x)])
    disc = (A * Rotation.from_euler("XY", thread) * B).inv().as_euler("XYZ")
    q = np.tile(np.concatenate([thread, disc]), n - 1)
    return Hard(model, np.concatenate([q, 0 * q]), 0.0, 3.0)


FOLD = 0.8


def folding() -> Hard:
    """A link that swings through the point where a pressed spring has length zero.

    The spring's end goes round a circle of the thread's length, and its start lies on it, at
    beta = 0.8: there the force of k rest_length = 50 N turns to its opposite, again and again.
    """
    disc = Disc(1.0, np.diag([0.05, 0.05, 0.1]), centre_of_mass=np.array([0.0, 0.0, 0.3]))
    start = np.array([0.0, -np.sin(FOLD), np.cos(FOLD)])
    spring = Spring((1, 2), start, np.zeros(3), 100.0, rest_length=0.5)
    robot = Robot((disc,) * 2, (Thread(1.0),), (spring,), gravity=0.0)
    return Hard(dtc.build(robot, chart="hinge"), np.array([0.0, 5.0]), 0.0, 5.0)


def many() -> Hard:
    """3 m of 64 plates on threads of 5 cm, let fall from straight and blown up, in the plane."""
    n, radius = 64, 0.1
    points = [rim(radius, angle) for angle in (np.pi / 2, np.pi, 3 * np.pi / 2)]
    springs = [Spring((i, i + 1), p, p, 500.0, damping=1.0) for i in range(1, n) for p in points]
    robot = Robot(
        (Disc.hoop(0.1, radius),) * n,
        (Thread(0.05),) * (n - 1),
        tuple(springs),
        (Chamber((1, n)),),
        Damping(c_a=0.02, c_b=0.02, c_w=0.02),
        up=np.array([0.0, -1.0, 0.0]),
    )
    model = dtc.build(robot, chart="planar")
    return Hard(model, 0.01 * np.sin(np.arange(model.n_x)), 200.0, 1.0)


HARD: dict[str, Callable[[], Hard]] = {
    "silicone": silicone,
    "large": large,
    "spinning": spinning,
    "pre_curved": pre_curved,
    "folding": folding,
    "many": many,
}
