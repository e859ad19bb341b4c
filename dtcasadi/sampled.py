"""What every sensor is given and gives back: readings along the chain, noise and timing."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from . import checks
from .chain import ZERO, Chain
from .errors import ModelError
from .kernels import articulated as art
from .robot import Robot

NAME_PATTERN = r"[a-z][a-z0-9]*(_[a-z0-9]+)*"


class Seen:
    """The chain at one (q, qd, qdd), as sensors see it; each recursion runs once, if at all."""

    def __init__(self, chain: Chain, q: ca.SX, qd: ca.SX, qdd: ca.SX, pressure: ca.SX):
        self.chain, self.q, self.pressure = chain, q, pressure
        self._motion = chain.motion(chain.segments(q), qd)
        self._qdd = qdd
        self._poses: tuple[list[ca.SX], list[ca.SX]] | None = None
        self._accelerations: list[tuple[ca.SX, ca.SX]] | None = None

    def pose(self, disc: int) -> tuple[ca.SX, ca.SX]:
        """Rotation and position of a disc in the root frame."""
        if self._poses is None:
            self._poses = self.chain.poses(self._motion.segments)
        return self._poses[0][disc - 1], self._poses[1][disc - 1]

    def rate(self, disc: int) -> ca.SX:
        """Angular velocity of a disc in its frame [rad/s]."""
        return self._motion.w(disc - 1)

    def acceleration(self, disc: int) -> tuple[ca.SX, ca.SX]:
        """Angular acceleration and acceleration minus gravity of a disc's origin, its frame."""
        if self._accelerations is None:
            motion, felt = self._motion, self.chain.root_acceleration()
            found = [(ZERO, felt)]
            for i, qdd in enumerate(self.chain.split(self._qdd)):
                where = (self.chain.words[i], motion.segments[i], motion.rates[i])
                next_one = self.chain.asm.call(art.accelerate, *where, qdd, motion.w(i), *found[-1])
                found.append(tuple(next_one))
            self._accelerations = found
        return self._accelerations[disc - 1]


@dataclass(frozen=True, eq=False, kw_only=True)
class Sampled:
    """What all sensors share.

    Attributes:
        name: lower-case words joined by underscores.
        noise: standard deviation of each reading, in the channel's unit; one number for all
            channels or one for each.
        period_s: time between samples [s]; None: one with every step.
        latency_s: a sample arrives this long after its instant [s].
        dropout: share of the samples that never arrive, from 0 up to below 1.

    Raises:
        ModelError: naming the sensor's field, what was expected and what was given.
    """

    name: str
    noise: Any
    period_s: float | None = None
    latency_s: float = 0.0
    dropout: float = 0.0

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of each reading."""
        raise NotImplementedError

    @property
    def discs(self) -> tuple[int, ...]:
        """The discs it is on."""
        return ()

    @property
    def n_bias(self) -> int:
        """How many of its readings, the first ones, have a bias in theta."""
        return 0

    def check(self, robot: Robot) -> None:
        """Raise ModelError if the sensor cannot be on this robot."""
        for disc in self.discs:
            checks.index("disc", disc, 1, robot.n_discs, error=self._refuse)

    @property
    def R_v(self) -> np.ndarray:
        """Covariance of the noise, shape (n_y, n_y)."""
        return np.diag(np.broadcast_to(np.asarray(self.noise), (len(self.channels),)) ** 2)

    def reading(self, seen: Seen) -> ca.SX:
        """The noiseless readings, shape (n_y, 1)."""
        raise NotImplementedError

    def _refuse(self, name: str, expected: str, got: object) -> ModelError:
        return ModelError(
            f"sensor {checks.shown(self.name)}: {name}: expected {expected}, got {got}"
        )

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.name, str) or not re.fullmatch(NAME_PATTERN, self.name):
            raise self._refuse("name", "lower-case words joined by _", checks.shown(self.name))
        refuse = self._refuse
        noise = self.noise
        if np.ndim(noise) == 0:
            noise = checks.number("noise", noise, positive=True, error=refuse)
        else:
            noise = checks.array("noise", noise, (len(self.channels),), error=refuse)
            if np.any(noise <= 0):
                raise self._refuse("noise", "positive numbers", checks.shown(noise))
        values: dict[str, Any] = {
            "noise": noise,
            "latency_s": checks.number("latency_s", self.latency_s, nonnegative=True, error=refuse),
            "dropout": checks.number("dropout", self.dropout, nonnegative=True, error=refuse),
        }
        if values["dropout"] >= 1:
            raise self._refuse("dropout", "a share below 1", values["dropout"])
        if self.period_s is not None:
            values["period_s"] = checks.number(
                "period_s", self.period_s, positive=True, error=refuse
            )
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def _set(self, **values: Any) -> None:
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def _point(self, name: str, value: object) -> np.ndarray:
        return checks.array(name, value, (3,), error=self._refuse)


Sensors = Sequence[Sampled]
