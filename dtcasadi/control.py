"""What a scene says about controlling its robot: the problem, and what is asked of the output."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import checks
from .errors import SceneError
from .profile import Profile


@dataclass(frozen=True, eq=False)
class KeepOut:
    """A ball, or the far side of a plane, that a marker is to stay out of.

    Attributes:
        output: name of the marker.
        centre: of the ball, shape (3,) [m]; None: a plane.
        radius: of the ball [m].
        normal: of the plane, towards the free side.
        offset: of the plane along the normal [m].
        linear: price of a violation [1/m].
        quadratic: price of its square [1/m^2].
    """

    output: str
    centre: Any = None
    radius: float = 0.0
    normal: Any = None
    offset: float = 0.0
    linear: float = 0.0
    quadratic: float = 1e4


@dataclass(frozen=True, eq=False)
class Control:
    """Numbers of a scene's table `[control]`.

    Attributes:
        step_s: interval of the controller, and of its model [s].
        method: of integration, a name of `dtcasadi.integrators.ONE_STEP`.
        horizon: number of intervals.
        outputs: names of the sensors to track.
        channels: of each output, names of the channels to track; None: all.
        weight: of the error, one number or one for each channel [1/unit^2].
        change: of changes of the commands, one number or one for each [1/Pa^2].
        level: of commands away from those that hold the target [1/Pa^2].
        minimum: lowest commands [Pa].
        maximum: highest commands [Pa].
        rate: fastest change of a command [Pa/s].
        terminal: `riccati` or `none`.
        blocks: lengths of blocks of intervals that share a command; None: none do.
        reference: pressures at which the true robot rests where the output is to be, against time.
        delay_s: how long after its time a command reaches the robot [s].
        measured: names of the sensors that the estimator reads; None: all.
        keep_out: where markers are not to be.
        plant_step_s: step of the true robot's motion [s].
    """

    step_s: float
    horizon: int
    outputs: Sequence[str]
    reference: Profile
    channels: Sequence[Sequence[str] | None] | None = None
    method: str = "midpoint"
    weight: Any = 1.0
    change: Any = 0.0
    level: Any = 0.0
    minimum: Any = 0.0
    maximum: Any = np.inf
    rate: Any = np.inf
    terminal: str = "none"
    blocks: Sequence[int] | None = None
    delay_s: float = 0.0
    measured: Sequence[str] | None = None
    keep_out: Sequence[KeepOut] = ()
    plant_step_s: float = 0.005

    def __post_init__(self) -> None:
        """Check every field that the problem itself does not."""
        for name in ("step_s", "plant_step_s"):
            value = checks.number(name, getattr(self, name), positive=True, error=_error)
            object.__setattr__(self, name, value)
        checks.number("delay_s", self.delay_s, nonnegative=True, error=_error)
        checks.index("horizon", self.horizon, 1, 10_000, error=_error)
        if self.terminal not in ("riccati", "none"):
            raise _error("terminal", "riccati or none", checks.shown(self.terminal))
        if not self.outputs:
            raise _error("outputs", "at least one sensor", "none")


def _error(name: str, expected: str, got: object) -> SceneError:
    return SceneError([f"control.{name}: expected {expected}, got {got}"])
