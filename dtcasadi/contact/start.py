"""A start among rigid obstacles: freed where discs are inside, or refused with the reason."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SimulationError
from .detect import PLATE, Candidates, Nearest, candidates_of, detect
from .solver import solve_contacts
from .stepping import Rims, rims_of

if TYPE_CHECKING:
    from ..model import Model

_MOST = 60
_TURN = 0.1  # largest change of a coordinate in one correction [rad]
_FREE = 1e-9  # of the robot's length


def rims(model: "Model") -> Rims | None:
    """The model's rigid contacts, kept with it; None without any."""
    if candidates_of(model.robot) is None:
        return None
    return model.once("rims", lambda: rims_of(model.graphs[1]))


def rigid(model: "Model") -> bool:
    """Whether the model has rigid contacts."""
    return candidates_of(model.robot) is not None


def free_start(model: "Model", x: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, str]:
    """A state near x with no disc inside an obstacle or another disc, and what was done.

    Corrections are the least ones in the metric of M that open all gaps. Discs that pass through
    each other are pulled back to the sides on which the chain has them.

    Raises:
        SimulationError: none was found.
    """
    known = rims(model)
    if known is None:
        return x, ""
    if model.robot.constraints:
        raise SimulationError(
            "constraints: expected none together with rigid contact; give the obstacles a "
            "penetration"
        )
    q = x[: model.n_q].copy()
    limit = _FREE * model.robot.length
    found = _untangling(known, q, theta)
    for _ in range(_MOST):
        near = _nearest(known, found, q, theta)
        if np.min(near.gap, initial=0.0) >= -limit:
            break
        M = np.array(model.mass_matrix(q, theta))
        q = q + _opening(near, M)
        found = _untangling(known, q, theta)
    else:
        near = _nearest(known, found, q, theta)
        worst = int(np.argmin(near.gap))
        disc, obstacle, _, plate = known.candidates.who[int(near.who[worst]) - 1]
        inside = f"obstacle {obstacle}" if obstacle else f"disc {plate}"
        raise SimulationError(
            f"x0: expected a pose outside the obstacles, got disc {disc} {-near.gap[worst]:.3g} m "
            f"inside {inside}, and no way out was found"
        )
    moved = float(np.max(np.abs(q - x[: model.n_q]), initial=0.0))
    if moved == 0.0:
        return x, ""
    note = f"the start was moved out of contact by up to {moved:.3g} rad"
    return np.concatenate([q, x[model.n_q :]]), note


def _nearest(known: Rims, found: Candidates, q: np.ndarray, theta: np.ndarray) -> Nearest:
    R, r, S = (np.array(part) for part in known.places(q, theta))
    n = found.n_discs
    rotations = R.reshape(3, n, 3).transpose(1, 0, 2)
    return detect(found, rotations, r.T, S.reshape(n, 6, -1), np.zeros(len(q)), 0.0)


def _opening(near: Nearest, M: np.ndarray) -> np.ndarray:
    """The least change of q that opens the nearest gaps to first order."""
    rows = 3 * np.arange(len(near.gap))
    J = np.zeros_like(near.jacobian)
    J[rows] = near.jacobian[rows]
    Y = np.linalg.solve(M, J.T)
    b = np.zeros(len(J))
    b[rows] = np.minimum(near.gap, 1e20)
    p, _ = solve_contacts(J @ Y, b, 0 * near.friction, near.who)
    step = Y @ p
    largest = float(np.max(np.abs(step)))
    return step * min(1.0, _TURN / largest) if largest > 0 else step


def _untangling(known: Rims, q: np.ndarray, theta: np.ndarray) -> Candidates:
    """The candidates, with discs that others pass through told to pull them to their own side."""
    found = known.candidates
    R, r, _ = (np.array(part) for part in known.places(q, theta))
    plates = found.plates.copy()
    sides: dict[tuple[int, int], set[float]] = {}
    for point, (a, kind, b) in zip(found.points, found.table, strict=True):
        if kind != PLATE:
            continue
        place = r[:, a] + R[:, 3 * a : 3 * a + 3] @ point
        x, y, z = R[:, 3 * b : 3 * b + 3].T @ (place - r[:, b])
        if np.hypot(x - plates[b, 0], y - plates[b, 1]) <= plates[b, 3]:
            if abs(z - plates[b, 2]) > 1e-6 * plates[b, 3]:
                sides.setdefault((a, b), set()).add(np.sign(z - plates[b, 2]))
    for (_, b), signs in sides.items():
        if len(signs) > 1:
            plates[b, 4] = -found.plates[b, 4]
    return replace(found, plates=plates)
