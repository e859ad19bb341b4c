"""The largest step a method survives on the linearized motion."""

import numpy as np

from .problem import Problem
from .step import OneStep

# Modes that hardly decay are a matter of accuracy: no method has to damp them.
DECAYING = 0.1
_RAY = np.linspace(0.0, 60.0, 6001)[1:]


def stability_limit(problem: Problem, method: OneStep) -> float:
    """Largest h with |R(h lambda)| <= 1 for all decaying eigenvalues at the start [s].

    Eigenvalues of F_x with Re lambda < -0.1 |Im lambda|; infinite where all of them allow any step.
    """
    jacobian = problem.model.compiled("ode_jacobian")
    u = problem.pieces[0](problem.pieces[0].t_start)
    _, F_x, _ = jacobian(problem.x0, u, problem.theta)
    if not np.all(np.isfinite(F_x)):
        return np.inf  # the step itself will say what is wrong
    eigenvalues = np.linalg.eigvals(F_x)
    decaying = eigenvalues[eigenvalues.real < -DECAYING * np.abs(eigenvalues.imag)]
    return min((limit_on_ray(method, value) for value in decaying), default=np.inf)


def limit_on_ray(method: OneStep, eigenvalue: complex) -> float:
    """Largest h with |R(h lambda)| <= 1 for one eigenvalue [s]."""
    size = abs(eigenvalue)
    if size == 0:
        return np.inf
    unit = eigenvalue / size
    outside = np.abs(method.stability(_RAY * unit)) > 1 + 1e-12
    if not outside.any():
        return np.inf
    k = int(np.argmax(outside))
    low, high = (_RAY[k - 1] if k else 0.0), _RAY[k]
    for _ in range(40):
        middle = (low + high) / 2
        if abs(method.stability(np.array([middle * unit]))[0]) > 1 + 1e-12:
            high = middle
        else:
            low = middle
    return low / size
