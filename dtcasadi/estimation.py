"""What a scene says about estimating its state: what the filter knows, and the truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import checks
from .errors import SceneError


@dataclass(frozen=True, eq=False)
class Estimation:
    """Numbers of a scene's table `[estimation]`.

    Attributes:
        step_s: step of the filter [s].
        method: its integration method, a name of `dtcasadi.integrators.ONE_STEP`.
        angle_sigma: standard deviation of each coordinate at the start [rad].
        rate_sigma: of each rate [rad/s].
        pressure_sigma: of each state of the actuator [Pa].
        offset: how far off every coordinate of the filter starts [rad].
        disc: where the contact force acts; default: the last disc.
        force_sigma: standard deviation of the contact force at the start, one number for all
            axes or three; zero: that component is known to be zero [N].
        force_walk: how far it wanders, the same way [N/sqrt(s)].
        moment_sigma: of a moment on the same disc, the same way [N m].
        moment_walk: how far it wanders, the same way [N m/sqrt(s)].
        force_noise: of white force noise on the same disc [N/sqrt(Hz)].
        rate_noise: of white noise on each rate [rad/s/sqrt(s)].
        contact_force: the truth's contact force, in the root's frame, shape (3,) [N].
        contact_from: when it starts [s].
        contact_to: when it ends [s].
        gate: chance that a good measurement is refused; None: no gate.
        caution: how often a filter raises the noise of a reading by what its linearization leaves
            out: of EKF, UKF and MHE.
        bounds: (lower, upper) of what the moving horizon estimator keeps within bounds, each one
            number or one for each entry, in SI units, by name: of a state (`psi_2`), of an entry of
            the contact wrench (`wrench[2]`, the force along y) or of all of it (`wrench`).
        seed: of the noise.
        truth_discs: number of discs of the robot that really moves; default: the model's.
        truth_stiffness: how many times stiffer its springs are than the model's.
        truth_hysteresis: amplitude of its chambers' hysteresis, which the model lacks [Pa].
        truth_payload: mass that its last disc carries and the model does not know of [kg].
    """

    step_s: float = 0.005
    method: str = "ros2"
    angle_sigma: float = 0.1
    rate_sigma: float = 0.1
    pressure_sigma: float = 1.0
    offset: float = 0.0
    disc: int | None = None
    force_sigma: Any = 0.1
    force_walk: Any = 0.1
    moment_sigma: Any = 0.0
    moment_walk: Any = 0.0
    force_noise: float = 0.0
    rate_noise: float = 0.01
    contact_force: Any = (0.0, 0.0, 0.0)
    contact_from: float = 0.0
    contact_to: float = 0.0
    gate: float | None = None
    caution: int = 0
    bounds: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    truth_discs: int | None = None
    truth_stiffness: float = 1.0
    truth_hysteresis: float = 0.0
    truth_payload: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("step_s", "angle_sigma", "rate_sigma", "pressure_sigma", "truth_stiffness"):
            value = checks.number(name, getattr(self, name), positive=True, error=_error)
            object.__setattr__(self, name, value)
        for name in ("force_sigma", "force_walk", "moment_sigma", "moment_walk"):
            given = np.broadcast_to(getattr(self, name), (3,))
            row = checks.array(name, given, (3,), error=_error)
            if np.any(row < 0):
                raise _error(name, "non-negative numbers", checks.shown(row))
            object.__setattr__(self, name, row)
        for name, pair in self.bounds.items():
            checks.limits(f"bounds[{name!r}]", pair, error=_error)
        force = checks.array("contact_force", self.contact_force, (3,), error=_error)
        object.__setattr__(self, "contact_force", force)

    def contact(self, t: float) -> np.ndarray:
        """The truth's contact force at a time, shape (3,) [N]."""
        return self.contact_force * (self.contact_from <= t < self.contact_to)


def _error(name: str, expected: str, got: object) -> SceneError:
    return SceneError([f"estimation.{name}: expected {expected}, got {got}"])
