"""How far a finished run can be trusted: energy balance and conditioning."""

import numpy as np

from .bound import Bound
from .compile import twin
from .contact.report import Touched
from .integrators.problem import Trajectory
from .model import Model

SAMPLES = 200
# Gauss-Legendre, 3 nodes on [0, 1].
NODES = 0.5 + 0.5 * np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
WEIGHTS = np.array([5, 8, 5]) / 18


def samples_of(t: np.ndarray) -> np.ndarray:
    """Indices of at most `SAMPLES` steps, the first and the last among them."""
    return np.unique(np.linspace(0, len(t) - 1, min(len(t), SAMPLES)).round().astype(int))


def energy_balance(
    model: Model,
    trajectory: Trajectory,
    command: np.ndarray,
    at: np.ndarray,
    hit: Touched | None = None,
) -> dict[str, np.ndarray]:
    """Energies and the balance residual at some of the steps.

    residual = (T + V + S) - (T + V + S)(0) - supplied + dissipated with the energy S stored in the
    actuator (compressed air, walls), the powers integrated over every step by three Gauss nodes on
    the method's own interpolant. It is zero for exact motion with full velocity terms; with others
    it shows what they leave out.

    Args:
        model: the model.
        trajectory: its motion.
        command: commands at the Gauss nodes of every step, shape (n_u, 3 (n - 1)).
        at: indices of the steps to report.
        hit: what rigid contacts did; adds their work `contact`, and `projected` of projections.

    Returns:
        t, kinetic, potential, stored, supplied, dissipated, residual, shape (len(at),) each [s, J].
    """
    n = model.n_q
    power = Bound(twin(model.power))
    thetas = trajectory.thetas
    nodes = gauss_nodes(trajectory.t)
    states = trajectory.between(nodes) if len(nodes) else np.zeros((model.n_x, 0))
    work = np.zeros((2, len(nodes)))
    for k in range(len(nodes)):
        power.inputs.x[:], power.inputs.u[:] = states[:, k], command[:, k]
        power.inputs.theta[:] = thetas[:, k // 3]
        power.run()
        work[:, k] = power.outputs.supplied[0], power.outputs.dissipated[0]
    steps = np.diff(trajectory.t)
    shares = (work.reshape(2, -1, 3) @ WEIGHTS) * steps
    supplied, dissipated = np.concatenate([np.zeros((2, 1)), np.cumsum(shares, axis=1)], axis=1)
    x, thetas = trajectory.x[:, at], thetas[:, at]
    kinetic = np.array(model.kinetic_energy(x[:n], x[n : 2 * n], thetas)).ravel()
    potential = np.array(model.potential_energy(x[:n], thetas)).ravel()
    stored = np.array(model.power(x, np.zeros((model.n_u, len(at))), thetas)[2]).ravel()
    total = kinetic + potential + stored
    own = {} if hit is None else {"contact": hit.work[at], "projected": hit.projected[at]}
    return {
        **own,
        "t": trajectory.t[at],
        "kinetic": kinetic,
        "potential": potential,
        "stored": stored,
        "supplied": supplied[at],
        "dissipated": dissipated[at],
        "residual": total - total[0] - supplied[at] + dissipated[at] - sum(own.values()),
    }


def gauss_nodes(t: np.ndarray) -> np.ndarray:
    """Three Gauss times in each step, shape (3 (n - 1),)."""
    return (t[:-1, np.newaxis] + np.diff(t)[:, np.newaxis] * NODES).ravel()


def conditions(model: Model, q: np.ndarray, thetas: np.ndarray) -> np.ndarray:
    """Condition number of M in the 2-norm at each column of q and theta, shape (m,)."""
    values = []
    for column, theta in zip(q.T, thetas.T, strict=True):
        singular = np.linalg.svd(np.array(model.mass_matrix(column, theta)), compute_uv=False)
        with np.errstate(divide="ignore"):
            values.append(singular[0] / singular[-1])
    return np.array(values)


def imbalance(energy: dict[str, np.ndarray]) -> np.ndarray:
    """Largest residual of the balance relative to the energy in motion or turned over.

    Args:
        energy: as of `energy_balance`, of one run, shape (n,), or of several, (n, runs).

    Returns:
        A number, or one for each run.
    """
    total = energy["kinetic"] + energy["potential"] + energy["stored"]
    kinds = ("potential", "stored", "supplied", "dissipated", "contact")
    turned = np.max([np.ptp(energy[name], axis=0) for name in kinds if name in energy], axis=0)
    # A free disc turns nothing over: what it moves with is the scale, not its own drift. At rest
    # there is only what the tolerances let through, small beside the energy there is.
    moving = np.max(energy["kinetic"], axis=0)
    turned = np.max([turned, moving, 1e-6 * np.max(np.abs(total), axis=0)], axis=0)
    worst = np.max(np.abs(energy["residual"]), axis=0)
    return np.divide(worst, turned, out=np.zeros_like(worst), where=turned > 0)
