"""Who touched what in a run."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..model import Model
    from ..result import Run


@dataclass(frozen=True, eq=False)
class Contacts:
    """Every contact of a run at its times: one entry for a rim point that touches at one time.

    Attributes:
        t: when, shape (n,), rising [s].
        disc: number of the disc, shape (n,).
        obstacle: number of the obstacle from 1; 0: the plate of another disc; shape (n,).
        point: number of the rim point from 1, shape (n,).
        plate: number of the disc whose plate it touches; 0: an obstacle; shape (n,).
        place: where, in the root's frame, shape (n, 3) [m].
        force: on the disc, in the root's frame, shape (n, 3) [N].
        gap: signed distance, shape (n,) [m].
    """

    t: np.ndarray
    disc: np.ndarray
    obstacle: np.ndarray
    point: np.ndarray
    plate: np.ndarray
    place: np.ndarray
    force: np.ndarray
    gap: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        """How many, on one line."""
        if not len(self):
            return "Contacts(none)"
        discs = ", ".join(map(str, np.unique(self.disc)))
        largest = np.linalg.norm(self.force, axis=1).max()
        return f"Contacts({len(self)} of discs {discs}; forces up to {largest:.3g} N)"


def pairs(model: "Model") -> np.ndarray:
    """(disc, obstacle, rim point), from 1, of each entry of `model.contacts`, shape (n, 3)."""
    robot = model.robot
    found = [
        (disc, k, point)
        for k, obstacle in enumerate(robot.obstacles, 1)
        if not obstacle.rigid
        for disc in obstacle.touching(robot.n_discs)
        for point in range(1, obstacle.rim_points + 1)
    ]
    return np.array(found, dtype=int).reshape(-1, 3)


def contacts_of(run: "Run") -> Contacts:
    """The contacts at the times of a run."""
    compliant = _compliant(run)
    if run.touched is None:
        return compliant
    rigid = _at_times(run.touched.contacts, run.touched.t, run.t)
    if not len(compliant):
        return rigid
    both = [np.concatenate(pair) for pair in zip(_columns(compliant), _columns(rigid), strict=True)]
    order = np.argsort(both[0], kind="stable")
    return Contacts(*(column[order] for column in both))


def _columns(contacts: Contacts) -> list[np.ndarray]:
    return [getattr(contacts, each.name) for each in fields(contacts)]


def _at_times(contacts: Contacts, grid: np.ndarray, times: np.ndarray) -> Contacts:
    """The contacts of the steps that hold the times."""
    ends = grid[np.searchsorted(grid, times, side="left")]
    first = np.searchsorted(contacts.t, ends, side="left")
    counts = np.searchsorted(contacts.t, ends, side="right") - first
    places = [np.arange(a, a + n) for a, n in zip(first, counts, strict=True)]
    chosen = np.concatenate([np.zeros(0, dtype=int), *places])
    columns = [column[chosen] for column in _columns(contacts)]
    return Contacts(np.repeat(times, counts), *columns[1:])


def _compliant(run: "Run") -> Contacts:
    model = run.model
    who = pairs(model)
    n, steps = len(who), len(run.t)
    if n:
        found = model.compiled("contacts")
        values = [
            [np.array(part) for part in found(q, qd, theta)]
            for q, qd, theta in zip(run.q.T, run.qd.T, run.thetas.T, strict=True)
        ]
    else:
        values = [[np.zeros(0), np.zeros((3, 0)), np.zeros((3, 0))]] * steps
    gap, place, force = (np.array(part) for part in zip(*values, strict=True))
    at, which = np.nonzero(np.any(force != 0, axis=1))
    disc, obstacle, point = who[which].T
    return Contacts(
        t=run.t[at],
        disc=disc,
        obstacle=obstacle,
        point=point,
        plate=np.zeros_like(point),
        place=place[at, :, which],
        force=force[at, :, which],
        gap=gap.reshape(steps, n)[at, which],
    )
