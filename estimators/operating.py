"""Where a robot rests at the pressures of a grid: the operating points of a scheduled observer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dtcasadi import checks
from dtcasadi.actuation import settled
from dtcasadi.errors import EstimationError
from dtcasadi.model import Model
from dtcasadi.statics import equilibrium

from .base import refusal

_SPREAD = 1e-9


@dataclass(frozen=True, eq=False)
class OperatingPoints:
    r"""Equilibria along a line of commands, on one branch or on an inflating and a deflating one.

    Hysteresis makes the branches differ: at the same gauge pressure a chamber that grows feels
    `amplitude` less, one that shrinks as much more.

    Attributes:
        commands: command at each point, on a straight line, in order, shape (n, n_u).
        felt: command under which the model, which has no hysteresis, rests there, shape
            (branches, n, n_u): commands - amplitude, inflating; commands + amplitude, deflating.
        x: states, shape (branches, n, n_x).
    """

    commands: np.ndarray
    felt: np.ndarray
    x: np.ndarray

    def __post_init__(self) -> None:
        """Check shapes and order."""
        commands = np.asarray(self.commands, dtype=float)
        if commands.ndim != 2 or not len(commands) or not np.all(np.isfinite(commands)):
            raise refusal("points.commands", "a row for each point", f"shape {commands.shape}")
        x, felt = np.asarray(self.x, dtype=float), np.asarray(self.felt, dtype=float)
        if x.ndim != 3 or x.shape[:2] not in ((1, len(commands)), (2, len(commands))):
            raise refusal("points.x", "one or two branches with a row for each point", x.shape)
        if felt.shape != (*x.shape[:2], commands.shape[1]):
            raise refusal("points.felt", f"shape {(*x.shape[:2], commands.shape[1])}", felt.shape)
        for name, value in (("commands", commands), ("felt", felt), ("x", x)):
            object.__setattr__(self, name, value)
        if np.any(np.diff(self.places) <= 0):
            raise refusal("points.commands", "commands that go one way along a line", "others")
        line = commands[0] + self.places[:, np.newaxis] * (commands[-1] - commands[0])
        if np.any(np.abs(commands - line) > _SPREAD * np.maximum(1.0, np.abs(commands))):
            raise refusal("points.commands", "commands on a straight line", "others")

    @property
    def places(self) -> np.ndarray:
        """Where each point lies between the first, 0, and the last, 1, shape (n,)."""
        return np.array([self.place(command) for command in self.commands])

    @property
    def direction(self) -> np.ndarray:
        """What a command times it gives, less `offset`, is its place, shape (n_u,)."""
        way = self.commands[-1] - self.commands[0]
        length = float(way @ way)
        return way / length if length else np.zeros(len(way))

    def place(self, command: np.ndarray) -> float:
        """Place of a command's projection on the line."""
        return float(self.direction @ (np.asarray(command) - self.commands[0]))


def operating_points(
    model: Model,
    low: Sequence[float] | np.ndarray,
    high: Sequence[float] | np.ndarray,
    *,
    n: int = 9,
    amplitude: float = 0.0,
) -> OperatingPoints:
    """Equilibria of a model at n commands from low to high.

    Args:
        model: a model without hysteresis, whose command is the pressure.
        low: first pressures, shape (n_u,) [Pa].
        high: last pressures, shape (n_u,) [Pa].
        n: number of points.
        amplitude: of the chambers' hysteresis; zero: the branches are one [Pa].

    Raises:
        EstimationError: there is no stable equilibrium that the chart holds without re-centring.
    """
    ends = [
        checks.array(name, value, (model.n_u,), error=refusal)
        for name, value in (("low", low), ("high", high))
    ]
    if not np.any(ends[1] - ends[0]):
        n = 1
    share = np.linspace(0.0, 1.0, checks.index("n", n, 1, 1000, error=refusal))
    commands = ends[0] + share[:, np.newaxis] * (ends[1] - ends[0])
    shifts = [-amplitude, amplitude] if amplitude else [0.0]
    felt = np.array([commands + shift for shift in shifts])
    return OperatingPoints(commands, felt, np.array([_rests(model, row) for row in felt]))


def _rests(model: Model, pressures: np.ndarray) -> np.ndarray:
    """The state of rest at each row of pressures, shape (n, n_x)."""
    rows, guess = [], None
    for pressure in pressures:
        found = equilibrium(model, pressure, guess=guess)
        if not found.stable:
            found = equilibrium(model, pressure)
        where = f"operating point at {np.round(pressure, 6).tolist()} Pa"
        if not found.stable:
            raise EstimationError(f"{where}: expected a stable equilibrium, got: {found.message}")
        if not np.array_equal(found.theta, model.theta0):
            expected = "every segment within 45 degrees of its centre"
            raise EstimationError(f"{where}: expected {expected}, got one beyond")
        guess = found
        still = np.zeros(model.n_q)
        rows.append(np.concatenate([found.q, still, settled(model, found.q, pressure)]))
    return np.array(rows)
