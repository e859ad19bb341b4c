"""The model's Functions as a nonlinear program calls them, its scales, and collocation."""

from __future__ import annotations

import casadi as ca
import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.compile import twin

from .slopes import first_order, inner_slopes
from .stages import Stages


class Functions:
    """The model's Functions as the program calls them.

    Attributes:
        motion: x, u, theta -> x_next of shooting, xdot of collocation.
        residual: x, theta, reference -> r.
        inequality: x, theta -> g.
    """

    def __init__(self, stages: Stages, scheme: str, *, exact: bool):
        """Build them.

        Args:
            stages: the problem.
            scheme: `shooting`, `single` or a name of collocation points.
            exact: with exact second derivatives.
        """
        discrete = stages.discrete
        shooting = scheme in ("shooting", "single")
        if exact:
            self.motion = _one(discrete.step if shooting else discrete.ode, 0)
            self.residual, self.inequality = stages.residual, stages.inequality
            return
        outputs = twin(stages.linearize, source=stages.native)
        self.residual = first_order("residual", _one(outputs, 0), outputs, (1, None, None))
        bare = _without_reference(outputs)
        self.inequality = first_order("inequality", _one(bare, 2), bare, (3, None))
        if shooting:
            step = twin(discrete.linearize, source=discrete.native("linearize"))
            self.motion = first_order(
                "motion", _one(step, 0), inner_slopes(stages, step), (1, 2, None)
            )
            return
        slopes = twin(_ode_slopes(discrete.ode))
        self.motion = first_order(
            "motion", _one(slopes, 0), inner_slopes(stages, slopes), (1, 2, None)
        )


def _one(function: ca.Function, k: int) -> ca.Function:
    """A Function with output k alone."""
    inputs, names = function.mx_in(), function.name_in()
    return ca.Function(
        f"{function.name()}_{k}", inputs, [function.call(inputs)[k]], names, [function.name_out(k)]
    )


def _without_reference(outputs: ca.Function) -> ca.Function:
    x, theta, reference = outputs.mx_in()
    values = outputs.call([x, theta, ca.MX.zeros(reference.shape[0])])
    return ca.Function("limits", [x, theta], values, ["x", "theta"], outputs.name_out())


def _ode_slopes(ode: ca.Function) -> ca.Function:
    x, u, theta = ode.mx_in()
    value = ode(x, u, theta)
    blocks = [value, *(ca.densify(ca.jacobian(value, port)) for port in (x, u))]
    names = ["xdot", "xdot_x", "xdot_u"]
    return ca.Function("ode_slopes", [x, u, theta], blocks, ["x", "u", "theta"], names)


def collocation(scheme: str, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """C (degree + 1, degree + 1), D (degree + 1): slopes at the points, value at the end."""
    points = [0.0, *ca.collocation_points(degree, scheme)]
    C, D = np.zeros((degree + 1, degree + 1)), np.zeros(degree + 1)
    for j in range(degree + 1):
        others = [r for r in range(degree + 1) if r != j]
        basis = np.poly1d([1.0])
        for r in others:
            basis = np.polymul(basis, np.poly1d([1.0, -points[r]]) / (points[j] - points[r]))
        D[j] = np.polyval(basis, 1.0)
        C[j] = np.polyval(np.polyder(basis), points)
    return C, D


def scales(stages: Stages) -> tuple[np.ndarray, np.ndarray, float]:
    """Sizes of commands and states, and the largest weight of a cost of them."""
    bounds = np.vstack([stages.lower, stages.upper])
    size = np.max(np.abs(np.where(np.isfinite(bounds), bounds, 0.0)), axis=0)
    u_scale = np.where(size > 0, size, 1.0)
    discrete = stages.discrete
    at = np.zeros(stages.n_x), np.clip(0.0, stages.lower[0], stages.upper[0]), discrete.theta0
    step = Bound(
        twin(discrete.linearize, source=discrete.native("linearize")),
        matrices={"F_x", "F_u", "F_theta"},
    )
    moved = np.abs(step(*at).F_u) * u_scale
    moved = np.where(np.isfinite(moved), moved, 0.0)
    x_scale = np.maximum(1.0, moved.max(axis=1))
    outputs = Bound(twin(stages.linearize, source=stages.native), matrices={"R_x", "G_x"})
    R_x = outputs(at[0], at[2], np.zeros(len(stages.channels))).R_x
    felt = np.max(np.abs(R_x) * x_scale, axis=1, initial=0.0)
    costs = [
        np.max(stages.weight * felt**2, initial=0.0),
        np.max((stages.change + stages.level) * u_scale**2, initial=0.0),
    ]
    largest = float(np.max(costs))
    return u_scale, x_scale, largest if np.isfinite(largest) and largest > 0 else 1.0
