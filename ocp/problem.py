r"""A control problem as data: what to track, at what effort, within which limits.

Over `horizon` intervals of the discrete model's step h, the commands u_0 ... u_{N-1} minimize

.. math::
    J = \sum_{k=1}^{N} |y(x_k) - y^{ref}_k|^2_{W_k}
      + \sum_{k=0}^{N-1} \left(|u_k - u_{k-1}|^2_{W_{change}} + |u_k - u_s|^2_{W_{level}}\right)
      + \sum_{k=1}^{N} (\ell^T s_k + s_k^T \Lambda s_k)

subject to x_{k+1} = f(x_k, u_k), the limits of u_k and of u_k - u_{k-1}, and g(x_k) <= s_k,
0 <= s_k (Rawlings, Mayne, Diehl, Model Predictive Control, 2nd ed., sections 1.4, 1.5 and 8.1).
|v|_W^2 is sum of W_i v_i^2, u_{-1} the command in force, (x_s, u_s) the equilibrium nearest to the
reference. A terminal cost |(x_N - x_s; u_{N-1} - u_s)|_P^2 replaces the tracking at k = N.

Outputs are sensors of the discrete model by name. Where a value may vary over the horizon, give a
number for all, one for each entry, or a row for each interval (rows k = 0 ... N-1 of commands,
rows k = 0 ... N of outputs).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dtcasadi import checks
from dtcasadi.errors import ControlError

Reference = float | Sequence[float] | np.ndarray | Callable[[float], Any]


def refusal(name: str, expected: str, got: object) -> ControlError:
    """An error about a field of a problem."""
    return ControlError(f"{name}: expected {expected}, got {got}")


@dataclass(frozen=True, eq=False)
class Tracking:
    """An output that is to follow a reference.

    Attributes:
        output: name of a sensor of the discrete model, of any kind: a marker on the tip, a disc's
            orientation, a bend angle, coordinates.
        reference: a number for all channels, one for each, or a row for each k = 0 ... horizon,
            counted from now; or what gives them at a time [s]: a function or a
            `dtcasadi.Profile`. In the output's unit.
        weight: [1/unit^2]; one number, one for each channel, or rows for k = 0 ... horizon.
        channels: names or numbers (from 1) of the sensor's channels; default: all.
    """

    output: str
    reference: Any = 0.0
    weight: Any = 1.0
    channels: Sequence[str | int] | None = None


@dataclass(frozen=True, eq=False)
class Effort:
    """What commands cost.

    Attributes:
        change: of u_k - u_{k-1} [1/Pa^2].
        level: of u_k - u_s, the command that holds the target [1/Pa^2].
    """

    change: Any = 0.0
    level: Any = 0.0


@dataclass(frozen=True, eq=False)
class Limits:
    """Hard limits of the commands; each one number, one for each, or a row for each interval.

    Attributes:
        lower: [Pa].
        upper: [Pa].
        rate: largest |u_k - u_{k-1}| / h [Pa/s].
    """

    lower: Any = -np.inf
    upper: Any = np.inf
    rate: Any = np.inf


@dataclass(frozen=True, eq=False)
class Band:
    """An output to keep between bounds, g = (lower - y; y - upper), in the output's unit.

    Attributes:
        output: name of a sensor.
        lower: one number or one for each channel; -inf: none.
        upper: the same, inf: none.
        linear: price of a violation [1/unit]; large enough (above the multiplier of the hard
            constraint), the violation is zero wherever it can be (Fletcher, Practical Methods of
            Optimization, section 14.3).
        quadratic: price of its square [1/unit^2].
        channels: as in `Tracking`.
    """

    output: str
    lower: Any = -np.inf
    upper: Any = np.inf
    linear: float = 0.0
    quadratic: float = 1.0
    channels: Sequence[str | int] | None = None


@dataclass(frozen=True, eq=False)
class HalfSpace:
    """A point to keep on one side of a plane, g = offset - normal . y [m].

    Attributes:
        output: name of a sensor with three channels, as a marker on any disc.
        normal: direction of the side that is free, in the root's frame.
        offset: of the plane along the normal [m].
        linear: price of a violation [1/m], see `Band`.
        quadratic: price of its square [1/m^2].
    """

    output: str
    normal: Any
    offset: float
    linear: float = 0.0
    quadratic: float = 1.0


@dataclass(frozen=True, eq=False)
class Sphere:
    """A point to keep out of a ball, g = radius - |y - centre| [m].

    Attributes:
        output: name of a sensor with three channels, as a marker on any disc.
        centre: in the root's frame [m].
        radius: [m].
        linear: price of a violation [1/m], see `Band`.
        quadratic: price of its square [1/m^2].
    """

    output: str
    centre: Any
    radius: float
    linear: float = 0.0
    quadratic: float = 1.0


Soft = Band | HalfSpace | Sphere


@dataclass(frozen=True, eq=False)
class Problem:
    """A control problem; the module's text has its equation.

    Attributes:
        horizon: number N of intervals, each a step of the discrete model.
        tracking: outputs and their references, a term or several.
        effort: what commands cost.
        limits: hard limits of the commands.
        soft: limits of outputs, one or several, each with a slack of its own in every interval.
        terminal: `riccati`: of the linear regulator at the target (Rawlings, Mayne, Diehl,
            section 1.3); a matrix P of (x; u_{N-1}), shape (n_x + n_u, n_x + n_u); None.
        blocks: lengths of the blocks of intervals that share a command, their sum `horizon`
            (move blocking); None: every interval has its own.
        safe_pressure: where a controller that cannot go on ramps to, one number or one for each
            command [Pa]; default: the limit nearest to zero, or zero between them.

    Raises:
        ControlError: naming the field, what was expected and what was given.
    """

    horizon: int
    tracking: Any = ()  # stored as a tuple[Tracking, ...]
    effort: Effort = field(default_factory=Effort)
    limits: Limits = field(default_factory=Limits)
    soft: Any = ()  # stored as a tuple[Soft, ...]
    terminal: Any = None
    blocks: Sequence[int] | None = None
    safe_pressure: Any = None

    def __post_init__(self) -> None:
        """Check what does not depend on the model."""
        horizon = checks.index("horizon", self.horizon, 1, 10_000, error=refusal)
        object.__setattr__(self, "horizon", horizon)
        for name, kinds in (("tracking", Tracking), ("soft", Band | HalfSpace | Sphere)):
            value = getattr(self, name)
            value = (value,) if isinstance(value, kinds) else tuple(value)
            for term in value:
                if not isinstance(term, kinds):
                    raise refusal(name, "terms of ocp.problem", checks.shown(term))
            object.__setattr__(self, name, value)
        for name, kind in (("effort", Effort), ("limits", Limits)):
            if not isinstance(getattr(self, name), kind):
                given = checks.shown(getattr(self, name))
                raise refusal(name, f"a value of {kind.__name__}", given)
        if isinstance(self.terminal, str) and self.terminal != "riccati":
            raise refusal("terminal", "riccati, a matrix or None", repr(self.terminal))
        if self.blocks is not None:
            object.__setattr__(self, "blocks", self._blocked(self.blocks))

    def _blocked(self, blocks: Sequence[int]) -> tuple[int, ...]:
        expected = f"positive lengths of blocks that add up to {self.horizon}"
        try:
            lengths = tuple(checks.index("blocks", n, 1, 10_000, error=refusal) for n in blocks)
        except TypeError:
            raise refusal("blocks", expected, checks.shown(blocks)) from None
        if sum(lengths) != self.horizon:
            raise refusal("blocks", expected, f"{sum(lengths)} from {checks.shown(list(lengths))}")
        return lengths
