"""Random robots and states for the tests, from a seeded generator."""

from typing import Any

import numpy as np

from dtcasadi.robot import Chamber, Damping, Disc, Robot, Spring, Thread

from .chain import WORDS


def rotation(rng: np.random.Generator) -> np.ndarray:
    """A random rotation matrix, shape (3, 3)."""
    quaternion = rng.normal(size=4)
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def about_x(angle: float) -> np.ndarray:
    """Rotation by the angle [rad] about x, shape (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def tensor(rng: np.random.Generator, turn: np.ndarray) -> np.ndarray:
    """A full inertia tensor some body can have, shape (3, 3) [kg m^2].

    Principal moments (b + c, a + c, a + b) of positive second moments a, b, c meet the triangle
    inequality by construction.
    """
    second = rng.uniform(0.05, 0.6, 3)
    return turn @ np.diag(second.sum() - second) @ turn.T


def random_robot(
    rng: np.random.Generator, n: int, *, bare: bool = False, decades: float = 0.0
) -> Robot:
    """A robot of n discs with offset centres, full tensors, exit points, and rest rotations.

    Args:
        rng: seeded generator.
        n: number of discs.
        bare: no springs, damping or chambers (what Pinocchio and MuJoCo are compared on).
        decades: masses and tensors of each disc are scaled by 10^uniform(-decades, decades).
    """
    discs = []
    for _ in range(n):
        scale = 10 ** rng.uniform(-decades, decades)
        discs.append(
            Disc(
                mass=scale * rng.uniform(0.5, 2.0),
                inertia=scale * tensor(rng, rotation(rng)),
                centre_of_mass=0.5 * rng.normal(size=3),
                area=rng.uniform(0.2, 1.0),
                centroid=0.5 * rng.normal(size=3),
            )
        )
    threads = [
        Thread(rng.uniform(0.5, 1.5), 0.3 * rng.normal(size=3), rotation(rng), rotation(rng))
        for _ in range(n - 1)
    ]
    parts: dict[str, Any] = {} if bare else _forces(rng, n)
    return Robot(tuple(discs), tuple(threads), up=rng.normal(size=3), gravity=9.81, **parts)


def _forces(rng: np.random.Generator, n: int) -> dict:
    """Two springs a segment, damping of every kind, chambers over one, two and all segments."""
    springs = [
        Spring(
            discs=(i, i + 1),
            start=rng.normal(size=3),
            end=rng.normal(size=3),
            stiffness=rng.uniform(1.0, 20.0),
            rest_length=rest,
            damping=rng.uniform(0.1, 2.0),
        )
        for i in range(1, n)
        for rest in (None, rng.uniform(0.0, 1.0))
    ]
    # Each chamber's span is (first, last); the second presses on areas of its own.
    chambers = [Chamber((1, n))]
    if n > 2:
        own = rng.uniform(0.1, 0.5, 2)
        chambers += [Chamber((1, 2)), Chamber((2, 3), own, 0.5 * rng.normal(size=(2, 3)))]
    if n > 3:
        chambers += [Chamber((2, 4))]
    damping = [Damping(*rng.uniform(0.1, 3.0, 4)) for _ in range(n - 1)]
    return {"springs": springs, "chambers": chambers, "damping": damping}


def planar_robot(rng: np.random.Generator, n: int) -> Robot:
    """A robot symmetric about the y-z plane, with springs, dampers, a chamber and damping."""
    discs = [
        Disc(
            mass=rng.uniform(0.5, 2.0),
            inertia=tensor(rng, about_x(rng.uniform(-1, 1))),
            centre_of_mass=np.array([0.0, *rng.normal(size=2)]),
            area=rng.uniform(0.2, 1.0),
            centroid=np.array([0.0, *rng.normal(size=2)]),
        )
        for _ in range(n)
    ]
    threads = [
        Thread(
            rng.uniform(0.5, 1.5),
            np.array([0.0, *(0.3 * rng.normal(size=2))]),
            about_x(rng.uniform(-0.5, 0.5)),
            about_x(rng.uniform(-0.5, 0.5)),
        )
        for _ in range(n - 1)
    ]
    springs = []
    for i in range(1, n):
        start, end = rng.normal(size=3), rng.normal(size=3)
        stiffness, damper = rng.uniform(1.0, 20.0), rng.uniform(0.1, 2.0)
        mirror = np.array([-1.0, 1.0, 1.0])
        springs += [
            Spring((i, i + 1), start * side, end * side, stiffness, damping=damper)
            for side in (1.0, mirror)
        ]
    damping = tuple(Damping(*rng.uniform(0.1, 3.0, 4)) for _ in range(n - 1))
    up = np.array([0.0, *rng.normal(size=2)])
    parts = tuple(discs), tuple(threads), tuple(springs), (Chamber((1, n)),)
    return Robot(*parts, damping, up)


def coordinates(rng: np.random.Generator, charts: tuple[str, ...]) -> np.ndarray:
    """Random coordinates, shape (n_q,) [rad], away from each chart's singularity.

    Every angle within 1.2 rad keeps cos of the middle angles above 0.36. In the paper's chart
    |sin beta| and |cos psi| stay above 0.1 and the other three angles are arbitrary.
    """
    parts: list[np.ndarray] = []
    for chart in charts:
        if chart == "paper":
            alpha, gamma, phi = rng.uniform(-np.pi, np.pi, 3)
            beta = rng.choice([-1.0, 1.0]) * rng.uniform(0.11, np.pi - 0.11)
            parts.append(np.array([alpha, beta, gamma, rng.uniform(-1.46, 1.46), phi]))
        else:
            thread, disc = WORDS[chart]
            parts.append(rng.uniform(-1.2, 1.2, len(thread) + len(disc)))
    return np.concatenate(parts)
