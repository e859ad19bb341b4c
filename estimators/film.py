"""Truth and estimates side by side as a moving picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dtcasadi.animate import animate
from dtcasadi.discrete import DiscreteModel
from dtcasadi.result import Run

from .report import Result
from .truth import Truth


def side_by_side(results: Sequence[Result], truth: Truth | None, path: Path) -> Path:
    """Write truth and estimates as a .gif or .mp4, one panel each.

    Raises:
        PictureError: another suffix, or ffmpeg is missing or fails.
        OSError: the file cannot be written; an older one is left as it was.
    """
    panels = {}
    if truth is not None:
        panels["truth"] = _run(truth.discrete, truth.t, truth.x, truth.u, truth.theta)
    for result in results:
        found = result.track
        x = np.array([est.x for est in found.estimates])
        theta = np.array([est.theta for est in found.estimates])
        panels[result.title] = _run(result.discrete, found.t, x, found.u, theta)
    return animate(panels, path)


def _run(
    discrete: DiscreteModel, t: np.ndarray, x: np.ndarray, u: np.ndarray, theta: np.ndarray
) -> Run:
    """Steps as a run that can be drawn: between them it stays as it is."""
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
