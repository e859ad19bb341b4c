"""Error against cost of everything an adviser has measured."""

from pathlib import Path

import numpy as np

from ..style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    WIDTH_IN,
    finished,
    new_figure,
    styled,
)
from .candidate import STATICS
from .front import Advice, described

_COLOURS = {
    STATICS: GREEN,
    "heun": SKY,
    "rk4": BLUE,
    "ros2": ORANGE,
    "rodas4": VERMILION,
    "auto": GREY,
}
# Of the tolerance: models closer than this to the reference, such as its own, are not shown.
LEAST = 1e-3
_NAMES = {STATICS: "at rest at each instant", "auto": "rodas4, adaptive"}


@styled
def picture(advice: Advice, path: Path) -> Path:
    """Draw it.

    Raises:
        PictureError: a suffix that is not known.
        OSError: the file cannot be written.
    """
    figure = new_figure(WIDTH_IN, 0.5 * WIDTH_IN, layout="constrained")
    axes = figure.add_subplot()
    least = LEAST * advice.tolerance
    shown = [m for m in advice.candidates if least < m.error < np.inf and m.cost < np.inf]
    sizes = sorted({found.candidate.n_discs for found in shown})
    for method, colour in _COLOURS.items():
        mine = [found for found in shown if found.candidate.method == method]
        if not mine:
            continue
        full = [m.candidate.velocity_terms == "full" or method == STATICS for m in mine]
        points = np.array([(max(found.cost, 1.0), found.error) for found in mine])
        faces = [colour if is_full else "white" for is_full in full]
        area = [20 + 60 * sizes.index(m.candidate.n_discs) / max(len(sizes) - 1, 1) for m in mine]
        axes.scatter(
            points[:, 0], points[:, 1], s=area, c=faces, edgecolors=colour, linewidths=1.2, zorder=3
        )
        axes.scatter([], [], s=36, c=colour, label=_NAMES.get(method, method))
    axes.scatter([], [], s=36, c="white", edgecolors=BLACK, label="without velocity terms")
    axes.axhline(advice.tolerance, color=BLACK, linewidth=0.8, linestyle="--")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.annotate(
        f"tolerance {advice.tolerance:g}",
        (1.0, advice.tolerance),
        xycoords=("axes fraction", "data"),
        xytext=(-2, 3),
        textcoords="offset points",
        ha="right",
    )
    if advice.best is not None:
        best = advice.best
        axes.scatter(best.cost, best.error, s=190, facecolors="none", edgecolors=PURPLE, zorder=4)
        axes.scatter([], [], s=60, facecolors="none", edgecolors=PURPLE, label="advised")
        axes.set_title(f"{advice.given.name}: {described(best)}", loc="left")
    axes.set_xlabel("cost: instructions of a run" + _span(sizes))
    axes.set_ylabel(f"error of the {advice.quantity} over its range")
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    finished(figure, path)
    return path


def _span(sizes: list[int]) -> str:
    """What the sizes of the marks mean."""
    if len(sizes) < 2:
        return ""
    return f"; small marks {sizes[0]} discs, large ones {sizes[-1]}"
