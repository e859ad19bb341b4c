"""Pictures of closed loops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from dtcasadi.animate import animate
from dtcasadi.errors import ControlError
from dtcasadi.stepped import run_of_steps
from dtcasadi.style import BLACK, GREY, LINES, ORANGE, WIDTH_IN, finished, new_figure, styled

from .closed_loop import Loop
from .scenario import Experiment

# Unit of a channel -> factor and unit of the picture.
_SHOWN = {"m": (1e3, "mm"), "rad": (180 / np.pi, "deg"), "": (1.0, "")}
# Predictions drawn, at most.
_HORIZONS = 40


@styled
def picture(loop: Loop, path: str | Path | None = None, *, title: str = "") -> Figure:
    """Outputs with references and predictions, commands with limits, and the time of each call.

    Args:
        loop: what happened.
        path: a .png, .svg or .pdf file, if it is to be written.
        title: over the picture.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    n = len(loop.stages.channels)
    figure = new_figure(WIDTH_IN, 1.9 * n + 3.2, layout="constrained")
    axes = figure.subplots(n + 2, 1, sharex=True, height_ratios=[1.5] * n + [1.2, 0.8])
    for k in range(n):
        _output(axes[k], loop, k)
    _commands(axes[n], loop)
    _times(axes[n + 1], loop)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(loop.t[0], loop.t[-1])
    if title:
        figure.suptitle(title, fontsize=10)
    return finished(figure, path)


def _output(axes: Axes, loop: Loop, k: int) -> None:
    name, unit = loop.stages.channels[k]
    factor, shown = _SHOWN.get(unit, (1.0, unit))
    h = loop.stages.discrete.step_s
    every = max(1, len(loop.t) // _HORIZONS)
    ahead = h * np.arange(loop.stages.horizon + 1)
    label: str | None = "predicted"
    for i in range(0, len(loop.t), every):
        plan = loop.predicted(i)
        if plan is not None:
            line = {"color": ORANGE, "lw": 0.7, "alpha": 0.8, "label": label}
            axes.plot(loop.t[i] + ahead, factor * plan[:, k], zorder=2, **line)  # type: ignore[arg-type]
            label = None
    axes.plot(loop.t, factor * loop.reference[:, k], color=BLACK, ls="--", lw=1, label="reference")
    axes.plot(loop.t, factor * loop.y[:, k], color=LINES[0], label="true output", zorder=4)
    _room(axes, factor * np.concatenate([loop.y[:, k], loop.reference[:, k]]))
    words = name.replace(".", " ")
    axes.set_ylabel(f"{words} [{shown}]" if shown else words)
    _legend(axes)


def _commands(axes: Axes, loop: Loop) -> None:
    s = loop.stages
    for k in range(s.n_u):
        label = "command" if s.n_u == 1 else f"command {k + 1}"
        color = LINES[k % len(LINES)]
        axes.plot(loop.t, 1e-3 * loop.u[:, k], drawstyle="steps-post", color=color, label=label)
    limits = np.unique(np.concatenate([s.lower[0], s.upper[0]]))
    for i, limit in enumerate(limits[np.isfinite(limits)]):
        axes.axhline(1e-3 * limit, color=GREY, ls=":", lw=1, label="" if i else "limits")
    _room(axes, 1e-3 * np.concatenate([loop.u.ravel(), limits[np.isfinite(limits)]]))
    axes.set_ylabel("pressure [kPa]")
    _legend(axes)


def _times(axes: Axes, loop: Loop) -> None:
    ms = 1e3 * np.maximum(loop.seconds[1:], 1e-7)  # the first call builds and compiles
    median = float(np.median(ms))
    axes.semilogy(loop.t[1:], ms, ".", ms=2.5, color=GREY)
    axes.axhline(median, color=BLACK, lw=1, label=f"median {median:.3g} ms")
    # Whole decades: labels between them would lie on each other where all calls take alike.
    low, high = np.floor(np.log10(np.min(ms))), np.ceil(np.log10(np.max(ms)))
    axes.set_ylim(10**low, 10 ** max(high, low + 1))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("call [ms]")
    _legend(axes)


def _legend(axes: Axes) -> None:
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8)


def _room(axes: Axes, values: np.ndarray) -> None:
    low, high = float(np.min(values)), float(np.max(values))
    margin = 0.08 * (high - low) or 0.1
    axes.set_ylim(low - margin, high + margin)


def film(loop: Loop, experiment: Experiment, path: str | Path, **options: object) -> Path:
    """The true robot moving, with the last disc's path as the plan in force predicts it.

    Args:
        loop: what happened.
        experiment: what it was done with.
        path: a .gif or .mp4 file.
        options: of `dtcasadi.animate`.

    Raises:
        ControlError: the controller's model has no poses to draw.
        PictureError: another suffix, or ffmpeg is missing or fails.
        OSError: the file cannot be written; an older one is left as it was.
    """
    model = getattr(loop.stages.discrete, "model", None)
    if model is None:
        raise ControlError("film: expected a model of a robot, got one without poses")
    poses = model.compiled("poses")
    run = run_of_steps(experiment.robot, loop.t, loop.x, loop.u, loop.theta)

    def ahead(t: float) -> np.ndarray:
        k = min(int(np.searchsorted(loop.t, t + 1e-9, side="right")) - 1, len(loop.t) - 1)
        states = loop.told[k].states
        if not np.any(states):
            return np.zeros((0, 3))
        theta = np.asarray(loop.estimate[k].theta)[: len(model.theta0)]
        centre = model.robot.discs[-1].centre_of_mass
        points = []
        for x in states:
            R, r = poses(x[: model.n_q], theta)
            points.append(r[:, -1] + R[:, -3:] @ centre)
        return np.array(points)

    return animate(run, path, ahead=ahead, **options)  # type: ignore[arg-type]
