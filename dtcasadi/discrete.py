"""The model in discrete time: the narrow waist that estimators and controllers see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from . import checks
from .bound import MATRICES, Bound
from .compile import twin
from .contact.start import rigid
from .contact.stepping import TIME_STEPPING
from .errors import ModelError
from .integrators import SYMPLECTIC
from .integrators.package import SLACK_MAX
from .integrators.step import At, OneStep, Plant, differentiated, taken
from .integrators.steppers import ONE_STEP, suited, symbols
from .measuring import Layout, Sensor, layout_of, plants_of, sensor_of
from .recentring import carried

if TYPE_CHECKING:
    from .model import Model
    from .sampled import Sampled, Sensors

_METHOD = "sdirk2"
# Squares of states above this overflow soon; a state that is not finite fails the same comparison.
_HUGE = 1e300
# Of a step that is linearized, whose user reckons with errors: the last Newton correction's share.
_SLACK_LINEARIZED = 1e-2


@dataclass(frozen=True, eq=False)
class DiscreteModel:
    """One step of a model at a fixed step size, with the command held over it.

    Attributes:
        step: Function x (n_x,), u (n_u,), theta (n_theta,) -> x_next (n_x,), status; status 0:
            good, 1: not finite (the command included) or not converged.
        checked: Function x, u, theta -> x_next, status, error (n_x,), residual: also the method's
            embedded estimate of the step's error (zero without one), and the largest entry of the
            stage equations after the last Newton step [N m] (zero without an iteration).
        linearize: Function x, u, theta -> x_next, F_x (n_x, n_x), F_u (n_x, n_u),
            F_theta (n_x, n_theta), zero for the block `frames`.
        linearize_checked: the same with `status` behind.
        ode: Function x, u, theta -> xdot, the continuous model.
        theta0: the robot's own parameters, then the biases of its sensors, shape (n_theta,).
        theta_blocks: name of each block of theta -> its slice.
        state_names: one name per state.
        step_s: step [s].
        method: name of the integrator.
        sensors: what is measured, by name.
    """

    step: ca.Function
    checked: ca.Function
    linearize: ca.Function
    linearize_checked: ca.Function
    ode: ca.Function
    theta0: np.ndarray
    theta_blocks: Mapping[str, slice]
    state_names: tuple[str, ...]
    step_s: float
    method: str
    sensors: Mapping[str, Sensor]
    _model: Model
    _sources: Mapping[str, ca.Function]
    _given: Mapping[str, Sampled]
    _layout: Layout
    _kept: dict[tuple[str, ...], Sensor] = field(default_factory=dict)

    @property
    def model(self) -> Model:
        """The continuous model."""
        return self._model

    def compiled(self, name: str) -> Bound:
        """The C twin of one of the Functions above, one per thread.

        Raises:
            ModelError: another name.
        """
        if name == "ode" and self._layout.n == self._layout.n_model:
            return self._model.compiled(name)
        plain, source = self.plain(name), self.native(name)
        key = ("discrete", name, self.method, self.step_s, source)
        function = self._model.once(key, lambda: twin(plain, source=source))
        return Bound(function, matrices=MATRICES.intersection(function.name_out()))

    def plain(self, name: str) -> ca.Function:
        """One of the Functions above, without a derivative of its own.

        Raises:
            ModelError: another name.
        """
        if name == "ode":
            return self.ode if self._layout.n > self._layout.n_model else self._model.plain(name)
        if name not in self._sources:
            expected = ", ".join([*self._sources, "ode"])
            raise ModelError(f"function: expected one of {expected}, got {name!r}")
        return getattr(self, name)

    def native(self, name: str) -> ca.Function:
        """The same with hand-written C kernels inside, for code generation only."""
        plain = self.plain(name)
        return self._sources.get(name, plain)

    def recentre(
        self, x: np.ndarray, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State and parameters about new centres, and the map T of a covariance; see `Model`."""
        n = self._layout.n_model
        given = np.asarray(theta, dtype=float)[:n]
        x, own, T = self._model.recentre(x, given)
        return x, theta if own is given else np.concatenate([own, theta[n:]]), T

    def carried(
        self, x: np.ndarray, theta: np.ndarray, to: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """A state about the centres of another theta, and the map of a covariance.

        See `dtcasadi.recentring.carried`.
        """
        n = self._layout.n_model
        return carried(self._model, x, theta[:n], to[:n])

    def together(self, names: Sequence[str]) -> Sensor:
        """Several sensors read at the same instant, as one: what they share is computed once.

        Raises:
            ModelError: an unknown name.
        """
        key = tuple(names)
        for name in key:
            if name not in self.sensors:
                expected = ", ".join(self.sensors) or "none: the model has no sensors"
                raise ModelError(f"sensor: expected one of {expected}, got {name!r}")
        if len(key) == 1:
            return self.sensors[key[0]]
        if key not in self._kept:
            given = [self._given[name] for name in key]
            self._kept[key] = sensor_of(self._model, given, self._layout)
        return self._kept[key]


def discretize(
    model: Model,
    step_s: float,
    method: str | None,
    *,
    exact: bool,
    sensors: Sensors = (),
    slack_max: float = SLACK_MAX,
) -> DiscreteModel:
    """Build `DiscreteModel`; see `Model.discrete`.

    Args:
        model: the model.
        step_s: step [s].
        method: a name of `dtcasadi.integrators.ONE_STEP`; None: as in `Model.discrete`.
        exact: whether `linearize` gives exact derivatives.
        sensors: what is measured.
        slack_max: a last Newton correction above this share of the stages is a failed step.

    Raises:
        ModelError: an unknown method, or one that the robot's contacts or constraints do not go
            with, or a step that is not positive.
    """
    step_s = checks.number("step_s", step_s, positive=True, error=_error)
    if model.actuator.dead_time:
        expected = "lags from 1 on for a model in steps, whose state has to hold the commands"
        raise _error("delay.lags", f"{expected} on their way", 0)
    method = method or (TIME_STEPPING if rigid(model) else _METHOD)
    if method not in ONE_STEP:
        raise _error("method", f"one of {', '.join(ONE_STEP)}", repr(method))
    chosen = ONE_STEP[method]
    if model.robot.constraints and method in SYMPLECTIC:
        raise _error("method", "one that keeps constraints, such as sdirk2", repr(method))
    if rigid(model) and method != TIME_STEPPING:
        raise _error("method", f"{TIME_STEPPING}, as the robot has rigid contact", repr(method))
    layout = layout_of(model, sensors)
    sources, functions = (
        _functions(chosen, plant, step_s, slack_max, layout, exact=exact)
        for plant in plants_of(model)
    )
    return DiscreteModel(
        **functions,
        ode=_ode(model, layout),
        theta0=layout.values,
        theta_blocks=layout.blocks,
        state_names=model.state_names,
        step_s=step_s,
        method=method,
        sensors={sensor.name: sensor_of(model, [sensor], layout) for sensor in sensors},
        _model=model,
        _sources=sources,
        _given={sensor.name: sensor for sensor in sensors},
        _layout=layout,
    )


def _ode(model: Model, layout: Layout) -> ca.Function:
    """The state equation as a Function of theta with the biases."""
    if layout.n == layout.n_model:
        return model.ode
    x, u = ca.MX.sym("x", model.n_x), ca.MX.sym("u", model.n_u)
    theta = ca.MX.sym("theta", layout.n)
    value = model.ode(x, u, theta[: layout.n_model])
    return ca.Function("ode", [x, u, theta], [value], ["x", "u", "theta"], ["xdot"])


def _functions(
    method: OneStep,
    plant: Plant,
    step_s: float,
    slack_max: float,
    layout: Layout,
    *,
    exact: bool,
) -> dict[str, ca.Function]:
    """The step and its linearization as Functions of x, u and theta."""
    plant = suited(method, plant)
    free = symbols(plant)
    theta = free.theta if layout.n == layout.n_model else plant.kind.sym("theta", layout.n)
    own, biases = ca.vertsplit(theta, [0, layout.n_model, layout.n])
    at = At(free.x, free.u, free.zeros(free.u.shape[0]), plant.kind(step_s), own)
    ports, names = [at.x, at.u, theta], ["x", "u", "theta"]
    step = taken(method, plant, at)
    finite = ca.sumsqr(step.x_next) + ca.sumsqr(at.u) <= _HUGE
    good = finite * (step.slack <= slack_max)
    parts = {"x_next": step.x_next, "status": 1 - good}
    plain = ca.Function("step", ports, list(parts.values()), names, list(parts))
    parts |= {"error": ca.densify(step.error), "residual": ca.densify(step.residual)}
    checked = ca.Function("checked", ports, list(parts.values()), names, list(parts))
    if plant.projection is None:
        step, by = method.sensitivity(plant, at, exact=exact)
    else:
        by = differentiated(method, plant, at)
    n_frames = at.theta.shape[0] - by.F_theta.shape[1]
    sides = [at.zeros(at.x.shape[0], n) for n in (n_frames, biases.shape[0])]
    by = by._replace(F_theta=ca.horzcat(sides[0], by.F_theta, sides[1]))
    parts = {"x_next": step.x_next, **by._asdict()}
    blocks = {name: ca.densify(value) for name, value in parts.items()}
    good = (ca.sumsqr(step.x_next) <= _HUGE) * (step.slack <= _SLACK_LINEARIZED)
    found = {"linearize": blocks, "linearize_checked": blocks | {"status": 1 - good}}
    options = {"cse": True}
    linearized = {
        name: ca.Function(name, ports, [*values.values()], names, [*values], options)
        for name, values in found.items()
    }
    return {"step": plain, "checked": checked, **linearized}


def _error(field: str, expected: str, got: object) -> ModelError:
    return ModelError(f"{field}: expected {expected}, got {got}")
