"""What a path of a sweep changes: a parameter, the command, the start, the payload."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..actuation import settled
from ..checks import shown
from ..errors import DtcasadiError, ModelError, SweepError
from ..forces import Payload
from ..model import Model
from ..numbers import slots
from ..profile import Profile
from ..scene import Scene

_ENTRY = re.compile(r"(.+)\[(\d{1,6})\]")
_POSITIVE = ("mass", "length")
_NONNEGATIVE = ("stiffness", "rest_length", "damping", "c_a", "c_b", "c_w", "c_r", "areas")
_HELP = (
    "a path of dtcasadi.build's parameters (springs.stiffness, discs[4].mass, gravity, up[1]), "
    "payload, pressure, pressure[1], pressure.scale, or initial.STATE"
)


class Target(NamedTuple):
    """Where a path's value goes.

    kind: theta, command, scale or state; at: entries of that array; bound: below which a value
    describes no body, or -inf; strict: whether the bound itself is out too.
    """

    kind: str
    at: slice
    bound: float = -np.inf
    strict: bool = False


class Rows(NamedTuple):
    """Runs to make, a column each: x0, theta, and the command scale * profile + offset.

    faults: what is wrong with a run's inputs, or an empty text.
    """

    x0: np.ndarray
    theta: np.ndarray
    scale: np.ndarray
    offset: np.ndarray
    faults: list[str]


@dataclass(frozen=True, eq=False)
class Setup:
    """A scene's model with the paths of a sweep left free."""

    scene: Scene
    model: Model
    names: tuple[str, ...]
    targets: tuple[Target, ...]

    def rows(self, inputs: np.ndarray) -> Rows:
        """The runs of some rows of inputs, shape (n, paths)."""
        model, n = self.model, len(inputs)
        theta = np.repeat(model.theta0[:, np.newaxis], n, axis=1)
        scale, offset = np.ones((model.n_u, n)), np.zeros((model.n_u, n))
        x0 = np.zeros((model.n_x, n))
        kinds = [target.kind for target in self.targets]
        for target, values in zip(self.targets, inputs.T, strict=True):
            if target.kind == "theta":
                theta[target.at] = values
            elif target.kind == "scale":
                scale[target.at] *= values
            elif target.kind == "command":
                scale[target.at], offset[target.at] = 0.0, values
        base = self.scene.x0(model)
        x0[...] = base[:, np.newaxis]
        if model.n_x > 2 * model.n_q and {"scale", "command"} & set(kinds):
            self._settle(x0, scale, offset)
        for target, values in zip(self.targets, inputs.T, strict=True):
            if target.kind == "state":
                x0[target.at] = values
        return Rows(x0, theta, scale, offset, [self._fault(row) for row in inputs])

    @property
    def base(self) -> Profile:
        """The scene's command, zero where every run has another: it jumps there for none."""
        given = self.scene.pressure
        values = given.values.copy()
        for target in self.targets:
            if target.kind == "command":
                values[:, target.at] = 0.0
        return Profile(given.times, values, given.kind)

    def profile(self, rows: Rows, k: int) -> Profile:
        """The command of one run."""
        given = self.scene.pressure
        values = given.values * rows.scale[:, k] + rows.offset[:, k]
        return Profile(given.times, values, given.kind)

    def _settle(self, x0: np.ndarray, scale: np.ndarray, offset: np.ndarray) -> None:
        """Actuator states that hold each run's own first pressure."""
        model = self.model
        if self.scene.initial_pressure is not None or model.actuator.command != "pressure":
            return
        held = scale * self.scene.pressure(0.0)[:, np.newaxis] + offset
        unique, where = np.unique(held, axis=1, return_inverse=True)
        states = [settled(model, x0[: model.n_q, 0], column) for column in unique.T]
        x0[2 * model.n_q :] = np.array(states).T[:, where.ravel()]

    def _fault(self, row: np.ndarray) -> str:
        for name, target, value in zip(self.names, self.targets, row, strict=True):
            if value < target.bound or (target.strict and value == target.bound):
                kind = "positive" if target.strict else "non-negative"
                return f"{name}: expected a {kind} number, got {value:g}"
        return ""


def setup_of(scene: Scene, names: Sequence[str], options: dict[str, Any]) -> Setup:
    """The scene's model with the paths left free.

    Args:
        scene: the scene.
        names: paths.
        options: of `dtcasadi.build`, in place of the scene's.

    Raises:
        SweepError: a path names nothing, or something another path names.
    """
    if "payload" in names:
        robot = scene.robot
        extra = Payload(robot.n_discs, 0.0)
        scene = replace(scene, robot=replace(robot, forces=(*robot.forces, extra)))
    parameters = [_parameter(scene, name) for name in names]
    given = {**scene.options, **options}
    free = given.pop("parameters", ())
    free = (free,) if isinstance(free, str) else tuple(free)
    wanted = dict.fromkeys(path for path in parameters if path and path not in free)
    try:
        model = replace(scene, options=given).build(parameters=(*free, *wanted))
    except ModelError as error:
        raise SweepError(f"over: expected {_HELP}; {error}") from None
    targets = tuple(
        _target(model, name, path) for name, path in zip(names, parameters, strict=True)
    )
    _refuse_overlap(names, targets)
    return Setup(scene, model, tuple(names), targets)


def _parameter(scene: Scene, name: str) -> str:
    """The block of theta that a path needs; empty where it is none of the model's."""
    if name == "payload":
        return f"forces[{len(scene.robot.forces)}].mass"
    if name.split("[")[0].split(".")[0] in ("pressure", "opening", "initial"):
        return ""
    match = _ENTRY.fullmatch(name)
    return match[1] if match else name


def _target(model: Model, name: str, path: str) -> Target:
    if path:
        return _theta_target(model, name, path)
    head, _, tail = name.partition(".")
    if head == "initial":
        if tail not in model.state_names:
            raise _error(name, f"initial.STATE with one of {', '.join(model.state_names)}")
        k = model.state_names.index(tail)
        return Target("state", slice(k, k + 1))
    command = model.actuator.command
    match = re.fullmatch(rf"{command}(?:\[(\d{{1,4}})\])?(\.scale)?", name)
    if not match or not model.n_u:
        chambers = f"{command}, {command}[1] or {command}.scale, the actuator's command"
        raise _error(name, chambers if model.n_u else "no command for a robot without chambers")
    if match[1] and not 1 <= int(match[1]) <= model.n_u:
        raise _error(name, f"a chamber from 1 to {model.n_u}")
    at = slice(int(match[1]) - 1, int(match[1])) if match[1] else slice(0, model.n_u)
    return Target("scale" if match[2] else "command", at)


def _theta_target(model: Model, name: str, path: str) -> Target:
    block = model.theta_blocks[path]
    size = block.stop - block.start
    match = _ENTRY.fullmatch(name) if path != name and name != "payload" else None
    if match:
        if not 1 <= int(match[2]) <= size:
            raise _error(name, f"an entry from 1 to {size}")
        k = block.start + int(match[2]) - 1
        return Target("theta", slice(k, k + 1))
    try:
        count = len(slots(model.robot, path))
    except DtcasadiError:  # the actuator's, one for each chamber
        count = size
    if size != count and not path.endswith(".areas"):
        raise _error(name, f"an entry, {name}[1] to {name}[{size // count}]")
    field = path.rpartition(".")[2]
    if field in _POSITIVE and not path.startswith("forces"):
        return Target("theta", block, 0.0, strict=True)
    return Target("theta", block, 0.0 if field in (*_NONNEGATIVE, "mass") else -np.inf)


def _refuse_overlap(names: Sequence[str], targets: Sequence[Target]) -> None:
    taken: dict[tuple[str, int], str] = {}
    for name, target in zip(names, targets, strict=True):
        kind = "command" if target.kind == "scale" else target.kind
        for k in range(target.at.start, target.at.stop):
            if (kind, k) in taken:
                raise _error(name, f"numbers that {taken[kind, k]} does not change already")
            taken[kind, k] = name


def _error(name: str, expected: str) -> SweepError:
    return SweepError(f"over {name}: expected {expected}, got {shown(name)}")
