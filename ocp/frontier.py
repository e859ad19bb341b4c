"""Closed-loop cost against time of a step, over models, integrators, horizons and budgets."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from dtcasadi.style import GREY, LINES, WIDTH_IN, finished, new_figure, styled

from .bench import Estimators, case_of, rti, timed_steps


@dataclass(frozen=True)
class Setting:
    """A controller of the chart; what is None is as in the scene.

    Attributes:
        kind: planar or spatial.
        label: what differs from the scene's controller.
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


# Places of a label against its point, tried one after the other [points].
_PLACES = tuple(
    (x, sign * y)
    for y in (0, 8, 20, 32, 44, 56, 68)
    for sign in (1, -1)
    for x in (8, -8, 0)
    if y or x
)

SETTINGS = (
    Setting("planar", "as is"),
    Setting("planar", "N = 40", horizon=40),
    Setting("planar", "N = 10", horizon=10),
    Setting("planar", "N = 5", horizon=5),
    Setting("planar", "midpoint", method="midpoint"),
    Setting("planar", "ros1", method="ros1"),
    Setting("planar", "3 discs", discs=3),
    Setting("planar", "6 discs", discs=6),
    Setting("planar", "1 iteration", iterations=1),
    Setting("spatial", "as is"),
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
    figure = new_figure(WIDTH_IN, 4.0, layout="constrained")
    kinds = list(dict.fromkeys(setting.kind for setting, *_ in points))
    panels = figure.subplots(1, len(kinds), squeeze=False)[0]
    chosen = [[row for row in points if row[0].kind == kind] for kind in kinds]
    for axes, kind, rows in zip(panels, kinds, chosen, strict=True):
        _panel(axes, kind, rows)
    figure.draw_without_rendering()  # settles where labels find room
    for axes, rows in zip(panels, chosen, strict=True):
        _labels(axes, rows)
    finished(figure, path)
    return figure


def _panel(axes: Any, kind: str, rows: list[tuple[Setting, float, float]]) -> None:
    best, front = np.inf, []
    for _, ms, cost in sorted(rows, key=lambda row: row[1:]):
        better = cost < best
        if better:
            best = cost
            front.append((ms, cost))
        axes.plot(ms, cost, "o" if better else "s", color=LINES[not better], ms=5)
    axes.plot(*np.array(front).T, color=GREY, ls="--", lw=1, zorder=0, label="frontier")
    axes.set_xscale("log")
    axes.margins(x=0.3, y=0.3)
    axes.set_xlabel("time of a step [ms]")
    axes.set_ylabel("closed-loop cost")
    axes.set_title(f"{kind}: 4 discs, N = 20, ros2, and what changes")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper left")


def _labels(axes: Any, rows: list[tuple[Setting, float, float]]) -> None:
    """A label beside each point, where it lies on no point and no other label."""
    at = axes.transData.transform([row[1:] for row in rows])
    taken = [Bbox.from_bounds(x - 5, y - 5, 10, 10) for x, y in at]
    taken.append(axes.get_legend().get_window_extent())
    style = {"textcoords": "offset points", "fontsize": 8, "va": "center", "zorder": 1}
    style["bbox"] = {"fc": "white", "ec": "none", "pad": 0.5}
    for setting, ms, cost in rows:
        for x, y in _PLACES:
            text = axes.annotate(
                setting.label,
                (ms, cost),
                xytext=(x, y),
                ha="left" if x > 0 else "right" if x < 0 else "center",
                arrowprops={"arrowstyle": "-", "color": GREY, "lw": 0.6} if abs(y) > 12 else None,
                **style,
            )
            text.get_window_extent()  # puts it in its place
            box = Text.get_window_extent(text)  # without its line
            inside = axes.bbox.x0 < box.x0 and box.x1 < axes.bbox.x1
            if (inside and not box.count_overlaps(taken)) or (x, y) == _PLACES[-1]:
                taken.append(box.padded(1))
                break
            text.remove()
