"""The picture of `dtcasadi bench accuracy`: error against number of discs, and against cost."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, StrMethodFormatter

from ..style import GREY, WIDTH_IN, finished, line_colours, new_figure, styled

_SHOWN = {
    "inflated_tube": "inflated tube with a strip, bend",
    "beck": "Beck's column, flutter load",
    "euler": "Euler's column, buckling load",
    "cantilever_f1": "cantilever, first frequency",
    "tip_load_1_drop": "tip load $PL^2/EI = 1$, drop",
    "heavy_elastica_5_drop": "heavy elastica $qL^3/EI = 5$, drop",
}
_MARKERS = "PosD^v"


@styled
def picture(
    anchors: Mapping[str, Any], cost: Mapping[int, Mapping[str, Any]], path: str | Path | None
) -> Figure:
    """Relative errors of some anchors over the number of segments, and over the time of a call.

    Args:
        anchors: as in the JSON file.
        cost: by number of discs; without times there is one panel.
        path: file to write, ending in .png, .svg or .pdf.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    timed = all("ode_us" in each for each in cost.values())
    figure = new_figure(WIDTH_IN, 3.9, layout="constrained")
    panels = figure.subplots(1, 2 if timed else 1, sharey=True, squeeze=False)[0]
    sizes = sorted(cost)
    segments = [n - 1 for n in sizes]
    _errors(panels[0], anchors, sizes, segments)
    slope = 1.2 * (segments[0] / np.array(segments)) ** 2
    panels[0].loglog(segments, slope, color=GREY, linestyle=":", label="order 2")
    panels[0].set_xticks(segments, [str(n) for n in sizes])
    panels[0].minorticks_off()
    panels[0].set_xlabel("number of discs")
    panels[0].set_ylabel("relative error, absolute value")
    if timed:
        _errors(panels[1], anchors, sizes, [cost[n]["ode_us"] for n in sizes])
        panels[1].xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panels[1].minorticks_off()
        panels[1].xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        panels[1].set_xlabel("one call of the state equation, compiled [μs]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return finished(figure, path)


def _errors(axes: Axes, anchors: Mapping[str, Any], sizes: list[int], x: Sequence[float]) -> None:
    """One line for each anchor over x."""
    for (name, label), colour, marker in zip(
        _SHOWN.items(), line_colours(len(_SHOWN)), _MARKERS, strict=True
    ):
        rows = anchors[name]["by_discs"]
        errors = [abs(rows[str(n)]["relative_error"]) for n in sizes]
        axes.loglog(x, errors, color=colour, marker=marker, markersize=4, label=label)
    axes.grid(color="#dddddd", linewidth=0.6)
