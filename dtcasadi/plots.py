"""Pictures of a run: a filmstrip (the paper's Fig. 3), coordinates (Fig. 4), energy and pressure.

Every function returns the matplotlib Figure and writes it where a path is given: PNG, SVG or PDF
by the file's suffix. pyplot is not used, so no display is needed and no global state changes.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .artists import SIGNS_HEIGHT, add_signs, legend_handles, set_stage, signs_width
from .motion import Motion, checked_times, telling_times
from .result import Run
from .style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILION,
    WIDTH_IN,
    finished,
    line_colours,
    new_figure,
    pressure_unit,
    styled,
)

_GREEK = {"alpha": "α", "beta": "β", "gamma": "γ", "psi": "ψ", "phi": "φ"}
_HEIGHT_IN = 4.6  # wanted height of a filmstrip
# Coordinates that were re-centred are converted one by one, a millisecond each.
_MOST_CONVERTED = 2000
_STILL = 1e-6  # a coordinate that changes less does not move [rad]


@styled
def filmstrip(
    run: Run,
    path: str | Path | None = None,
    times: Sequence[float] | None = None,
    view: str | None = None,
) -> Figure:
    """Frames of the robot at several times, the paper's Fig. 3: discs, threads, springs, chambers.

    Args:
        run: the run.
        path: file to write, ending in .png, .svg or .pdf.
        times: when to show it [s]; default: eight times, evenly spread along the way that the
            last disc has gone.
        view: `plane`, the root's y-z plane from the side; `3d`; by default the plane if the robot
            stays in it.

    Raises:
        PictureError: another suffix, an unknown view, or times outside the run.
        OSError: the file cannot be written.
    """
    moments = telling_times(run) if times is None else checked_times(run, times)
    motion = Motion.of(run, moments, view)
    figure, panels, columns = _grid(motion)
    for k, axes in enumerate(panels):
        below = k + columns < len(panels)
        set_stage(axes, motion.view, motion.box, left=k % columns == 0, bottom=not below)
        motion.artists_on(axes).show(*motion.frame(k))
        axes.set_title(motion.caption(k), pad=4)
    return finished(figure, path)


def _grid(motion: Motion) -> tuple[Figure, list[Axes], int]:
    """A figure with an equal panel for each frame, by rows, and how many fit in a row.

    Above the panels are the signs of gravity and scale, and the legend to the right of them.
    """
    n, (box_width, box_height) = len(motion.times), motion.box.size
    left, bottom = (0.72, 0.5) if motion.view.labels else (0.1, 0.1)
    title = 0.16 + 0.14 * max(len(motion.caption(k).splitlines()) for k in range(n))
    # Beside labelled axes there is room for the signs; else they stand above the first panel.
    top = SIGNS_HEIGHT + 0.05 - (title if motion.view.labels else 0.0)
    top = max(top, 0.35)
    right, gap, aspect = 0.1, 0.12, box_width / box_height  # [in]

    def heights(columns: int) -> tuple[float, float]:
        width = (WIDTH_IN - left - right - (columns - 1) * gap) / columns
        rows = math.ceil(n / columns)
        return width / aspect, rows * (width / aspect + title) + (rows - 1) * gap + bottom + top

    def cost(columns: int) -> float:
        return abs(heights(columns)[1] - _HEIGHT_IN) + 0.5 * (-n % columns)

    columns = min(range(1, n + 1), key=cost)
    height, total = heights(columns)
    width = height * aspect
    figure = new_figure(WIDTH_IN, total)
    panels = []
    for k in range(n):
        row, column = divmod(k, columns)
        x = left + column * (width + gap)
        y = total - top - (row + 1) * (height + title) - row * gap
        rectangle = (x / WIDTH_IN, y / total, width / WIDTH_IN, height / total)
        panels.append(figure.add_axes(rectangle))
    robot, signs = motion.run.model.robot, signs_width(motion.view)
    add_signs(figure, robot, motion.view, (0.03, total - SIGNS_HEIGHT - 0.03), width / box_width)
    handles = legend_handles(robot)
    figure.legend(
        handles.values(),
        handles,
        loc="center",
        bbox_to_anchor=((signs + WIDTH_IN) / 2 / WIDTH_IN, 1 - top / 2 / total),
        ncols=len(handles) if motion.view.labels or len(handles) <= 6 else 4,
        columnspacing=1.2,
        handlelength=1.7,
    )
    return figure, panels, columns


@styled
def coordinates(run: Run, path: str | Path | None = None) -> Figure:
    """Generalized coordinates against time, the paper's Fig. 4.

    One panel for each kind of coordinate, one line for each segment; coordinates that stay
    constant are named in the title instead. Where charts were re-centred on the way, coordinates
    are those about the robot's own A and B.

    Args:
        run: the run.
        path: file to write, ending in .png, .svg or .pdf.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    t, q = _coordinates(run)
    kinds: dict[str, list[tuple[int, int]]] = {}
    for row, name in enumerate(run.model.coordinate_names):
        kind, _, number = name.rpartition("_")
        kinds.setdefault(kind, []).append((row, int(number)))
    moving = {
        kind: rows
        for kind, rows in kinds.items()
        if any(np.ptp(q[row]) > _STILL for row, _ in rows)
    }
    shown = moving or kinds
    columns = 1 if len(shown) == 1 else 2
    lines = math.ceil(len(shown) / columns)
    figure = new_figure(WIDTH_IN, 0.9 + 2.5 * lines, layout="constrained")
    n_segments = run.model.n_discs - 1
    colours = line_colours(n_segments)
    axes = figure.subplots(lines, columns, sharex=True, squeeze=False)
    for place, (kind, rows) in zip(axes.flat, shown.items(), strict=False):
        for row, segment in rows:
            place.plot(t, q[row], color=colours[segment - 1], label=f"segment {segment}")
        place.set_ylabel(f"{_name(kind)} [rad]")
        time_axis(place, run)
    for place in axes.flat[len(shown) :]:
        place.remove()
    if len(shown) % columns:  # the panel above the gap has no neighbour below to carry its times
        axes[lines - 2, -1].tick_params(labelbottom=True)
    for place in axes.flat[max(len(shown) - columns, 0) : len(shown)]:
        place.set_xlabel("time [s]")
    _segment_legend(figure, colours)
    constant = [_name(kind) for kind in kinds if kind not in shown]
    if constant:
        axes[0, 0].set_title(f"constant: {', '.join(constant)}", loc="left", color=GREY)
    return finished(figure, path)


@styled
def energy_and_pressure(run: Run, path: str | Path | None = None) -> Figure:
    """Energies, chamber pressures, the power balance and the condition number of M against time.

    Args:
        run: the run.
        path: file to write, ending in .png, .svg or .pdf.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    figure = new_figure(WIDTH_IN, 5.4, layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    energy = run.energy
    potential = energy["potential"] - energy["potential"][0]
    for values, label, colour, dashes in (
        (energy["kinetic"], "kinetic", BLUE, "-"),
        (potential, "potential − start", VERMILION, "-"),
        (energy["supplied"], "supplied", GREEN, "--"),
        (energy["dissipated"], "dissipated", ORANGE, "-."),
        (energy["stored"] - energy["stored"][0], "in the actuator − start", PURPLE, ":"),
    ):
        if np.any(values) or "start" not in label:
            axes[0, 0].plot(energy["t"], values, dashes, color=colour, label=label)
    axes[0, 0].set_ylabel("energy [J]")
    legend_above(axes[0, 0], columns=2)
    draw_pressures(axes[0, 1], run)
    axes[1, 0].plot(energy["t"], energy["residual"], color=BLACK)
    axes[1, 0].set_ylabel("balance residual [J]")
    axes[1, 0].ticklabel_format(axis="y", scilimits=(-3, 4))
    finite = np.where(np.isfinite(run.condition), run.condition, np.nan)
    axes[1, 1].plot(energy["t"], finite, color=BLACK)
    if np.nanmax(finite, initial=1.0) > 20 * np.nanmin(finite, initial=np.inf):
        axes[1, 1].set_yscale("log")
    axes[1, 1].set_ylabel("condition number of M [-]")
    for place in axes.flat:
        time_axis(place, run)
    for place in axes[1]:
        place.set_xlabel("time [s]")
    return finished(figure, path)


def draw_pressures(axes: Axes, run: Run) -> None:
    """Chamber pressures against time, and their commands where they differ."""
    pressures, commands = run.pressure, run.u
    if run.model.actuator.command != "pressure":
        commands = pressures  # openings of valves: nothing to compare
    factor, unit = pressure_unit(float(np.abs([pressures, commands]).max(initial=0.0)))
    axes.set_ylabel(f"pressure [{unit}]")
    n_u = len(pressures)
    if not n_u:
        axes.text(0.5, 0.5, "no chambers", transform=axes.transAxes, ha="center", va="center")
        axes.set_yticks([])
        return
    colours = line_colours(n_u)
    lagging = not np.array_equal(pressures, commands)
    for k, (pressure, command, colour) in enumerate(zip(pressures, commands, colours, strict=True)):
        label = "chamber" if n_u == 1 else f"chamber {k + 1}"
        axes.plot(run.t, factor * pressure, color=colour, label=label, drawstyle=_steps(pressure))
        if lagging:
            name = "command" if n_u == 1 else f"command {k + 1}"
            axes.plot(
                run.t,
                factor * command,
                ":",
                color=colour,
                drawstyle=_steps(command),
                label=name if n_u <= 3 else None,
            )
    if lagging or 1 < n_u <= 6:
        legend_above(axes, columns=min(n_u * (2 if lagging and n_u <= 3 else 1), 3))
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.0), max(high, 0.0) * 1.05)


def _steps(values: np.ndarray) -> str:
    """How to join a pressure's samples: isolated changes are jumps, not ramps."""
    changes = np.diff(values) != 0
    return "default" if np.any(changes[1:] & changes[:-1]) else "steps-post"


def _coordinates(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Times and coordinates to draw, each about one A and B all along."""
    if not run.recentrings:
        return run.t, run.q
    some = run.at(
        run.t[np.unique(np.linspace(0, len(run.t) - 1, _MOST_CONVERTED).round().astype(int))]
    )
    return some.t, some.coordinates([chart.name for chart in run.model.charts])[0]


def time_axis(axes: Axes, run: Run) -> None:
    """From the start to the end of the run."""
    end = run.t[-1] if run.t[-1] > run.t[0] else run.t[0] + 1.0
    axes.set_xlim(run.t[0], end)
    axes.grid(color="#dddddd", linewidth=0.6)


def legend_above(axes: Axes, columns: int) -> None:
    """The legend above the axes, at their left end."""
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2)


def _segment_legend(figure: Figure, colours: Sequence) -> None:
    """One legend for all panels; of many segments the first, some between and the last."""
    n = len(colours)
    shown = range(n) if n <= 7 else np.unique(np.linspace(0, n - 1, 6).round().astype(int))
    axes = figure.axes[0]
    handles = [axes.plot([], [], color=colours[k])[0] for k in shown]
    labels = [f"segment {k + 1}" for k in shown]
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))


def _name(kind: str) -> str:
    """A kind of coordinate as people write it."""
    return _GREEK.get(kind, kind.replace("_", " "))
