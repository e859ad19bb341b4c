"""The model in discrete time: the narrow waist that estimators and controllers see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from . import checks
from .bound import MATRICES, Bound
from .compile import twin
from .errors import ModelError
from .integrators.package import SLACK_MAX
from .integrators.step import At, OneStep, Plant
from .integrators.steppers import ONE_STEP, plant_of, symbols

if TYPE_CHECKING:
    from .model import Model

# Squares of states above this overflow soon; a state that is not finite fails the same comparison.
_HUGE = 1e300


@dataclass(frozen=True, eq=False)
class DiscreteModel:
    """One step of a model at a fixed step size, with the command held over it.

    Attributes:
        step: Function x (n_x,), u (n_u,), theta (n_theta,) -> x_next (n_x,), status; status 0:
            good, 1: not finite or not converged.
        checked: Function x, u, theta -> x_next, status, error (n_x,), residual: also the method's
            embedded estimate of the step's error (zero without one), and the largest entry of the
            stage equations after the last Newton step [N m] (zero without an iteration).
        linearize: Function x, u, theta -> x_next, F_x (n_x, n_x), F_u (n_x, n_u),
            F_theta (n_x, n_theta), zero for the block `frames`.
        ode: Function x, u, theta -> xdot, the continuous model.
        theta0: the robot's own parameters, shape (n_theta,).
        theta_blocks: name of each block of theta -> its slice.
        state_names: one name per state.
        step_s: step [s].
        method: name of the integrator.
    """

    step: ca.Function
    checked: ca.Function
    linearize: ca.Function
    ode: ca.Function
    theta0: np.ndarray
    theta_blocks: Mapping[str, slice]
    state_names: tuple[str, ...]
    step_s: float
    method: str
    _model: Model
    _sources: Mapping[str, ca.Function]

    def compiled(self, name: str) -> Bound:
        """The C twin of `step`, `checked`, `linearize` or `ode`, one per thread.

        Raises:
            ModelError: another name.
        """
        if name == "ode":
            return self._model.compiled(name)
        plain, source = self.plain(name), self.native(name)
        key = ("discrete", name, self.method, self.step_s, source)
        function = self._model.once(key, lambda: twin(plain, source=source))
        return Bound(function, matrices=MATRICES.intersection(function.name_out()))

    def plain(self, name: str) -> ca.Function:
        """`step`, `checked`, `linearize` or `ode`, without a derivative of its own.

        Raises:
            ModelError: another name.
        """
        if name == "ode":
            return self._model.plain(name)
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
        return self._model.recentre(x, theta)


def discretize(
    model: Model, step_s: float, method: str, *, exact: bool, slack_max: float = SLACK_MAX
) -> DiscreteModel:
    """Build `DiscreteModel`; see `Model.discrete`.

    Args:
        model: the model.
        step_s: step [s].
        method: a name of `dtcasadi.integrators.ONE_STEP`.
        exact: whether `linearize` gives exact derivatives.
        slack_max: a last Newton correction above this share of the stages is a failed step.

    Raises:
        ModelError: an unknown method, or a step that is not positive.
    """
    step_s = checks.number("step_s", step_s, positive=True, error=_error)
    if method not in ONE_STEP:
        raise _error("method", f"one of {', '.join(ONE_STEP)}", repr(method))
    chosen = ONE_STEP[method]
    sources, functions = (
        _functions(chosen, plant_of(g), step_s, slack_max, exact=exact) for g in model.graphs
    )
    return DiscreteModel(
        **functions,
        ode=model.ode,
        theta0=model.theta0,
        theta_blocks=model.theta_blocks,
        state_names=model.state_names,
        step_s=step_s,
        method=method,
        _model=model,
        _sources=sources,
    )


def _functions(
    method: OneStep, plant: Plant, step_s: float, slack_max: float, *, exact: bool
) -> dict[str, ca.Function]:
    """The step and its linearization as Functions of x, u and theta."""
    free = symbols(plant)
    at = At(free.x, free.u, free.zeros(free.u.shape[0]), plant.kind(step_s), free.theta)
    ports, names = [at.x, at.u, at.theta], ["x", "u", "theta"]
    step = method.step(plant, at)
    good = (ca.sumsqr(step.x_next) <= _HUGE) * (step.slack <= slack_max)
    parts = {"x_next": step.x_next, "status": 1 - good}
    plain = ca.Function("step", ports, list(parts.values()), names, list(parts))
    parts |= {"error": ca.densify(step.error), "residual": ca.densify(step.residual)}
    checked = ca.Function("checked", ports, list(parts.values()), names, list(parts))
    step, by = method.sensitivity(plant, at, exact=exact)
    n_frames = at.theta.shape[0] - by.F_theta.shape[1]
    by = by._replace(F_theta=ca.horzcat(at.zeros(at.x.shape[0], n_frames), by.F_theta))
    values = [ca.densify(value) for value in (step.x_next, *by)]
    outputs = ["x_next", *by._fields]
    options = {"cse": True}
    return {
        "step": plain,
        "checked": checked,
        "linearize": ca.Function("linearize", ports, values, names, outputs, options),
    }


def _error(field: str, expected: str, got: object) -> ModelError:
    return ModelError(f"{field}: expected {expected}, got {got}")
