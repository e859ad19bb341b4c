"""A nonlinear program made of a control problem, and what is handed to its solvers."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .stages import Stages


@dataclass(frozen=True)
class Structure:
    """Sizes of the stages k = 0 ... N: states, controls (0 at N), constraints within."""

    nx: tuple[int, ...]
    nu: tuple[int, ...]
    ng: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Nlp:
    """A nonlinear program, with the way back to states and commands.

    Attributes:
        stages: the problem.
        parts: symbols x (w), p and expressions f, g as `casadi.nlpsol` takes them.
        structure: sizes of the stages; None for single shooting, which has none.
        lbg: lower bounds of the constraints.
        ubg: upper bounds.
        bounds: Function u_now (n_u,) -> lbw, ubw.
        joined: Function x (n_x, N + 1), u (n_u, N), slack (n_g, N) -> w.
        split: Function w, p -> x (n_x, N + 1), u (n_u, N), slack (n_g, N).
        scale: of the cost in `f`.
        scheme: how it was made.
    """

    stages: Stages
    parts: dict[str, ca.MX]
    structure: Structure | None
    lbg: np.ndarray
    ubg: np.ndarray
    bounds: ca.Function
    joined: ca.Function
    split: ca.Function
    scale: float
    scheme: str


@dataclass(frozen=True, eq=False)
class Instance:
    """What changes from call to call.

    Attributes:
        x0: state now, shape (n_x,).
        u_now: command in force, shape (n_u,) [Pa].
        theta: parameters, shape (n_theta,).
        references: shape (N + 1, n_r).
        target_x: x_s of the terminal cost, shape (n_x,).
        target_u: u_s, shape (n_u,).
        P: terminal cost, shape (n_x + n_u, n_x + n_u).
    """

    x0: np.ndarray
    u_now: np.ndarray
    theta: np.ndarray
    references: np.ndarray
    target_x: np.ndarray
    target_u: np.ndarray
    P: np.ndarray

    @property
    def parameters(self) -> np.ndarray:
        """The program's parameters p."""
        rows = np.asarray(self.references).ravel()
        parts = (self.x0, self.u_now, self.theta, rows, self.target_x, self.target_u)
        return np.concatenate([*map(np.ravel, parts), np.asarray(self.P).ravel()])
