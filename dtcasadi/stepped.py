"""Steps of a discrete model as a run."""

import numpy as np

from .discrete import DiscreteModel
from .result import Run


def run_of_steps(
    discrete: DiscreteModel, t: np.ndarray, x: np.ndarray, u: np.ndarray, theta: np.ndarray
) -> Run:
    """Steps as a run that can be drawn: between them it stays as it is.

    Args:
        discrete: whose steps.
        t: times, shape (n,) [s].
        x: states, shape (n, n_x).
        u: commands, shape (n, n_u).
        theta: parameters, those of the model first, shape (n, n_theta).
    """
    model = discrete.model
    own = theta[:, : len(model.theta0)]

    def dense(moments: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        at = np.searchsorted(t, moments + 1e-9, side="right") - 1
        return x[at].T, u[at].T, own[at].T

    n = len(t) - 1
    return Run(
        model=model,
        t=t,
        x=x.T,
        u=u.T,
        thetas=own.T,
        success=True,
        message=f"{n} steps",
        method=discrete.method,
        choice="",
        energy={"t": t[:0]},
        condition=t[:0],
        recentrings=(),
        events=(),
        steps=n,
        step_sizes=np.diff(t),
        rejected=0,
        evaluations=n,
        wall_time=0.0,
        dense=dense,
    )
