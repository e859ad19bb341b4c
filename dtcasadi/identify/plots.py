"""A picture of an identification: the fit, what it leaves, the intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..errors import IdentificationError
from ..style import BLUE, GREY, VERMILION, faded, finished, new_figure, styled
from .result import Identified
from .whiteness import LAGS, autocorrelation

MOST = 4
_SHOWN = 0.02  # of the liveliest channel's swing: what moves less is not drawn
_UNITS = {"m": (1e3, "mm"), "rad": (180 / np.pi, "deg"), "Pa": (1e-3, "kPa")}
_LARGE = 1.0  # of metres, which are then not shown in millimetres


@styled
def picture(
    found: Identified, path: str | Path | None = None, *, channels: Sequence[str] = ()
) -> Figure:
    """Draw readings and model, residuals, their autocorrelation, and the parameters.

    Args:
        found: what was identified.
        path: where to write it; default: nowhere.
        channels: names of channels; default: those that move most against their noise.

    Raises:
        IdentificationError: an unknown channel.
    """
    chosen = [_index(found, name) for name in channels] or _liveliest(found)
    n = len(chosen)
    figure = new_figure(9.0, 1.6 * n + 2.6, layout="constrained")
    grid = figure.add_gridspec(n + 1, 2, height_ratios=[*[1.0] * n, 1.3], width_ratios=[1.6, 1.0])
    for row, k in enumerate(chosen):
        left, right = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
        _fit(left, found, k, first=row == 0)
        _residuals(right, found, k)
        if row == 0:
            left.set_title("readings and fitted model")
            right.set_title("residuals / noise, 95 % between the lines")
        for axes in (left, right):
            axes.tick_params(labelbottom=row == n - 1)
        if row == n - 1:
            left.set_xlabel("time [s]")
            right.set_xlabel("time [s]")
    _intervals(figure.add_subplot(grid[n, 0]), found)
    _colours(figure.add_subplot(grid[n, 1]), found, chosen)
    return finished(figure, path)


def _index(found: Identified, name: str) -> int:
    if name not in found.problem.names:
        known = ", ".join(found.problem.names)
        raise IdentificationError(f"channels: expected some of {known}, got {name!r}")
    return found.problem.names.index(name)


def _liveliest(found: Identified) -> list[int]:
    """The channels whose model varies most against the noise, in their own order."""
    sigma = np.sqrt(np.diag(found.problem.R_v))
    spans = [
        np.array([np.ptp(c[np.isfinite(c)]) if np.isfinite(c).any() else 0.0 for c in fit.h.T])
        for fit in found.fits
    ]
    swing = np.max(spans, axis=0) / sigma
    order = [k for k in np.argsort(-swing)[:MOST].tolist() if swing[k] > _SHOWN * swing.max()]
    return sorted(order)


def _fit(axes: Any, found: Identified, k: int, *, first: bool) -> None:
    unit = found.problem.units[k]
    largest = max(float(np.nanmax(np.abs(fit.y[:, k]), initial=0.0)) for fit in found.fits)
    factor, unit = (
        (1.0, unit) if unit == "m" and largest > _LARGE else _UNITS.get(unit, (1.0, unit))
    )
    for fit in found.fits:
        there = np.isfinite(fit.y[:, k])
        axes.plot(
            fit.t[there],
            factor * fit.y[there, k],
            ".",
            ms=4,
            color=faded(GREY, 0.5),
            label="measured",
        )
        seen = np.isfinite(fit.h[:, k])
        axes.plot(fit.t[seen], factor * fit.h[seen, k], color=BLUE, lw=1.0, label="model")
    axes.set_ylabel(f"{found.problem.names[k]} [{unit}]" if unit else found.problem.names[k])
    if first:
        handles, labels = axes.get_legend_handles_labels()
        axes.legend(handles[:2], labels[:2], loc="best")


def _residuals(axes: Any, found: Identified, k: int) -> None:
    sigma = float(np.sqrt(found.problem.R_v[k, k]))
    for fit in found.fits:
        axes.plot(fit.t, (fit.h[:, k] - fit.y[:, k]) / sigma, ".", ms=2.5, color=GREY)
    for level in (-2, 2):
        axes.axhline(level, color=VERMILION, lw=0.8)
    axes.axhline(0, color="black", lw=0.6)


def _intervals(axes: Any, found: Identified) -> None:
    """Each value over its start, with its interval; open ones are arrows."""
    places = np.arange(len(found.names))[::-1]
    scale = np.where(found.starts != 0, found.starts, 1.0)
    relative = found.values / scale
    ends = found.intervals / scale[:, np.newaxis]
    finite = np.all(np.isfinite(ends), axis=1) & (ends[:, 1] < 5 * np.abs(relative))
    for k, y in enumerate(places):
        if finite[k]:
            axes.plot(ends[k], [y, y], color=BLUE, lw=3, solid_capstyle="butt")
            axes.plot(relative[k], y, "o", color=BLUE, ms=4)
        else:
            axes.text(relative[k], y, "not determined", color=VERMILION, va="center", ha="center")
    axes.axvline(1.0, color=GREY, lw=0.8, ls="--")
    axes.set_yticks(places, [_labelled(found, k) for k in range(len(found.names))])
    axes.set_ylim(-0.6, len(found.names) - 0.4)
    axes.margins(x=0.1)
    axes.set_xlabel("value over its start (dashed)")
    axes.set_title(f"{100 * found.level:g} % intervals")


def _labelled(found: Identified, k: int) -> str:
    unit = "" if found.units[k] == "x start" else f" {found.units[k]}"
    low, high = found.intervals[k]
    return f"{found.names[k]}\n{low:.4g} to {high:.4g}{unit}"


def _colours(axes: Any, found: Identified, chosen: Sequence[int]) -> None:
    """Autocorrelations of the residuals with the band of white noise."""
    lags = np.arange(1, LAGS + 1)
    shortest = np.inf
    for k in chosen:
        rows = [fit.h[:, k] - fit.y[:, k] for fit in found.fits]
        row = max((row[np.isfinite(row)] for row in rows), key=len)
        if len(row) > 2 * LAGS:
            shortest = min(shortest, len(row))
            axes.plot(lags, autocorrelation(row), ".-", lw=0.8, ms=4, label=found.problem.names[k])
    if np.isfinite(shortest):
        for side in (-1, 1):
            axes.axhline(side * 1.96 / np.sqrt(shortest), color=VERMILION, lw=0.8)
        axes.legend(loc="upper right", fontsize=7, ncols=2)
    axes.axhline(0, color="black", lw=0.6)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -0.3), max(high, 0.5))
    axes.set_xlabel("lag [readings]")
    axes.set_title("autocorrelation of residuals")
