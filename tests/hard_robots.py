"""Robots and motions that are hard to integrate, in SI units, for `test_hard_scenes`."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import dtcasadi as dtc
from dtcasadi.presets import rim
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


def shipped(name: str, t_end: float | None = None) -> Callable[[], Hard]:
    """A scene of the stability map, run for a while."""

    def load() -> Hard:
        scene = dtc.load_scene(f"stability/{name}")
        model = scene.build()
        return Hard(model, scene.x0(model), scene.pressure, t_end or scene.t_end)

    return load


HARD: dict[str, Callable[[], Hard]] = {
    "small_stiff": shipped("small_stiff", 0.3),
    "large": large,
    "endless_spin": shipped("endless_spin"),
    "pre_curved": shipped("pre_curved"),
    "folding": folding,
    "many_discs": shipped("many_discs"),
}
