"""Closed-loop cost against time of a step, over integrators, horizons, planar and spatial."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dtcasadi.style import GREY, LINES, WIDTH_IN, finished, new_figure, styled

from .bench import Estimators, _rti, case_of, timed_steps

METHODS = ("midpoint", "sdirk2", "ros2", "rk4")
HORIZONS = (5, 10, 20)
_SPATIAL = ("midpoint",)


@styled
def chart(estimators: Estimators, path: str, report: Any, *, t_end: float = 5.0) -> Path:
    """Measure and draw.

    Args:
        estimators: scene -> the filter of its loop.
        path: a .png, .svg or .pdf file.
        report: where each point is recorded.
        t_end: of each loop [s].

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    report.section("frontier", "closed-loop cost against time of a step")
    points: dict[tuple[str, str], list[tuple[float, float, int]]] = {}
    for kind, methods in (("planar", METHODS), ("spatial", _SPATIAL)):
        for method in methods:
            for horizon in HORIZONS:
                case = case_of(kind, estimators, method=method, horizon=horizon)
                loop = case.run(_rti(case.found), t_end)
                ms = 1e3 * float(np.median(timed_steps(case.found, loop, 200)))
                report.row(
                    "points",
                    "{kind:8} {method:9} {horizon:>3} {median_ms:>9} ms  J {cost:>9}",
                    kind=kind,
                    method=method,
                    horizon=horizon,
                    median_ms=ms,
                    cost=loop.cost,
                )
                points.setdefault((kind, method), []).append((ms, loop.cost, horizon))
    figure = new_figure(0.75 * WIDTH_IN, 4.0, layout="constrained")
    for axes, kind in zip(figure.subplots(1, 2), ("planar", "spatial"), strict=True):
        _panel(axes, kind, points)
    finished(figure, path)
    return Path(path)


def _panel(axes: Any, kind: str, points: dict[tuple[str, str], list]) -> None:
    own = {method: rows for (name, method), rows in points.items() if name == kind}
    everything = sorted(row[:2] for rows in own.values() for row in rows)
    for color, (method, rows) in zip(LINES, own.items(), strict=False):
        values = np.array(rows)
        axes.plot(values[:, 0], values[:, 1], "o-", color=color, ms=4, lw=1, label=method)
        for ms, cost, horizon in rows:
            axes.annotate(
                f"{horizon}", (ms, cost), textcoords="offset points", xytext=(4, 4), fontsize=7
            )
    best, front = np.inf, []
    for ms, cost in everything:
        if cost < best:
            best = cost
            front.append((ms, cost))
    steps = np.array(front)
    axes.plot(steps[:, 0], steps[:, 1], color=GREY, ls="--", lw=1, zorder=0, label="frontier")
    axes.set_xscale("log")
    axes.set_xlabel("time of a step [ms]")
    axes.set_ylabel("closed-loop cost")
    axes.set_title(f"{kind}; numbers: horizon")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
