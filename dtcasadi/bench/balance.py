"""How well a run keeps its balances: what can be said where no reference can be trusted."""

import numpy as np

from ..commands import sampled
from ..health import energy_balance, gauss_nodes, imbalance, samples_of
from ..scene import Scene
from .precision_reference import Motion

# Gauss-Legendre weights of `gauss_nodes`.
_WEIGHTS = np.array([5, 8, 5]) / 18
# Beyond so many steps the sums take longer than the run.
MOST_STEPS = 20_000


def energy_defect(scene: Scene, motion: Motion) -> float | None:
    """Share of the energy turned over by which its balance is off over the whole run.

    None without full velocity terms, which alone keep it, and for very many steps.
    """
    model, found = motion.model, motion.found
    if model.options.velocity_terms != "full" or len(found.t) > MOST_STEPS:
        return None
    pieces = scene.pressure.pieces(0.0, scene.t_end)
    command = sampled(pieces, gauss_nodes(found.t), model.n_u)
    return float(imbalance(energy_balance(model, found, command, samples_of(found.t))))


def momentum_defect(scene: Scene, motion: Motion) -> float | None:
    """Largest |p(t + h) - p(t) - integral of dL/dq + Q| over a step, in largest |p|, eq (7).

    Over at most 200 steps, the integral by three Gauss nodes on the method's own interpolant. None
    without full velocity terms, or with actuator states.
    """
    model, found = motion.model, motion.found
    n = model.n_q
    if model.options.velocity_terms != "full" or model.n_x > 2 * n:
        return None
    pieces = scene.pressure.pieces(0.0, scene.t_end)
    largest, scale, still = 0.0, 0.0, np.zeros(n)
    for k in samples_of(found.t)[:-1]:
        theta, h = found.thetas[:, k], found.t[k + 1] - found.t[k]
        start, end = found.x[:, k], found.x_end[:, k]
        p = [np.array(model.momenta(x[:n], x[n:], theta)).ravel() for x in (start, end)]
        nodes = gauss_nodes(found.t[k : k + 2])
        pushed = np.zeros(n)
        states, commands = found.between(nodes), sampled(pieces, nodes, model.n_u)
        for weight, x, u in zip(_WEIGHTS, states.T, commands.T, strict=True):
            momenta = model.momenta(x[:n], x[n:], theta)
            pushed += (
                weight * np.array(model.canonical_ode(x[:n], momenta, u, still, theta)[1])[:, 0]
            )
        largest = max(largest, float(np.max(np.abs(p[1] - p[0] - h * pushed))))
        scale = max(scale, float(np.max(np.abs(p))))
    return largest / scale if scale > 0 else None
