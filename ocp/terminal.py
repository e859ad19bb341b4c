"""The terminal cost: what the rest of time costs under the linear regulator at the target."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are

from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.errors import ControlError

from .slopes import inside
from .stages import Stages
from .target import Target


class TerminalCost:
    r"""P of :math:`|(x_N - x_s; u_{N-1} - u_s)|_P^2`, in the coordinates of the target.

    With z = (x; u_{-1}), v = u - u_s and the weights of the first interval, P solves the Riccati
    equation of the stage costs :math:`|R_x x|_W^2 + |u - u_{-1}|_{W_{change}}^2 +
    |u|_{W_{level}}^2` (Rawlings, Mayne, Diehl, Model Predictive Control, section 1.3.4).
    """

    def __init__(self, stages: Stages):
        """Build the Functions."""
        self._stages = stages
        discrete = stages.discrete
        step = twin(discrete.linearize, source=discrete.native("linearize"))
        self._step = Bound(step, matrices={"F_x", "F_u", "F_theta"})
        outputs = twin(stages.linearize, source=stages.native)
        self._outputs = Bound(outputs, matrices={"R_x", "G_x"})

    def __call__(self, target: Target, theta: np.ndarray) -> np.ndarray:
        """P at a target, shape (n_x + n_u, n_x + n_u); zero without a terminal cost.

        Raises:
            ControlError: the outputs do not see, or the commands do not reach, a mode that does
                not die out, so that no finite P exists.
        """
        stages = self._stages
        n = stages.n_x + stages.n_u
        terminal = stages.problem.terminal
        if terminal is None:
            return np.zeros((n, n))
        if not isinstance(terminal, str):
            return np.array(terminal, dtype=float)
        u = np.array(inside(stages, ca.DM(target.u))).ravel()
        found = self._step(target.x, u, theta)
        reference = np.zeros(len(stages.channels))
        R_x = self._outputs(target.x, theta, reference).R_x
        W = stages.weight[0]
        return regulator_cost(
            found.F_x, found.F_u, R_x.T @ (W[:, None] * R_x), stages.change[0], stages.level[0]
        )


def regulator_cost(
    F: np.ndarray, G: np.ndarray, Q: np.ndarray, change: np.ndarray, level: np.ndarray
) -> np.ndarray:
    """P of z = (x; u_{-1}) for x' = F x + G u and the cost x^T Q x and that of u.

    Args:
        F: shape (n_x, n_x).
        G: shape (n_x, n_u).
        Q: shape (n_x, n_x).
        change: weights of u - u_{-1}, shape (n_u,).
        level: weights of u, shape (n_u,).

    Raises:
        ControlError: no finite P exists.
    """
    n, m = G.shape
    # Commands in units in which their weights are one, or the equation is badly scaled.
    size = np.sqrt(np.maximum(change + level, 1e-300))
    scale = np.concatenate([np.ones(n), 1 / size])
    A = np.zeros((n + m, n + m))
    A[:n, :n] = F
    B = np.vstack([G / size, np.eye(m)])
    kept = change / size**2
    Q_z = np.zeros((n + m, n + m))
    Q_z[:n, :n] = (Q + Q.T) / 2
    Q_z[n:, n:] = np.diag(kept)
    S = np.vstack([np.zeros((n, m)), -np.diag(kept)])
    R = np.eye(m)
    try:
        P = solve_discrete_are(A, B, Q_z, R, s=S)
    except (np.linalg.LinAlgError, ValueError):
        raise ControlError(
            "terminal: expected a target with a regulator, got one where the equation of Riccati "
            "has no solution; a mode that does not die out is not seen or not reached"
        ) from None
    P = (P + P.T) / 2 / np.outer(scale, scale)
    return P
