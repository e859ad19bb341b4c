"""One step of an explicit Runge-Kutta method as a CasADi Function."""

import casadi as ca
import numpy as np

from .tableau import Tableau


def explicit_step(ode: ca.Function, tableau: Tableau) -> ca.Function:
    """The step as a Function of the state, the command at each stage, the step and theta.

    Args:
        ode: state equation, ports x, u, theta -> xdot.
        tableau: the method.

    Returns:
        Function with ports x (n_x,), U (n_u, s) the command at t + c_i h, h, theta -> x_next
        (n_x,), error (n_x,) (the embedded estimate, zero without one).
    """
    n_x, n_u, n_theta = (ode.size1_in(i) for i in range(3))
    stages = len(tableau.b)
    x, U = ca.MX.sym("x", n_x), ca.MX.sym("U", n_u, stages)
    h, theta = ca.MX.sym("h"), ca.MX.sym("theta", n_theta)
    slopes: list[ca.MX] = []
    for i in range(stages):
        at = x + h * _combined(tableau.a[i, :i], slopes) if i else x
        slopes.append(ode(at, U[:, i], theta))
    error = ca.MX.zeros(n_x)
    if tableau.b_error is not None:
        error = h * _combined(tableau.b_error, slopes)
    outputs = [x + h * _combined(tableau.b, slopes), error]
    ports = ["x", "U", "h", "theta"]
    name = f"step_{tableau.name}"
    return ca.Function(name, [x, U, h, theta], outputs, ports, ["x_next", "error"])


def _combined(weights: np.ndarray, slopes: list[ca.MX]) -> ca.MX:
    terms = [w * k for w, k in zip(weights, slopes, strict=False) if w != 0]
    return sum(terms[1:], terms[0]) if terms else ca.MX.zeros(slopes[0].shape)
