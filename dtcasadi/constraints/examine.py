"""Whether constraints can be met together, which of them repeat others, and a start on them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConstraintError

if TYPE_CHECKING:
    from ..model import Model

_MOST, _HALVINGS = 60, 30
_MET = 1e-10  # of the robot's length
# A direction that moves a constraint by less than this share of the largest does not count.
_RANK = 1e-8


@dataclass(frozen=True, eq=False)
class Examination:
    """Constraints at a pose.

    Attributes:
        q: the pose, on the constraints, shape (n_q,) [rad].
        rows: number of scalar constraints.
        rank: number of independent ones among them; where they are fewer, multipliers are those
            of least norm.
        message: one sentence.
    """

    q: np.ndarray
    rows: int
    rank: int
    message: str

    @property
    def redundant(self) -> int:
        """Rows that repeat others."""
        return self.rows - self.rank


def on_constraints(model: "Model", x: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, str]:
    """A state near x that meets the constraints, and how they are; ("", x) without any.

    Raises:
        ConstraintError: no such state was found.
    """
    if not model.robot.constraints:
        return x, ""
    n = model.n_q
    found = examine(model, x[:n], theta)
    _, A, _ = model.constraint_terms(found.q, x[n : 2 * n], theta)
    M = np.array(model.mass_matrix(found.q, theta))
    Y = np.linalg.solve(M, np.array(A).T)
    rates = np.array(A) @ x[n : 2 * n]
    rates = x[n : 2 * n] - Y @ np.linalg.lstsq(np.array(A) @ Y, rates, rcond=_RANK)[0]
    return np.concatenate([found.q, rates, x[2 * n :]]), found.message


def examine(
    model: "Model", q: np.ndarray | None = None, theta: np.ndarray | None = None
) -> Examination:
    """A pose near q that meets the constraints, by damped Gauss-Newton, and their rank there.

    Args:
        model: the model.
        q: where to look from, shape (n_q,) [rad]; default: the rest pose.
        theta: parameters; default: the robot's own.

    Raises:
        ConstraintError: no such pose was found, or the model has no constraints.
    """
    if not model.robot.constraints:
        raise ConstraintError("constraints: expected a robot that has some, got none")
    place = np.zeros(model.n_q) if q is None else np.array(q, dtype=float)
    theta = model.theta0 if theta is None else theta
    still = np.zeros(model.n_q)

    def at(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phi, A, _ = model.constraint_terms(pose, still, theta)
        return np.array(phi).ravel(), np.array(A)

    phi, A = at(place)
    for _ in range(_MOST):
        if np.max(np.abs(phi)) <= _MET * model.robot.length:
            break
        step = np.linalg.lstsq(A, -phi, rcond=_RANK)[0]
        step *= min(1.0, 0.5 / (np.max(np.abs(step)) or 1.0))
        for _ in range(_HALVINGS):
            phi_next, A_next = at(place + step)
            if np.linalg.norm(phi_next) < np.linalg.norm(phi):
                break
            step = step / 2
        else:
            break
        place, phi, A = place + step, phi_next, A_next
    worst = float(np.max(np.abs(phi)))
    if worst > _MET * model.robot.length:
        raise ConstraintError(
            "constraints: expected some that can be met together, got none nearer than "
            f"{worst:.3g} m off from the initial pose"
        )
    rank = int(np.linalg.matrix_rank(A, rtol=_RANK))
    rows = len(phi)
    message = f"constraints: {rows} rows of rank {rank}"
    if rank < rows:
        message += f", {rows - rank} redundant: multipliers of least norm"
    return Examination(place, rows, rank, message)
