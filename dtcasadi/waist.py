"""A discrete model as filters and identification see it, so that a linear toy can stand in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from .measuring import Sensor


class Discrete(Protocol):
    """What estimators need of a discrete model; `dtcasadi.discrete.DiscreteModel` is one.

    `linearize` and `ode` are Functions of x, u, theta; `plain(name)` and `native(name)` are their
    forms for the virtual machine and for generated C.
    """

    @property
    def linearize(self) -> ca.Function:
        """Function x, u, theta -> x_next, F_x, F_u, F_theta."""

    @property
    def step(self) -> ca.Function:
        """Function x, u, theta -> x_next, status."""

    @property
    def linearize_checked(self) -> ca.Function:
        """The same with `status`, 0: good, behind."""

    @property
    def theta0(self) -> np.ndarray:
        """The parameters, shape (n_theta,)."""

    @property
    def theta_blocks(self) -> Mapping[str, slice]:
        """Name of each block of theta -> its slice."""

    @property
    def state_names(self) -> tuple[str, ...]:
        """One name per state."""

    @property
    def step_s(self) -> float:
        """Step [s]."""

    @property
    def sensors(self) -> Mapping[str, Sensor]:
        """What is measured, by name."""

    def native(self, name: str) -> ca.Function:
        """A Function with hand-written C kernels inside, for code generation only."""

    def together(self, names: Sequence[str]) -> Sensor:
        """Several sensors read at the same instant, as one."""

    def recentre(
        self, x: np.ndarray, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State and parameters about new centres, and the map T of a covariance."""
