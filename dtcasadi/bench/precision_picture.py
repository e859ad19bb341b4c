"""The chart of `dtcasadi bench work-precision`: error against time and evaluations, and models."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LINES,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    WIDTH_IN,
    finished,
    new_figure,
    styled,
)

if TYPE_CHECKING:
    from .precision_reference import Reference
    from .precision_runs import Point

# Lines with a name; all other methods are grey.
_OURS = {"auto": BLUE, "tsit5": VERMILION, "rodas4": GREEN, "radau5": PURPLE, "rk4": ORANGE}
_OTHERS = {"LSODA": (BLACK, "o"), "DOP853": (BLACK, "^"), "Radau": (BLACK, "s")}
_OTHERS |= {"cvodes": (SKY, "o"), "idas": (SKY, "s")}
_SMALLEST = 1e-13
# Behind a text that a curve may pass.
_PLATE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
_NEVER = "other solvers are nowhere faster between $10^{-2}$ and $10^{-9}$"


@styled
def picture(
    title: str,
    points: Sequence["Point"],
    references: Mapping[str, "Reference"],
    levels: Sequence[Mapping[str, Any]],
    path: str | Path | None,
) -> Figure:
    """Four panels: error over wall time, over evaluations; models; how long references agree.

    Args:
        title: of the scene.
        points: with their marks; the first one is on the scene's own model.
        references: by the model's label.
        levels: as in the JSON file.
        path: file to write, ending in .png, .svg or .pdf.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    figure = new_figure(WIDTH_IN, 7.8, layout="constrained")
    (wall, evaluations), (models, agreement) = figure.subplots(2, 2)
    own = [point for point in points if _model(point) == _model(points[0])]
    _methods(wall, own, "wall_s", 1e3)
    _frontier(wall, own)
    wall.set_xlabel("time to solution [ms]")
    wall.set_title(_verdict(levels), fontsize=8, color=GREY)
    _methods(evaluations, own, "evaluations", 1.0)
    evaluations.set_xlabel("evaluations of the state equation")
    for axes in (wall, evaluations):
        axes.set_ylabel("largest pose error along the run [lengths]")
    handles, labels = wall.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=6, title=title)
    _models(models, points)
    _agreement(agreement, references)
    return finished(figure, path)


def _model(point: "Point") -> tuple[str, str, int]:
    return point.chart, point.velocity_terms, point.n_discs


def _methods(axes: Axes, points: Sequence["Point"], key: str, factor: float) -> None:
    """A line for each method."""
    names = dict.fromkeys(point.method for point in points)
    named = [name for name in (*_OURS, *_OTHERS) if name in names]
    for name in [*(n for n in names if n not in named and n != "equilibrium"), *named]:
        rows = [p for p in points if p.method == name and getattr(p, key) > 0]
        if not rows:
            continue
        x = [getattr(p, key) * factor for p in rows]
        y = [max(p.error, _SMALLEST) for p in rows]
        if name in _OURS:
            width = 2.2 if name == "auto" else 1.3
            axes.loglog(x, y, color=_OURS[name], linewidth=width, marker=".", label=name)
        elif name in _OTHERS:
            colour, marker = _OTHERS[name]
            style = {"linestyle": "--", "linewidth": 0.9, "marker": marker, "markersize": 3.5}
            axes.loglog(x, y, color=colour, markerfacecolor="white", label=name, **style)
        else:
            axes.loglog(x, y, color="#cccccc", linewidth=0.7, zorder=1)
    axes.set_ylim(_SMALLEST / 3, 3)
    axes.grid(color="#eeeeee", linewidth=0.6)


def _frontier(axes: Axes, points: Sequence["Point"]) -> None:
    rows = sorted((p for p in points if p.on_frontier), key=lambda p: p.wall_s)
    x, y = [p.wall_s * 1e3 for p in rows], [max(p.error, _SMALLEST) for p in rows]
    style: dict[str, Any] = {"linewidth": 7, "alpha": 0.2, "solid_capstyle": "round", "zorder": 0}
    axes.plot(x, y, color=GREY, drawstyle="steps-post", label="frontier", **style)


def _verdict(levels: Sequence[Mapping[str, Any]]) -> str:
    """Where another solver is faster than all methods of this package."""
    lost = [row for row in levels if row["others_over_ours"] and row["others_over_ours"] < 1]
    if not lost:
        return _NEVER
    texts = [
        f"{row['others']} at $10^{{{round(np.log10(row['error']))}}}$ "
        f"({1 / row['others_over_ours']:.1f} x)"
        for row in lost
    ]
    return "faster than this package: " + ", ".join(texts)


def _models(axes: Axes, points: Sequence["Point"]) -> None:
    """What `auto` takes on each model against the error that is left, the model's own included."""
    groups: dict[tuple[str, str, int], list[Point]] = {}
    for point in points:
        if point.method == "auto":
            groups.setdefault(_model(point), []).append(point)
    base = _model(points[0])
    for i, (model, rows) in enumerate(groups.items()):
        x, y = [p.wall_s * 1e3 for p in rows], [max(p.total_error, _SMALLEST) for p in rows]
        colour = BLUE if model == base else LINES[i % len(LINES)]
        axes.loglog(x, y, marker=".", color=colour, label=_label(model, base))
    for point in points:
        if point.method == "equilibrium":
            place = (point.wall_s * 1e3, point.total_error)
            axes.loglog(*place, "*", color=BLACK, markersize=9, label="at rest at every instant")
            axes.loglog(place[0], point.error_end, "*", color=BLACK, mfc="white", markersize=9)
            axes.annotate("at the end", (place[0], point.error_end), (0, -12), fontsize=7,
                          ha="center", textcoords="offset points", bbox=_PLATE)  # fmt: skip
    for part in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
        part(_plain)
    axes.set_xlabel("time to solution with auto [ms]")
    axes.set_ylabel("error against the scene's own model [lengths]")
    axes.set_ylim(_SMALLEST / 3, 3)
    axes.grid(color="#eeeeee", linewidth=0.6)
    # Below: with many models, a corner that no curve passes through is not to be had.
    axes.legend(fontsize=7.5, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _plain(value: float, _: float) -> str:
    """Of a logarithmic axis of a decade or two: 1, 2, 5 and their tens."""
    return f"{value:g}" if f"{value:e}"[0] in "125" else ""


def _label(model: tuple[str, str, int], base: tuple[str, str, int]) -> str:
    """What is different in a model."""
    chart, velocity, n_discs = model
    parts = []
    if chart != base[0]:
        names = {"planar": "planar", "cardan": "in space"}
        parts.append(names.get(chart, f"chart {chart}"))
    if velocity != base[1]:
        text = "no velocity terms" if velocity == "none" else f"velocity terms {velocity}"
        parts.append(text)
    if n_discs != base[2]:
        parts.append(f"{n_discs} discs")
    return ", ".join(parts) or f"as given: {chart}, {n_discs} discs"


def _agreement(axes: Axes, references: Mapping[str, "Reference"]) -> None:
    """How far the two references are apart over time."""
    from .precision_reference import AGREEMENT

    for i, (label, reference) in enumerate(references.items()):
        gaps = np.maximum(reference.gaps, 1e-17)
        text = f"{label}: {' and '.join(reference.names)}"
        axes.semilogy(reference.times, gaps, color=LINES[i % len(LINES)], label=text)
        if reference.trusted < reference.t_end:
            axes.axvline(reference.trusted, color=LINES[i % len(LINES)], linewidth=0.8, ls=":")
    axes.axhline(AGREEMENT, color=GREY, linewidth=0.9, linestyle="--")
    axes.set_xlabel("time of the motion [s]")
    axes.set_ylabel("references apart [lengths]")
    axes.set_ylim(1e-17, 1e-5)
    axes.legend(fontsize=6.5, loc="upper left")
