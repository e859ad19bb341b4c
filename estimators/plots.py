"""Pictures of filters at work: against time, and side by side with the truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from dtcasadi.logs import Log
from dtcasadi.style import BLACK, GREY, LINES, WIDTH_IN, finished, new_figure, styled

from .report import Result, Tip
from .truth import Truth

_AXES = "xyz"


@styled
def against_time(
    results: Sequence[Result], tip: Tip, truth: Truth | None, log: Log, path: str | Path
) -> Path:
    """Draw the tip and the contact force: truth, measurements, estimates with 2 sigma.

    Args:
        results: the filters' runs.
        tip: what is shown of the robot.
        truth: what really happened, if that is known.
        log: what was measured.
        path: a .png, .svg or .pdf file.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    figure = new_figure(WIDTH_IN, 5.6, layout="constrained")
    axes = figure.subplots(2, 3, sharex=True)
    for k, axis in enumerate(_AXES):
        top, bottom = axes[:, k]
        places = [1e3 * result.tip[:, k] for result in results]
        forces = [result.force[:, k] for result in results]
        if tip.marker:
            _dots(top, log, f"{tip.marker}.{axis}")
        for result, color in zip(results, LINES, strict=False):
            line = (result.track.t, color, result.title)
            _band(top, *line, 1e3 * result.tip[:, k], 1e3 * result.tip_sigma[:, k])
            _band(bottom, *line, result.force[:, k], result.force_sigma[:, k])
        if truth is not None:
            true = 1e3 * tip.places(truth.discrete, truth.x, truth.theta)[:, k]
            for panel, values, kept in ((top, true, places), (bottom, truth.force[:, k], forces)):
                panel.plot(truth.t, values, color=BLACK, ls="--", lw=1, label="truth", zorder=4)
                kept.append(values)
        _limits(top, places)
        _limits(bottom, forces)
        top.set_title(f"tip, {axis} [mm]")
        bottom.set_title(f"contact force, {axis} [N]")
        bottom.set_xlabel("time [s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    handles.append(Patch(facecolor=GREY, alpha=0.3, label="2 sigma"))
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 4))
    finished(figure, path)
    return Path(path)


def _dots(axes: Axes, log: Log, channel: str) -> None:
    """What a marker said."""
    if channel in log.channels:
        y = log.channels[channel]
        seen = np.isfinite(y)
        style = {"color": GREY, "marker": ".", "ls": "", "ms": 2.5, "alpha": 0.6}
        axes.plot(log.t[seen], 1e3 * y[seen], label="marker", zorder=1, **style)  # type: ignore[arg-type]


def _band(
    axes: Axes, t: np.ndarray, color: str, label: str, value: np.ndarray, sigma: np.ndarray
) -> None:
    axes.plot(t, value, color=color, label=label, zorder=3)
    axes.fill_between(t, value - 2 * sigma, value + 2 * sigma, color=color, alpha=0.2, lw=0)
    axes.grid(alpha=0.3)


def _limits(axes: Axes, values: list[np.ndarray]) -> None:
    """Room for what happens after the first twentieth, whose bands are wide."""
    late = np.concatenate([v[len(v) // 20 :] for v in values])
    margin = 0.15 * float(np.ptp(late)) or 0.1
    axes.set_ylim(late.min() - margin, late.max() + margin)
