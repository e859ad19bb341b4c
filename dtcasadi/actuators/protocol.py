"""What a model needs of an actuator, and what it tells it: the one protocol of all actuators."""

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..checks import shown
from .fields import check_chambers, refusal


class Air(NamedTuple):
    """The chambers as the robot shapes them, one row each, shape (n, 1).

    Attributes:
        volume: V enclosed between the discs without pressure [m^3]; negative where a chamber is
            folded inside out.
        volume_rate: power that a unit of pressure gives the robot [m^3/s]: dV/dt with inflation
            `volume`.
        rest_volume: volume at the pose q = 0 with the robot's own numbers, a constant [m^3].
        radial_compliance: growth c of the outlines, which are s = 1 + c pressure times as large
            [1/Pa]; structurally zero where no chamber grows.
        bulge: with them the volume is s^2 (V + (s - 1) bulge) [m^3].
    """

    volume: ca.SX
    volume_rate: ca.SX
    rest_volume: ca.DM
    radial_compliance: ca.SX
    bulge: ca.SX

    @property
    def grows(self) -> bool:
        """Whether the volume depends on the pressure beside the pose."""
        return self.radial_compliance.nnz() > 0

    def volume_at(self, pressure: ca.SX) -> ca.SX:
        """Volume at a gauge pressure [m^3]."""
        if not self.grows:
            return self.volume
        growth = self.radial_compliance * pressure
        return (1 + growth) ** 2 * (self.volume + growth * self.bulge)


class Signals(NamedTuple):
    """What happens in the chambers, one row each: gauge pressure [Pa] and flows in [kg/s]."""

    pressure: ca.SX
    supply_flow: ca.SX
    exhaust_flow: ca.SX
    leak_flow: ca.SX


class Accounts(NamedTuple):
    """Energy an actuator stores [J], and power [W] it is supplied with and dissipates."""

    stored: ca.SX
    supplied: ca.SX
    dissipated: ca.SX


@dataclass(frozen=True)
class Actuator:
    """Base of every actuator: a frozen value that turns commands u into chamber pressures.

    Its states follow q and qd in x, in the order of `state_names`. Numbers in its fields hold for
    all chambers, or are a sequence with one for each; when a model is built, they are CasADi
    matrices, and those named in `parameters` (`actuator.time_constant`) symbols. Expressions have
    to be differentiable and free of `if_else`.
    """

    @property
    def command(self) -> str:
        """What a command is: a gauge `pressure` [Pa], or the `opening` of a valve."""
        return "pressure"

    @property
    def sees_volume(self) -> bool:
        """Whether `pressure` or `rate` depend on the chambers' volume."""
        return False

    @property
    def sees_volume_rate(self) -> bool:
        """Whether they depend on its rate."""
        return False

    @property
    def stores_air(self) -> bool:
        """Whether `accounts` can hold the energy of the air."""
        return False

    @property
    def dead_time(self) -> float:
        """Time that a simulation holds the command back [s]."""
        return 0.0

    def fit(self, n: int, inflation: str) -> None:
        """Whether it can drive a robot with n chambers and an inflation model.

        Raises:
            ActuatorError: it cannot.
        """
        check_chambers(self, n)

    def state_names(self, n: int) -> tuple[str, ...]:
        """Names of the states appended to x; n is the number of chambers."""
        return ()

    def state_units(self, n: int) -> tuple[str, ...]:
        """Their units."""
        return ("Pa",) * len(self.state_names(n))

    def pressure(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """Gauge pressures that push on the robot [Pa], shape (n, 1)."""
        raise NotImplementedError

    def rate(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """Time derivative of the states."""
        return type(u)(0, 1)

    def signals(self, state: ca.SX, u: ca.SX, air: Air) -> Signals:
        """What could be measured at the chambers."""
        still = type(u)(*u.shape)
        return Signals(self.pressure(state, u, air), still, still, still)

    def accounts(self, state: ca.SX, u: ca.SX, air: Air, *, closed: bool) -> Accounts:
        """Energy held, supplied and lost in the actuator.

        Args:
            state: its states.
            u: the commands.
            air: what it sees of the chambers.
            closed: whether all work of the pressures is the air's (`stores_air`, inflation
                `volume`, chambers that do not grow): then the air's energy counts as stored and
                what flows bring of it as supplied; else the pressures' work on the robot does, and
                only what the actuator takes from it is supplied here.
        """
        zero = type(u)(1, 1)
        return Accounts(zero, zero, zero)

    def rest_state(self, pressure: np.ndarray, volume: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The states of chambers that hold a gauge pressure.

        Args:
            pressure: shape (n,) [Pa].
            volume: of the chambers where it is seen, shape (n,) [m^3].
            rest: their rest volumes, shape (n,) [m^3].
        """
        return np.zeros(0)

    def rest_command(self, pressure: np.ndarray) -> np.ndarray:
        """The commands that go with them, shape (n,)."""
        return pressure


@dataclass(frozen=True)
class Wrapped(Actuator):
    """Base of actuators around another one, whose states come first.

    Attributes:
        source: the actuator inside.
    """

    source: Actuator

    def check_source(self, owner: str) -> None:
        """Whether there is an actuator inside.

        Raises:
            ActuatorError: there is none.
        """
        if not isinstance(self.source, Actuator):
            raise refusal(f"{owner}.source", "an actuator", shown(self.source))

    @property
    def command(self) -> str:
        """The source's."""
        return self.source.command

    @property
    def sees_volume(self) -> bool:
        """Whether the source does."""
        return self.source.sees_volume

    @property
    def sees_volume_rate(self) -> bool:
        """Whether the source does."""
        return self.source.sees_volume_rate

    @property
    def stores_air(self) -> bool:
        """Whether the source does."""
        return self.source.stores_air

    @property
    def dead_time(self) -> float:
        """The source's."""
        return self.source.dead_time

    def fit(self, n: int, inflation: str) -> None:
        """Whether it and the source can."""
        super().fit(n, inflation)
        self.source.fit(n, inflation)

    def state_names(self, n: int) -> tuple[str, ...]:
        """The source's, then its own."""
        return self.source.state_names(n) + self.own_names(n)

    def state_units(self, n: int) -> tuple[str, ...]:
        """The source's, then its own."""
        return self.source.state_units(n) + self.own_units(n)

    def own_names(self, n: int) -> tuple[str, ...]:
        """Names of the states around the source's, in blocks of n."""
        return ()

    def own_units(self, n: int) -> tuple[str, ...]:
        """Their units."""
        return ("Pa",) * len(self.own_names(n))

    def split(self, state: ca.SX, u: ca.SX) -> tuple[ca.SX, ...]:
        """The source's states, and each block of its own."""
        n = u.shape[0]
        inner, blocks = len(self.source.state_names(n)), len(self.own_names(1))
        return tuple(ca.vertsplit(state, [0, *(inner + n * k for k in range(blocks + 1))]))

    def rest_command(self, pressure: np.ndarray) -> np.ndarray:
        """The source's."""
        return self.source.rest_command(pressure)
