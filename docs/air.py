"""The picture of the air supply: a fast inflation with gas against a regulator, and the loops."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import dtcasadi as dtc
from dtcasadi.air_plots import tip_displacement
from dtcasadi.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    VERMILION,
    WIDTH_IN,
    finished,
    new_figure,
    styled,
)

HIGHEST, STEP_AT, END = 20e3, 0.05, 0.6  # [Pa], [s], [s]
LAG = 0.057  # of the regulator, in which the gas too reaches 63 % [s]
SLOW, FAST = 40.0, 10.0  # duration of a cycle [s]


@styled
def draw(path: Path) -> None:
    """Pressure, tip and flows after a step, and the tip against slowly changing pressure."""
    figure = new_figure(WIDTH_IN, 5.6, layout="constrained")
    axes = figure.subplots(2, 2)
    scene = dtc.load_scene("tentacle_air")
    step = dtc.Profile([0.0, STEP_AT], [0.0, HIGHEST])
    fast = replace(scene, pressure=step, t_end=END)
    runs = {
        "gas through valves": (solved(fast), BLUE),
        f"regulator, lag {LAG:g} s": (solved(fast, worn(dtc.Regulator(LAG))), VERMILION),
    }
    stepped(axes[0, 0], axes[0, 1], runs)
    flows(axes[1, 0], runs["gas through valves"][0])
    loops(axes[1, 1], scene)
    finished(figure, path)


def solved(scene: dtc.Scene, actuator: dtc.Actuator | None = None) -> dtc.Run:
    """A run of the scene, with another actuator where one is given."""
    if actuator is not None:
        scene = replace(scene, options={**scene.options, "actuator": actuator})
    run = dtc.simulate(scene, method="LSODA")
    assert run.success, run.message
    return run


def worn(source: dtc.Actuator) -> dtc.Actuator:
    """With the scene's hysteresis."""
    return dtc.Hysteresis(source, amplitude=1e3, travel=0.01)


def stepped(pressures: Axes, tips: Axes, runs: dict[str, tuple[dtc.Run, str]]) -> None:
    """The command at once to 20 kPa."""
    for name, (run, colour) in runs.items():
        pressures.plot(run.t, 1e-3 * run.pressure[0], color=colour, label=name)
        tips.plot(run.t, 1e3 * tip_displacement(run), color=colour, label=name)
    steps = [0.0, STEP_AT, STEP_AT, END]
    pressures.plot(steps, [0, 0, 20, 20], ":", color=BLACK, label="command")
    pressures.set_ylabel("pressure [kPa]")
    tips.set_ylabel("tip displacement [mm]")
    for axes in (pressures, tips):
        axes.set_xlabel("time [s]")
        axes.set_xlim(0.0, END)
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.legend(loc="lower right")


def flows(axes: Axes, run: dtc.Run) -> None:
    """Into and out of the chamber."""
    seen = run.air
    axes.plot(run.t, 1e3 * seen["supply_flow"][0], color=GREEN, label="from the supply, choked")
    axes.plot(run.t, -1e3 * seen["exhaust_flow"][0], color=ORANGE, label="to the exhaust")
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("air flow into the chamber [g/s]")
    axes.set_xlim(0.0, END)
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.legend(loc="upper right")


def loops(axes: Axes, scene: dtc.Scene) -> None:
    """Up and down twice, slowly and four times as fast; without hysteresis for comparison."""
    regulator = dtc.Regulator(0.02)
    for actuator, period, label, style in (
        (worn(regulator), SLOW, f"hysteresis, {SLOW:g} s a cycle", {"color": BLUE}),
        (worn(regulator), FAST, f"{FAST:g} s a cycle", {"color": ORANGE, "linestyle": "--"}),
        (regulator, SLOW, "no hysteresis", {"color": GREY, "linewidth": 0.9}),
    ):
        times = period * np.array([0.0, 0.5, 1.0, 1.5, 1.75, 2.0])
        command = dtc.Profile(times, HIGHEST * np.array([0, 1, 0, 1, 0.5, 0.9]), "linear")
        run = solved(replace(scene, pressure=command, t_end=2 * period), actuator)
        axes.plot(1e-3 * run.pressure[0], 1e3 * tip_displacement(run), label=label, **style)
    axes.set_xlabel("pressure [kPa]")
    axes.set_ylabel("tip displacement [mm]")
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.legend(loc="lower right")
