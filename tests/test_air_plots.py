"""The picture of the air supply: legible, and what it draws."""

from dataclasses import replace

import drawn_runs
import numpy as np
import pytest
from air_robots import gas, robot, start
from legible import assert_legible

import dtcasadi as dtc
from dtcasadi import air_plots, plots
from dtcasadi.actuators import Hysteresis, PressureValve, Valve


def made(valve: Valve | PressureValve) -> dtc.Run:
    """Chambers that fill and empty in a robot that nods."""
    actuator = Hysteresis(gas(valve=valve), 1.0)
    model = dtc.build(robot(), chart="planar", inflation="volume", actuator=actuator)
    t = np.linspace(0.0, 3.0, 61)
    q = 0.05 + 0.02 * np.outer(np.arange(1, model.n_q + 1), 1 - np.cos(2 * t))
    run = drawn_runs.made_up(model, t, q, np.gradient(q, t, axis=1))
    x = run.x.copy()
    x[2 * model.n_q :] = start(model, np.zeros(model.n_q), 0.0)[2 * model.n_q :, np.newaxis]
    x[2 * model.n_q : 2 * model.n_q + 2] *= 1.3 + 0.1 * np.sin(2 * t)
    u = np.sign(np.sin(2 * t)) * np.array([[1.0], [0.5]])
    u = u if isinstance(valve, Valve) else 10 + 5 * u
    energy = run.energy | {"stored": np.sin(t)}
    return replace(run, x=x, u=u, energy=energy)


@pytest.fixture(scope="module", params=[Valve(), PressureValve(4.0)], ids=["opening", "pressure"])
def run(request) -> dtc.Run:
    return made(request.param)


@pytest.mark.parametrize("make", drawn_runs.ALL, ids=lambda make: make.__name__)
def test_it_is_legible_whatever_the_actuator(make):
    assert_legible(air_plots.air(make()))


def test_it_shows_flows_loops_and_commands(run, tmp_path):
    figure = air_plots.air(run, tmp_path / "air.png")
    assert_legible(figure)
    assert (tmp_path / "air.png").stat().st_size > 10_000
    pressures, flows, against, tip = figure.axes
    supply = flows.get_lines()[0].get_ydata()
    assert np.allclose(supply, 1e3 * run.air["supply_flow"][0])
    assert min(np.min(line.get_ydata()) for line in flows.get_lines()) < 0 < np.max(supply)
    follows = run.model.actuator.command == "pressure"
    assert against.get_xlabel().startswith("command" if follows else "opening")
    assert len(pressures.get_lines()) == (4 if follows else 2)  # openings are no pressures
    displacement = tip.get_lines()[0].get_ydata()
    assert displacement[0] == 0 and np.ptp(displacement) > 100  # [mm]


def test_stored_energy_is_drawn_where_there_is_some(run):
    labels = [line.get_label() for line in plots.energy_and_pressure(run).axes[0].get_lines()]
    assert "in the actuator − start" in labels
    labels = [
        line.get_label()
        for line in plots.energy_and_pressure(drawn_runs.seed()).axes[0].get_lines()
    ]
    assert "in the actuator − start" not in labels


def test_displacement_is_along_the_tips_main_direction():
    run = drawn_runs.seed()
    R, r = run.poses()
    tip = r[:, -1] + R[:, -1] @ np.asarray(run.model.robot.discs[-1].centre_of_mass)
    along = air_plots.tip_displacement(run)
    gone = np.linalg.norm(tip - tip[0], axis=1)
    assert along[0] == 0 and np.all(np.abs(along) <= gone + 1e-12)
    assert np.max(np.abs(along)) > 0.9 * np.max(gone)
