"""The same motion whatever the chart: `dtcasadi.charts.convert` and the physical forces."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.cases import error, numbers
from oracles.chain import cartesian_accelerations, spread
from oracles.robots import coordinates, planar_robot, random_robot

import dtcasadi as dtc
from dtcasadi import charts as dtc_charts
from dtcasadi.robot import Damping


def wide(value: np.ndarray) -> float:
    """Largest entry."""
    return float(np.max(np.abs(value)))


def accelerations(robot, charts, q, qd, pressure) -> np.ndarray:
    """Accelerations of every disc, (6, n_discs): the model's qdd, the oracle's kinematics."""
    model = dtc.build(robot, chart=list(charts))
    qdd = numbers(model.forward_dynamics, q, qd, pressure, 0 * q, model.theta0)
    return np.vstack(numbers(cartesian_accelerations(robot, charts), q, qd, qdd))


@pytest.mark.parametrize("n", [2, 3, pytest.param(4, marks=pytest.mark.slow)])
def test_paper_and_cardan_accelerate_alike(rng, n):
    """Every force on: the discs' Cartesian accelerations do not know the chart."""
    robot = random_robot(rng, n)
    pressure = rng.uniform(1.0, 5.0, len(robot.chambers))
    paper, cardan = spread("paper", n), spread("cardan", n)
    q = coordinates(rng, paper)
    qd = rng.normal(size=len(q))
    moved, moved_rates = dtc_charts.convert(robot, q, qd, "paper", "cardan")
    expected = accelerations(robot, paper, q, qd, pressure)
    value = accelerations(robot, cardan, moved, moved_rates, pressure)
    # Round-off times the condition of either chart's M and rates, up to 1e4 here.
    assert error(value, expected) < 1e-11


@pytest.mark.parametrize(("source", "target"), [("paper", "cardan"), ("cardan", "paper")])
def test_conversion_and_back(rng, source, target):
    """Pose and rates survive the way there and back; angles may differ by whole turns."""
    robot = random_robot(rng, 3)
    q = coordinates(rng, spread(source, 3))
    qd = rng.normal(size=len(q))
    there = dtc_charts.convert(robot, q, qd, source, target)
    back, rates = dtc_charts.convert(robot, *there, target, source)
    before = dtc.build(robot, chart=source)
    after = dtc.build(robot, chart=target)
    for pose, moved in zip(
        numbers(before.poses, q, before.theta0),
        numbers(after.poses, there[0], after.theta0),
        strict=True,
    ):
        assert error(moved, pose) < 1e-12  # round-off
    again = numbers(before.poses, back, before.theta0)
    assert error(again[0], numbers(before.poses, q, before.theta0)[0]) < 1e-12
    if source == "cardan":  # within its middle angles' range the cardan chart is one to one
        # Rates pass through a chart of condition up to 1e2.
        assert error(back, q) < 1e-11
        assert error(rates, qd) < 1e-11


def test_planar_is_spatial_in_the_plane(rng):
    """A robot symmetric about the y-z plane stays in it and moves as the planar chart says."""
    n = 3
    robot = planar_robot(rng, n)
    planar, spatial = dtc.build(robot, chart="planar"), dtc.build(robot, chart="cardan")
    at = np.concatenate([[5 * i, 5 * i + 2] for i in range(n - 1)])  # beta and psi in `xy|xyz`
    q, qd = rng.uniform(-1.0, 1.0, 2 * (n - 1)), rng.normal(size=2 * (n - 1))
    full, full_rates = np.zeros(5 * (n - 1)), np.zeros(5 * (n - 1))
    full[at], full_rates[at] = q, qd
    pressure = rng.uniform(1.0, 5.0, 1)
    qdd = numbers(planar.forward_dynamics, q, qd, pressure, 0 * q, planar.theta0)
    value = numbers(spatial.forward_dynamics, full, full_rates, pressure, 0 * full, spatial.theta0)
    expected = np.zeros(5 * (n - 1))
    expected[at] = qdd
    assert error(value, expected) < 1e-11  # round-off times cond(M), about 1e3
    converted, converted_rates = dtc_charts.convert(robot, q, qd, "planar", "cardan")
    assert wide(converted - full) < 1e-12
    assert wide(converted_rates - full_rates) < 1e-12


def test_physical_damping_is_the_papers_in_the_plane(rng):
    """With c_a = c_b = b, c_r = 0 and any c_w: b qd in `planar` (the paper's section V)."""
    b = 3.0
    robot = planar_robot(rng, 4)
    springs = [replace(spring, damping=0.0) for spring in robot.springs]
    robot = replace(robot, springs=springs, damping=Damping(b, b, 7.0, 0.0))
    physical = dtc.build(robot, chart="planar")
    coordinate = dtc.build(robot, chart="planar", damping="coordinate")
    q, qd = rng.uniform(-1.0, 1.0, 6), rng.normal(size=6)
    assert error(numbers(physical.damping, q, qd, physical.theta0), b * qd) < 1e-13  # round-off
    assert error(numbers(coordinate.damping, q, qd, coordinate.theta0), b * qd) < 1e-13
