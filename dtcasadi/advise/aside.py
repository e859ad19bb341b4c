"""Which segments of a robot that moves in space could do with chart `planar`."""

from collections.abc import Iterator

import numpy as np

from ..robot import Robot
from .candidate import merged

# Of the segments, how many are planar: those that carry the tip aside least.
SHARES = (1.0, 0.75, 0.5, 0.25)


def flatter(aside: np.ndarray, segments: int) -> Iterator[str | tuple[str, ...]]:
    """Charts for a number of segments, the one with most planar segments first.

    Args:
        aside: what `out_of_plane` found, perhaps with another number of segments.
        segments: equally long ones.
    """
    order = np.argsort(aside, kind="stable")
    middles = (np.arange(segments) + 0.5) / segments
    where = np.minimum((middles * len(aside)).astype(int), len(aside) - 1)
    for count in dict.fromkeys(int(share * len(aside)) for share in SHARES):
        if count:
            flat = np.isin(where, order[:count])
            yield merged(tuple("planar" if each else "cardan" for each in flat))


def out_of_plane(robot: Robot, R: np.ndarray, r: np.ndarray) -> np.ndarray:
    """How far each segment carries the tip out of the plane in which it is at rest [m].

    Chart `planar` has the thread along A Rx z and the next frame at A Rx B Rx. What a segment has
    besides, as an angle, is taken times its distance from the tip.

    Args:
        robot: the robot.
        R: rotations of the discs, shape (instants, n_discs, 3, 3).
        r: origins of their frames, shape (instants, n_discs, 3).
    """
    found = []
    left = float(sum(thread.length for thread in robot.threads))
    for k, thread in enumerate(robot.threads):
        way = r[:, k + 1] - r[:, k] - R[:, k] @ thread.exit_point
        along = np.einsum("mji,mj->mi", R[:, k] @ thread.bend, way) / thread.length
        beta = np.arctan2(-along[:, 1], along[:, 2])
        relative = np.einsum("mji,mjk->mik", R[:, k], R[:, k + 1])
        stays = thread.bend @ _about_x(beta) @ thread.twist
        turned = np.einsum("mji,mj->mi", stays, relative[:, :, 0]) - [1.0, 0.0, 0.0]
        size = np.abs(along[:, 0]) + np.linalg.norm(turned, axis=1)
        found.append(left * float(size.max()))
        left -= thread.length
    return np.array(found)


def _about_x(angle: np.ndarray) -> np.ndarray:
    """Rx, shape (m, 3, 3)."""
    c, s, one, zero = np.cos(angle), np.sin(angle), np.ones_like(angle), np.zeros_like(angle)
    rows = [[one, zero, zero], [zero, c, -s], [zero, s, c]]
    return np.array(rows).transpose(2, 0, 1)
