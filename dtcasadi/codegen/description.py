"""What is exported, apart from how: the values that every format is written from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from ..bound import densified
from ..errors import ModelError
from ..profile import Profile
from .names import checked, checked_port

if TYPE_CHECKING:
    from ..model import Model


class Label(NamedTuple):
    """One row of a vector: its name and unit."""

    name: str
    unit: str


class Port(NamedTuple):
    """One argument or result, dense and column-major: name, shape, meaning and unit."""

    name: str
    rows: int
    columns: int
    meaning: str
    unit: str

    @property
    def size(self) -> int:
        """Number of entries."""
        return self.rows * self.columns


@dataclass(frozen=True, eq=False)
class Exposed:
    """One exported function.

    Attributes:
        name: what it is called in every format; checked by `names.checked`.
        function: what CasADi's virtual machine can evaluate, its ports dense.
        source: the same, perhaps with hand-written C kernels, for generated C only.
        title: one line that says what it computes.
    """

    name: str
    function: ca.Function
    source: ca.Function
    title: str = ""

    @property
    def inputs(self) -> tuple[Port, ...]:
        """Its arguments in order."""
        f = self.function
        return tuple(_port(f.name_in(i), f.size_in(i)) for i in range(f.n_in()))

    @property
    def outputs(self) -> tuple[Port, ...]:
        """Its results in order."""
        f = self.function
        return tuple(_port(f.name_out(i), f.size_out(i)) for i in range(f.n_out()))


def exposed(
    name: str, function: ca.Function, source: ca.Function | None = None, title: str = ""
) -> Exposed:
    """A Function under a name, checked, with dense ports.

    Args:
        name: lower-case words joined by underscores.
        function: an SX or MX Function that CasADi's virtual machine can evaluate.
        source: the same for generated C; default: `function`.
        title: one line that says what it computes.

    Raises:
        ModelError: a name that C cannot take, or no Function.
    """
    checked(name, "function name")
    for each in (function, source or function):
        if not isinstance(each, ca.Function):
            raise ModelError(f"functions[{name!r}]: expected a casadi Function, got {each!r}")
    source = source or function
    for port in (*source.name_in(), *source.name_out()):
        checked_port(port, f"{name}: port name")
    if len({*source.name_in(), *source.name_out()}) != source.n_in() + source.n_out():
        ports = ", ".join((*source.name_in(), *source.name_out()))
        raise ModelError(f"{name}: expected ports with different names, got {ports}")
    return Exposed(name, densified(function), densified(source), title)


@dataclass(frozen=True, eq=False)
class Motion:
    """What an example simulates: initial state, command against time and duration.

    Attributes:
        x0: initial state, shape (n_x,).
        command: commands against time.
        t_end: duration [s].
        step_s: step of the function `step` [s]; None where it is not exported.
        centre: centre of mass of the last disc in its own frame, shape (3,) [m].
    """

    x0: np.ndarray
    command: Profile
    t_end: float
    step_s: float | None
    centre: np.ndarray


@dataclass(frozen=True, eq=False)
class Export:
    """Everything a format needs.

    Attributes:
        name: prefix of every symbol and file.
        functions: in order, with different names.
        title: one line about the robot.
        labels: vectors whose rows have names: port name -> one Label a row.
        theta0: the robot's own parameters, shape (n_theta,); None where nothing is known of them.
        theta_blocks: name of each block of theta -> its slice.
        facts: lines about the robot and the model, for the README.
        graph: SHA-256 of the functions' graphs.
        motion: what the example simulates; None without a model.
        model: the model the functions come from, if any.
    """

    name: str
    functions: tuple[Exposed, ...]
    title: str
    graph: str
    labels: Mapping[str, tuple[Label, ...]] = field(default_factory=dict)
    theta0: np.ndarray | None = None
    theta_blocks: Mapping[str, slice] = field(default_factory=dict)
    facts: tuple[str, ...] = ()
    motion: Motion | None = None
    model: "Model | None" = None

    def get(self, name: str) -> Exposed | None:
        """The function of a name, or None."""
        return next((each for each in self.functions if each.name == name), None)


@dataclass(frozen=True)
class Settings:
    """How to write an export: single precision, and the SIMD batch beside the C."""

    single: bool = False
    simd: bool = False


# A format: the text of each file, by its name in the target folder. It writes nothing itself.
Writer = Callable[[Export, Settings], Mapping[str, str]]

_MEANINGS = {
    "q": ("generalized coordinates", "rad"),
    "qd": ("their rates", "rad/s"),
    "qdd": ("their accelerations", "rad/s^2"),
    "p": ("canonical momenta M qd", "N m s"),
    "pd": ("their time derivative", "N m"),
    "pressure": ("gauge pressure of each chamber", "Pa"),
    "tau": ("generalized forces", "N m"),
    "theta": ("free parameters, in blocks", "SI"),
    "x": ("state [q; qd; actuator states]", "rad, rad/s, own units"),
    "x_next": ("state after the step", "rad, rad/s, own units"),
    "xdot": ("time derivative of the state", "the state's per s"),
    "u": ("commands: pressures, or openings of valves", "Pa or 1"),
    "M": ("mass matrix", "kg m^2"),
    "force": ("generalized force", "N m"),
    "R": ("rotations of the discs, 3 x 3 blocks side by side", "1"),
    "r": ("origins of the discs' frames, a column each", "m"),
    "J": ("rotation axes, three rows a disc", "1"),
    "T": ("kinetic energy", "J"),
    "V": ("potential energy", "J"),
    "tension": ("tension of each thread; negative: it pushes", "N"),
    "effective_pressure": ("gauge pressure as it pushes on the robot", "Pa"),
    "supply_flow": ("air into each chamber", "kg/s"),
    "exhaust_flow": ("air out of each chamber", "kg/s"),
    "leak_flow": ("air that leaks out", "kg/s"),
    "stored": ("energy stored by the actuator", "J"),
    "supplied": ("power supplied by pressure and loads", "W"),
    "dissipated": ("power dissipated", "W"),
    "status": ("0: good; 1: not finite or not converged", "1"),
    "theta_next": ("parameters about the new centres", "SI"),
}


def _port(name: str, shape: tuple[int, int]) -> Port:
    meaning, unit = _MEANINGS.get(name, ("", ""))
    if not meaning and name.startswith("F_"):
        meaning = f"derivatives for {name[2:]}"
    elif not meaning and name.startswith("d") and "_d" in name:
        value, by = name[1:].split("_d", 1)
        meaning = f"derivatives of {value} for {by}"
    return Port(name, *shape, meaning, unit)
