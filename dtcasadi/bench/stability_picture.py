"""The picture of `dtcasadi bench stability`: a map of scenes by methods."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from ..integrators import ONE_STEP
from ..style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    SKY,
    VERMILION,
    faded,
    finished,
    new_figure,
    styled,
)

# Pose error, in lengths, up to which a cell is called accurate.
ACCURATE = 1e-2
_GOOD, _STABLE, _UNKNOWN = faded(GREEN, 0.45), faded(SKY, 0.4), faded(BLUE, 0.12)
_REFUSED, _FAILED = faded(ORANGE, 0.45), faded(VERMILION, 0.55)
_LETTERS = {
    "energy": "E",
    "not_finite": "N",
    "newton": "I",
    "cost": "S",
    "singular": "R",
    "unfit": "-",
}
_LEGEND = (
    (_GOOD, "stable, pose error up to 0.01 lengths"),
    (_STABLE, "stable, error above"),
    (_UNKNOWN, "stable, error not known"),
    (_REFUSED, "refused: R the chart is singular there, - not for such models"),
    (_FAILED, "failed: E energy, N not finite, I iteration, S too many steps, F other"),
)
# Families of fixed-step methods, each by its first method; before the first: steps of their own.
_FAMILIES = {"euler": "explicit", "ros1": "linearly implicit", "sdirk2": "implicit"}
_FAMILIES |= {"gauss2": "symplectic"}
_OWN = "steps of their own"
_CELL_W, _CELL_H, _LEFT, _TOP, _BOTTOM = 0.36, 0.235, 1.95, 0.85, 1.15


@styled
def picture(
    cells: Mapping[str, Mapping[str, Mapping[str, Any]]],
    methods: Sequence[str],
    path: str | Path | None,
) -> Figure:
    """Rows are scenes, columns methods; a number is the largest stable step in ms.

    Args:
        cells: by scene and method, as in the JSON file.
        methods: the columns.
        path: file to write, ending in .png, .svg or .pdf.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    n, m = len(cells), len(methods)
    width, height = _LEFT + _CELL_W * max(m, 16) + 0.35, _TOP + _CELL_H * n + _BOTTOM
    figure = new_figure(width, height)
    place = (_LEFT / width, _BOTTOM / height, _CELL_W * m / width, _CELL_H * n / height)
    axes = figure.add_axes(place)
    axes.set_xlim(0, m)
    axes.set_ylim(n, 0)
    for y, row in enumerate(cells.values()):
        for x, method in enumerate(methods):
            _cell(axes, x, y, row[method], fixed=method in ONE_STEP)
    axes.set_xticks([x + 0.5 for x in range(m)], methods, rotation=60, ha="left", va="bottom")
    axes.xaxis.tick_top()
    axes.set_yticks([y + 0.5 for y in range(n)], [name.replace("_", " ") for name in cells])
    axes.tick_params(length=0, labelsize=8, pad=2)
    for spine in axes.spines.values():
        spine.set_visible(False)
    _families(axes, methods, n)
    patches = [Patch(facecolor=colour, label=text) for colour, text in _LEGEND]
    figure.legend(handles=patches, loc="lower left", ncols=2, fontsize=7.5, columnspacing=1.2)
    return finished(figure, path)


def _cell(axes: Axes, x: int, y: int, cell: Mapping[str, Any], *, fixed: bool) -> None:
    error, step = cell["error"], cell["max_stable_step_s"]
    if cell["status"] == "ok":
        colour = _UNKNOWN if error is None else _GOOD if error <= ACCURATE else _STABLE
        if fixed:
            text = f"{step * 1e3:.2g}" if step < 0.1 else f"{step * 1e3:.0f}"
        else:
            text = "" if error is None else _power(error)
    else:
        colour = _REFUSED if cell["status"] == "refused" else _FAILED
        text = _LETTERS.get(cell.get("kind", ""), "F")
    axes.add_patch(Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", linewidth=0.8))
    axes.text(x + 0.5, y + 0.53, text, ha="center", va="center", fontsize=6.5, color=BLACK)


def _power(error: float) -> str:
    """An error as a power of ten."""
    return f"$10^{{{math.ceil(math.log10(max(error, 1e-16)))}}}$"


def _families(axes: Axes, methods: Sequence[str], n: int) -> None:
    """The name of each family of methods below its columns, and a line between two of them."""
    order, family = list(ONE_STEP), []
    starts = [order.index(name) for name in _FAMILIES]
    for name in methods:
        if name in ONE_STEP:
            k = max(i for i, start in enumerate(starts) if start <= order.index(name))
            family.append(list(_FAMILIES.values())[k])
        else:
            family.append(_OWN)
    for name in dict.fromkeys(family):
        start, count = family.index(name), family.count(name)
        what = "pose error" if name == _OWN else "step [ms]"
        text = f"{name}:\n{what}" if count > 1 else ""
        axes.text(start + count / 2, n + 0.15, text, ha="center", va="top", fontsize=7.5)
        if start:
            axes.plot([start, start], [0, n], color=BLACK, linewidth=0.9, clip_on=False)
