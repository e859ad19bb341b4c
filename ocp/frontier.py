"""Closed-loop cost against time of a step, over models, integrators, horizons and budgets."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dtcasadi.style import GREY, LINES, WIDTH_IN, finished, new_figure, styled

from .bench import Estimators, case_of, rti, timed_steps


@dataclass(frozen=True)
class Setting:
    """A controller of the chart; what is None is as in the scene.

    Attributes:
        kind: planar or spatial.
        label: what differs from the headline case.
        horizon: number of intervals.
        method: of integration.
        discs: of the model.
        iterations: budget of the quadratic program.
    """

    kind: str
    label: str
    horizon: int = 20
    method: str | None = None
    discs: int | None = None
    iterations: int | None = None


SETTINGS = (
    Setting("planar", "4 discs, N = 20, ros2"),
    Setting("planar", "N = 40", horizon=40),
    Setting("planar", "N = 10", horizon=10),
    Setting("planar", "N = 5", horizon=5),
    Setting("planar", "midpoint", method="midpoint"),
    Setting("planar", "ros1", method="ros1"),
    Setting("planar", "3 discs", discs=3),
    Setting("planar", "6 discs", discs=6),
    Setting("planar", "1 iteration", iterations=1),
    Setting("spatial", "4 discs, N = 20, ros2"),
    Setting("spatial", "N = 10", horizon=10),
    Setting("spatial", "N = 5", horizon=5),
    Setting("spatial", "midpoint", method="midpoint"),
    Setting("spatial", "3 discs", discs=3),
)


@styled
def chart(
    estimators: Estimators,
    path: str,
    report: Any,
    *,
    t_end: float = 4.0,
    settings: tuple[Setting, ...] = SETTINGS,
) -> Path:
    """Measure and draw.

    Args:
        estimators: scene -> the filter of its loop.
        path: a .png, .svg or .pdf file.
        report: where each point is recorded.
        t_end: of each loop [s].
        settings: the points.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    report.section("frontier", "closed-loop cost against time of a step")
    points: list[tuple[Setting, float, float]] = []
    for setting in settings:
        case = case_of(
            setting.kind,
            estimators,
            method=setting.method,
            discs=setting.discs,
            horizon=setting.horizon,
        )
        loop = case.run(rti(case.found, iterations=setting.iterations), t_end)
        times = timed_steps(case.found, loop, 300, iterations=setting.iterations)
        ms = 1e3 * float(np.median(times))
        report.row(
            "points",
            "{kind:8} {label:26} {median_ms:>9} ms  J {cost:>9}",
            kind=setting.kind,
            label=setting.label,
            median_ms=ms,
            cost=loop.cost,
        )
        report.write_json()
        points.append((setting, ms, loop.cost))
    draw(points, path)
    return Path(path)


@styled
def draw(points: list[tuple[Setting, float, float]], path: str | Path) -> Any:
    """Draw the points (setting, ms, cost), a panel for each kind."""
    figure = new_figure(0.75 * WIDTH_IN, 4.0, layout="constrained")
    kinds = list(dict.fromkeys(setting.kind for setting, *_ in points))
    panels = figure.subplots(1, len(kinds), squeeze=False)[0]
    for axes, kind in zip(panels, kinds, strict=True):
        _panel(axes, kind, [row for row in points if row[0].kind == kind])
    finished(figure, path)
    return figure


def _panel(axes: Any, kind: str, rows: list[tuple[Setting, float, float]]) -> None:
    best, front = np.inf, []
    for setting, ms, cost in sorted(rows, key=lambda row: row[1:]):
        better = cost < best
        if better:
            best = cost
            front.append((ms, cost))
        axes.plot(ms, cost, "o" if better else "s", color=LINES[not better], ms=5)
        axes.annotate(
            setting.label, (ms, cost), textcoords="offset points", xytext=(5, 4), fontsize=8
        )
    axes.plot(*np.array(front).T, color=GREY, ls="--", lw=1, zorder=0, label="frontier")
    axes.set_xscale("log")
    axes.margins(x=0.3, y=0.15)
    axes.set_xlabel("time of a step [ms]")
    axes.set_ylabel("closed-loop cost")
    axes.set_title(kind)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
