"""Picture of the air supply in a run: pressure against command, loops, flows."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .plots import draw_pressures, legend_above, time_axis
from .result import Run
from .style import (
    GREY,
    WIDTH_IN,
    finished,
    line_colours,
    new_figure,
    pressure_unit,
    styled,
)

_FLOWS = (("supply_flow", 1, "-", "supply"), ("exhaust_flow", -1, "--", "exhaust"))
_LEAK = ("leak_flow", -1, ":", "leak")


@styled
def air(run: Run, path: str | Path | None = None) -> Figure:
    """Pressures and commands, flows, pressure against command, and the tip against the pressure.

    Where walls have hysteresis, the tip's way up and down encloses the loop. The flows are drawn
    where the actuator has any, outflows downwards.

    Args:
        run: the run.
        path: file to write, ending in .png, .svg or .pdf.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    seen = run.air
    flows = [flow for flow in (*_FLOWS, _LEAK) if np.any(seen[flow[0]])]
    rows = 2 if run.model.n_u else 1
    figure = new_figure(WIDTH_IN, 2.9 * rows, layout="constrained")
    if rows == 1:
        draw_pressures(figure.subplots(), run)
        return finished(figure, path)
    axes = figure.subplots(rows, 2)
    draw_pressures(axes[0, 0], run)
    time_axis(axes[0, 0], run)
    axes[0, 0].set_xlabel("time [s]")
    _draw_flows(axes[0, 1], run, seen, flows)
    _draw_against_command(axes[1, 0], run, seen)
    _draw_tip(axes[1, 1], run, seen)
    return finished(figure, path)


def _draw_flows(axes: Axes, run: Run, seen: dict[str, np.ndarray], flows: list[tuple]) -> None:
    if not flows:
        axes.text(0.5, 0.5, "no flows", transform=axes.transAxes, ha="center", va="center")
        axes.set_axis_off()
        return
    colours = line_colours(run.model.n_u)
    largest = max(np.abs(seen[name]).max() for name, *_ in flows)
    factor, unit = (1e6, "mg/s") if largest < 1e-3 else (1e3, "g/s") if largest < 1 else (1, "kg/s")
    for name, sign, dashes, label in flows:
        for k, colour in enumerate(colours):
            label = label if run.model.n_u == 1 else f"{label} {k + 1}"
            values = sign * factor * seen[name][k]
            axes.plot(run.t, values, dashes, color=colour, label=label)
            label = label.split()[0]
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.set_ylabel(f"air flow into the chamber [{unit}]")
    axes.set_xlabel("time [s]")
    time_axis(axes, run)
    if run.model.n_u <= 2:
        legend_above(axes, columns=3 if run.model.n_u == 1 else 2)


def _draw_against_command(axes: Axes, run: Run, seen: dict[str, np.ndarray]) -> None:
    follows = run.model.actuator.command == "pressure"
    factor, unit = pressure_unit(float(np.abs(seen["pressure"]).max()))
    commands = factor * run.u if follows else run.u
    for k, colour in enumerate(line_colours(run.model.n_u)):
        axes.plot(commands[k], factor * seen["pressure"][k], color=colour)
    if follows:
        ends = [commands.min(), commands.max()]
        axes.plot(ends, ends, color=GREY, linewidth=0.8, zorder=0)
    axes.set_xlabel(f"command [{unit}]" if follows else "opening of the valve [-]")
    axes.set_ylabel(f"pressure [{unit}]")
    axes.grid(color="#dddddd", linewidth=0.6)


def _draw_tip(axes: Axes, run: Run, seen: dict[str, np.ndarray]) -> None:
    """Along the direction in which the last disc's centre moves most."""
    k = int(np.argmax(np.ptp(seen["pressure"], axis=1)))
    factor, unit = pressure_unit(float(np.abs(seen["pressure"][k]).max()))
    axes.plot(factor * seen["pressure"][k], 1e3 * tip_displacement(run), color=line_colours(1)[0])
    which = "" if run.model.n_u == 1 else f" of chamber {k + 1}"
    axes.set_xlabel(f"pressure{which} [{unit}]")
    axes.set_ylabel("tip displacement [mm]")
    axes.grid(color="#dddddd", linewidth=0.6)


def tip_displacement(run: Run) -> np.ndarray:
    """Of the last disc's centre of mass from its start, along its main direction, (n,) [m]."""
    R, r = run.poses()
    centre = np.asarray(run.model.robot.discs[-1].centre_of_mass, dtype=float)
    path = r[:, -1] + R[:, -1] @ centre
    path = path - path[0]
    _, _, directions = np.linalg.svd(path, full_matrices=False)
    along = path @ directions[0]
    return along if abs(along.max()) >= abs(along.min()) else -along
