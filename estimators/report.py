"""What a filter's run looked like: figures and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.discrete import DiscreteModel

from .runner import Track
from .scenario import Truth

if TYPE_CHECKING:
    from dtcasadi.cli.common import Report

_AXES = "xyz"


def tip_of(discrete: DiscreteModel, x: np.ndarray, thetas: np.ndarray) -> np.ndarray:
    """Origin of the last disc in the root frame at each row, shape (n, 3) [m]."""
    poses = Bound(_poses(discrete))
    return np.array([poses(*row) for row in zip(x, thetas, strict=True)])


def _poses(discrete: DiscreteModel) -> ca.Function:
    """The last disc's origin as a Function of x and theta."""
    model = discrete.model
    x, theta = ca.MX.sym("x", model.n_x), ca.MX.sym("theta", len(discrete.theta0))
    _, r = model.poses(x[: model.n_q], theta[: len(model.theta0)])
    return ca.Function("tip", [x, theta], [r[:, -1]])


def figures(discrete: DiscreteModel, found: Track, truth: Truth | None, report: Report) -> None:
    """Say how the run went; errors where the truth is known."""
    last = found.last
    report.section("ekf", "extended Kalman filter")
    report.line(
        "{steps} steps; readings skipped {skipped}, updates gated {gated}, samples too late "
        "{refused}, steps failed {failed}, re-centred {recentred} times",
        steps=len(found.t) - 1,
        skipped=last.skipped,
        gated=last.gated,
        refused=len(found.refused),
        failed=last.failed,
        recentred=last.recentred,
    )
    force = last.theta[discrete.theta_blocks["wrench"]][:3]
    report.line("contact force at the end: {force_N} N", force_N=force.round(4).tolist())
    if truth is None:
        return
    tips = tip_of(discrete, *_rows(found))
    length = discrete.model.robot.length
    error = np.linalg.norm(tips - tip_of(discrete, truth.x, truth.theta), axis=1)
    half = len(error) // 2
    report.line(
        "tip off by {start:.3g} of the length at the start, {rms:.3g} (root mean square) in the "
        "second half",
        start=error[0] / length,
        rms=float(np.sqrt(np.mean(error[half:] ** 2))) / length,
    )
    forces = np.array([est.theta[discrete.theta_blocks["wrench"]][:3] for est in found.estimates])
    off = np.linalg.norm(forces - truth.force, axis=1)
    report.line(
        "contact force off by {force_rms_N:.3g} N (root mean square) in the second half",
        force_rms_N=float(np.sqrt(np.mean(off[half:] ** 2))),
    )


def drawn(discrete: DiscreteModel, found: Track, truth: Truth | None, path: Path) -> Path:
    """Draw the tip and the contact force against time: truth, estimate, 2 sigma."""
    from matplotlib.figure import Figure

    from dtcasadi.files import written

    figure = Figure(figsize=(9, 7), layout="constrained")
    tip_axes, force_axes = figure.subplots(2, 1, sharex=True)
    x, thetas = _rows(found)
    tips = 1e3 * tip_of(discrete, x, thetas)
    block = discrete.theta_blocks["wrench"]
    n_x = x.shape[1]
    for k, axis in enumerate(_AXES):
        color = f"C{k}"
        tip_axes.plot(found.t, tips[:, k], color=color, label=f"{axis}, estimate")
        sigma = np.array([est.sigma[n_x + k] for est in found.estimates])
        force = thetas[:, block.start + k]
        force_axes.plot(found.t, force, color=color, label=f"{axis}, estimate")
        force_axes.fill_between(
            found.t, force - 2 * sigma, force + 2 * sigma, color=color, alpha=0.2, lw=0
        )
        if truth is not None:
            true_tip = 1e3 * tip_of(discrete, truth.x, truth.theta)
            tip_axes.plot(truth.t, true_tip[:, k], color=color, ls="--", label=f"{axis}, truth")
            force_axes.plot(
                truth.t, truth.force[:, k], color=color, ls="--", label=f"{axis}, truth"
            )
    tip_axes.set_ylabel("origin of the last disc [mm]")
    force_axes.set_ylabel("contact force, 2 sigma shaded [N]")
    force_axes.set_xlabel("time [s]")
    for axes in (tip_axes, force_axes):
        axes.legend(ncols=3, fontsize="small", loc="best")
        axes.grid(alpha=0.3)
    with written(path) as file:
        figure.savefig(file, format="png", dpi=120)
    return path


def _rows(found: Track) -> tuple[np.ndarray, np.ndarray]:
    """States and parameters of each step, a row each."""
    x = np.array([est.x for est in found.estimates])
    return x, np.array([est.theta for est in found.estimates])
