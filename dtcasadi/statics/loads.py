"""Loads that change along one parameter."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import checks
from ..errors import StaticsError
from ..model import Model

_ENTRY = re.compile(r"(.+)\[(\d{1,6})\]")
Parameter = str | Mapping[str, Sequence[float] | np.ndarray]


@dataclass(frozen=True, eq=False)
class LoadPath:
    """Loads as affine functions of one parameter s: pressure + s d_pressure and so on.

    Attributes:
        pressure: chamber pressures at s = 0, shape (n_u,) [Pa].
        tau: generalized forces at s = 0, shape (n_q,) [N m].
        theta: parameters at s = 0, shape (n_theta,).
        d_pressure: change of the pressures per unit of s.
        d_tau: the same of the generalized forces.
        d_theta: the same of the parameters.
    """

    pressure: np.ndarray
    tau: np.ndarray
    theta: np.ndarray
    d_pressure: np.ndarray
    d_tau: np.ndarray
    d_theta: np.ndarray

    @classmethod
    def constant(cls, pressure: np.ndarray, tau: np.ndarray, theta: np.ndarray) -> "LoadPath":
        """Loads that do not change."""
        still = (np.zeros_like(values) for values in (pressure, tau, theta))
        return cls(pressure, tau, theta, *still)

    def at(self, s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pressure, tau and theta at s."""
        return (
            self.pressure + s * self.d_pressure,
            self.tau + s * self.d_tau,
            self.theta + s * self.d_theta,
        )


def load_path(model: Model, parameter: Parameter, constant: LoadPath) -> LoadPath:
    """The loads as functions of a parameter, see `dtcasadi.branch`.

    Args:
        model: the model.
        parameter: a name whose value s is, or what is added to the constant loads per unit of s.
        constant: loads that do not change.

    Raises:
        StaticsError: a name is unknown, or a direction has a wrong shape.
    """
    values = {name: np.array(getattr(constant, name)) for name in ("pressure", "tau", "theta")}
    changes = {name: np.zeros_like(value) for name, value in values.items()}
    if isinstance(parameter, str):
        part, entries = _place(model, parameter)
        values[part][entries], changes[part][entries] = 0.0, 1.0
    elif isinstance(parameter, Mapping) and parameter:
        for name, direction in parameter.items():
            part, entries = _place(model, name)
            shape = changes[part][entries].shape
            changes[part][entries] = checks.array(name, direction, shape, error=load_error)
    else:
        expected = "a name, or changes by name"
        raise load_error("parameter", expected, checks.shown(parameter))
    return replace(constant, **values, **{f"d_{name}": value for name, value in changes.items()})


def ramped(model: Model, constant: LoadPath) -> LoadPath:
    """Constant pressures, generalized forces and external loads times s."""
    wrench = model.theta_blocks.get("wrench", slice(0, 0))
    d_theta = np.zeros_like(constant.theta)
    d_theta[wrench] = constant.theta[wrench]
    return LoadPath(
        pressure=np.zeros_like(constant.pressure),
        tau=np.zeros_like(constant.tau),
        theta=constant.theta - d_theta,
        d_pressure=constant.pressure,
        d_tau=constant.tau,
        d_theta=d_theta,
    )


def _place(model: Model, name: object) -> tuple[str, slice]:
    """Where a name's entries are: in the pressures, in tau or in theta."""
    places = {"pressure": ("pressure", slice(0, model.n_u)), "tau": ("tau", slice(0, model.n_q))}
    places |= {
        block: ("theta", place) for block, place in model.theta_blocks.items() if block != "frames"
    }
    match = _ENTRY.fullmatch(name) if isinstance(name, str) and name not in places else None
    block = match[1] if match else name
    if block not in places:
        known = ", ".join(places)
        expected = (
            f"{known}, an entry such as tau[1], or what the model was built to leave free "
            "(parameters=..., wrenches=...; on the command line --wrench)"
        )
        raise load_error("parameter", expected, checks.shown(name))
    part, place = places[block]
    count = place.stop - place.start
    if match is None:
        if not count:
            raise load_error("parameter", f"a robot with {block}", "none")
        return part, place
    entry = checks.index(f"parameter: {block}", int(match[2]), 1, count, error=load_error)
    return part, slice(place.start + entry - 1, place.start + entry)


def load_error(field: str, expected: str, got: object) -> StaticsError:
    """An argument that cannot be used."""
    return StaticsError(f"{field}: expected {expected}, got {got}")
