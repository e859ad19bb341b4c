"""What may touch: candidates as tables, and `native/contact_detect.c` in NumPy."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..rim import outline_of, rim_points
from .shapes import SHAPES

if TYPE_CHECKING:
    from ..robot import Robot

PLATE = len(SHAPES)  # kind of a candidate that may touch another disc's plate
# Contacts looked at in one step: the nearest ones.
MOST = 16
_FAR = 1e30
# Out of reach: beyond this share of a radius, and four times what the fastest does in a step.
_NEAR = 1e-3
# Half the thickness of a plate, of its radius; the middle tells on which side a point is.
_HALF_THICKNESS = 0.01


@dataclass(frozen=True, eq=False)
class Candidates:
    """Rim points and what they may touch, C of them.

    Attributes:
        points: in their discs' frames, shape (C, 3) [m].
        table: disc from 0, kind, and number of the shape or disc from 0, shape (C, 3).
        friction: shape (C,).
        who: disc, obstacle (0: a disc's plate), rim point and the plate's disc (0: an obstacle),
            from 1, shape (C, 4).
        shapes: numbers of each obstacle, shape (n, 16).
        plates: centre x, y, z, radius and half the thickness of each disc, shape (N, 5) [m];
            negative where others are to be pulled to the sides on which the chain has them.
        restitution: Moreau's, of all contacts.
        n_discs: N.
    """

    points: np.ndarray
    table: np.ndarray
    friction: np.ndarray
    who: np.ndarray
    shapes: np.ndarray
    plates: np.ndarray
    restitution: float
    n_discs: int

    @property
    def size(self) -> int:
        """Contacts looked at in one step."""
        return min(MOST, len(self.points))


class Nearest(NamedTuple):
    """The nearest contacts: see `native/contact_detect.c`."""

    gap: np.ndarray
    jacobian: np.ndarray
    friction: np.ndarray
    who: np.ndarray
    frame: np.ndarray
    place: np.ndarray


def candidates_of(robot: "Robot") -> Candidates | None:
    """The candidates of a robot's rigid obstacles and plates; None where there are none."""
    rows: list[tuple] = []
    shapes = np.zeros((max(len(robot.obstacles), 1), 16))
    for k, obstacle in enumerate(robot.obstacles):
        shapes[k, : len(obstacle.geometry)] = obstacle.geometry
        if not obstacle.rigid:
            continue
        kind = SHAPES.index(type(obstacle.shape))
        for disc in obstacle.touching(robot.n_discs):
            points = rim_points(robot.discs[disc - 1], obstacle.rim_points)
            for n, point in enumerate(points, 1):
                rows.append((point, (disc - 1, kind, k), obstacle.friction, (disc, k + 1, n, 0)))
    plates = robot.plates
    if plates is not None:
        for a in range(robot.n_discs):
            points = rim_points(robot.discs[a], plates.rim_points)
            for b in range(robot.n_discs):
                for n, point in enumerate(points, 1):
                    if a != b:
                        rows.append((point, (a, PLATE, b), plates.friction, (a + 1, 0, n, b + 1)))
    if not rows:
        return None
    points, table, friction, who = (np.array(column) for column in zip(*rows, strict=True))
    return Candidates(
        points, table, friction, who, shapes, _plates(robot), _restitution(robot), robot.n_discs
    )


def _restitution(robot: "Robot") -> float:
    values = [o.restitution for o in robot.obstacles if o.rigid]
    return max([*values, 0.0 if robot.plates is None else robot.plates.restitution])


def _plates(robot: "Robot") -> np.ndarray:
    plates = []
    for disc in robot.discs:
        rim = outline_of(disc)
        centre = rim.mean(axis=0)
        radius = float(np.linalg.norm(rim - centre, axis=1).mean())
        plates.append([*centre, radius, _HALF_THICKNESS * radius])
    return np.array(plates)


def detect(
    found: Candidates,
    R: np.ndarray,
    r: np.ndarray,
    S: np.ndarray,
    v: np.ndarray,
    h: float,
) -> Nearest:
    """The nearest contacts within a step.

    Args:
        found: the candidates.
        R: rotations of the discs in the root frame, shape (N, 3, 3).
        r: their origins, shape (N, 3) [m].
        S: Jacobians of their angular and linear velocities along their own axes, (N, 6, n_q).
        v: rates, shape (n_q,) [rad/s].
        h: step [s].
    """
    rows = [_contact(found, c, R, r, S) for c in range(len(found.points))]
    gaps = np.array([row[0] for row in rows])
    speeds = np.array([row[2][0] @ v for row in rows])
    reach = gaps + h * speeds
    margin = _NEAR * found.plates[:, 3].max() + 4 * h * np.max(np.abs(speeds))
    m, n = found.size, len(v)
    result = Nearest(
        np.full(m, _FAR),
        np.zeros((3 * m, n)),
        np.zeros(m),
        np.zeros(m),
        np.zeros((m, 3, 3)),
        np.zeros((m, 3)),
    )
    for s, c in enumerate(np.argsort(reach, kind="stable")[:m]):
        if not reach[c] < margin:
            break
        gap, frame, jacobian, place = rows[c]
        result.gap[s], result.friction[s], result.who[s] = gap, found.friction[c], c + 1
        result.jacobian[3 * s : 3 * s + 3] = jacobian
        result.frame[s], result.place[s] = frame, place
    return result


def gaps_of(found: Candidates, R: np.ndarray, r: np.ndarray, who: np.ndarray) -> np.ndarray:
    """Gaps of the candidates `who` (from 1; 0: none), shape (m,), at other poses."""
    gaps = np.full(len(who), _FAR)
    for s in np.flatnonzero(who > 0):
        gaps[s] = _gap(found, int(who[s]) - 1, R, r)[0]
    return gaps


def _gap(
    found: Candidates, c: int, R: np.ndarray, r: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Gap, normal and place of one candidate."""
    a, kind, b = found.table[c]
    place = r[a] + R[a] @ found.points[c]
    gap, normal = _plate(found, a, b, place, R, r) if kind == PLATE else _shape(found, c, place)
    return gap, normal, place


def _contact(
    found: Candidates, c: int, R: np.ndarray, r: np.ndarray, S: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Gap, rows (normal, two tangents), Jacobian rows and place of one candidate."""
    a, kind, b = found.table[c]
    gap, normal, place = _gap(found, c, R, r)
    first = np.eye(3)[np.argmin(np.abs(normal))]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    frame = np.array([normal, first, np.cross(normal, first)])

    def jacobian(disc: int) -> np.ndarray:
        arm, axes = R[disc].T @ (place - r[disc]), frame @ R[disc]
        return np.cross(arm, axes) @ S[disc, :3] + axes @ S[disc, 3:]

    rows = jacobian(a) - jacobian(b) if kind == PLATE else jacobian(a)
    return gap, frame, rows, place


def _plate(
    found: Candidates, a: int, b: int, place: np.ndarray, R: np.ndarray, r: np.ndarray
) -> tuple[float, np.ndarray]:
    x, y, z, radius, half = found.plates[b]
    at = R[b].T @ (place - r[b])
    side = -1.0 if at[2] < z else 1.0
    if half < 0:
        side = 1.0 if a > b else -1.0
    inside = np.hypot(at[0] - x, at[1] - y) <= radius
    return side * (at[2] - z) - abs(half) if inside else _FAR, side * R[b][:, 2]


def _shape(found: Candidates, c: int, place: np.ndarray) -> tuple[float, np.ndarray]:
    """Signed distance and normal, as the shapes' `distance`."""
    _, kind, k = found.table[c]
    numbers = found.shapes[k]
    away = place - numbers[:3]
    if kind == 0:
        return float(numbers[3:6] @ away), numbers[3:6]
    if kind < 3:
        if kind == 2:
            axis = numbers[3:6] - numbers[:3]
            away = away - np.clip(away @ axis / (axis @ axis), 0, 1) * axis
        size = np.sqrt(away @ away + 1e-30)
        return float(size - numbers[3 if kind == 1 else 6]), away / size
    axes = numbers[7:16].reshape(3, 3)
    at = axes.T @ away
    beyond = np.abs(at) - numbers[3:6]
    outside = np.maximum(beyond, 0)
    size = float(np.linalg.norm(outside))
    signs = np.where(at < 0, -1.0, 1.0)
    if size > 0:
        return size - numbers[6], axes @ (signs * outside / size)
    face = int(np.argmax(beyond))
    return float(beyond[face] - numbers[6]), axes[:, face] * signs[face]
