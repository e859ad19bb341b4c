"""The scheduled observer: one subsystem is the steady Kalman filter; branches; no jumps; faults."""

from dataclasses import replace

import numpy as np
import pytest
from linear_toy import LinearDiscrete

import dtcasadi as dtc
from dtcasadi.errors import EstimationError
from dtcasadi.presets import seed_four_disc
from dtcasadi.sensors import Marker, PressureSensor
from estimators import EKF, SPV, OperatingPoints, ProcessNoise, operating_points

N = 4


def toy_of(*, two: bool = False) -> LinearDiscrete:
    rng = np.random.default_rng(3)
    F = np.eye(N) + 0.2 * rng.normal(size=(N, N))
    F /= 1.02 * np.max(np.abs(np.linalg.eigvals(F)))
    root = rng.normal(size=(2, 2))
    measured = {"a": (rng.normal(size=(2, N)), np.zeros((2, 2)), root @ root.T + np.eye(2))}
    if two:
        measured["b"] = (rng.normal(size=(1, N)), np.array([[0.5, 0]]), np.array([[0.3]]))
    blocks = {"push": slice(0, 1), "other": slice(1, 2)}
    G, B = rng.normal(size=(N, 1)), rng.normal(size=(N, 2))
    return LinearDiscrete(F, G, B, measured, np.array([0.2, 0.4]), blocks)


def observer(toy: LinearDiscrete, **options: object) -> SPV:
    """One subsystem about a state of rest."""
    u = np.array([1.5])
    rest = np.linalg.solve(np.eye(N) - toy.F, toy.G @ u + toy.B @ toy.theta0)
    points = OperatingPoints(u[np.newaxis], u.reshape(1, 1, 1), rest.reshape(1, 1, N))
    given = {"x0": np.zeros(N), "Q_w": np.full(N + 1, 0.01), "augment": ("push",)}
    return SPV(toy, points, **{**given, **options})  # type: ignore[arg-type]


@pytest.mark.parametrize("two", [False, True])
def test_one_subsystem_is_the_steady_kalman_filter(rng, two):
    toy = toy_of(two=two)
    spv = observer(toy)
    ekf = EKF(
        toy, x0=np.zeros(N), P0=np.full(N + 1, 1.0), Q_w=np.full(N + 1, 0.01), augment=("push",)
    )
    names, est = tuple(toy.sensors), ekf.start
    for _ in range(400):  # to the steady covariance
        est = ekf.predict(ekf.update(est, np.zeros(2 + two), names, [0.0]), [0.0])
    np.testing.assert_allclose(spv.start.P, est.P, rtol=1e-9, atol=1e-12)
    ours = spv.start
    theirs = replace(ekf.start, P=spv.start.P)
    for _ in range(30):
        u, y = rng.normal(size=1), rng.normal(size=2 + two)
        ours, theirs = spv.update(ours, y, names, u), ekf.update(theirs, y, names, u)
        np.testing.assert_allclose(ours.P, theirs.P, rtol=1e-8, atol=1e-11)
        ours, theirs = spv.predict(ours, u), ekf.predict(theirs, u)
        # Two solutions of the Riccati equation, SciPy's and 400 steps.
        np.testing.assert_allclose(ours.x, theirs.x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(ours.theta, theirs.theta, rtol=0, atol=1e-9)
    assert ours.nis == pytest.approx(theirs.nis, rel=1e-6)


def test_a_slow_sensor_tells_as_much_a_second_as_one_with_more_noise():
    toy = toy_of()
    slow = replace(toy.sensors["a"], period_s=4 * toy.step_s)
    noisy = replace(toy.sensors["a"], R_v=4 * toy.sensors["a"].R_v)
    found = []
    for sensor in (slow, noisy):
        toy.sensors["a"] = sensor
        found.append(observer(toy))
    np.testing.assert_allclose(found[0].start.P, found[1].start.P, rtol=1e-12)


def test_what_is_not_a_number_is_skipped_and_outliers_are_gated(rng):
    toy = toy_of()
    spv = observer(toy, gate=1e-4)
    for bad in (np.nan, np.inf, -np.inf):
        est = spv.update(spv.start, [bad, bad], "a", [1.5])
        np.testing.assert_array_equal(est.x, spv.start.x)
        assert est.skipped == 2 and est.used == 0 and est.nis == 0 and not est.failure
    one = spv.update(spv.start, [np.nan, 0.3], "a", [1.5])
    assert one.skipped == 1 and one.used == 1 and not np.array_equal(one.x, spv.start.x)
    far = spv.update(spv.start, [1e4, 0.0], "a", [1.5])
    assert far.gated == 1 and not far.believed
    np.testing.assert_array_equal(far.x, spv.start.x)
    lost = spv.predict(spv.start, [np.nan])
    assert "finite" in lost.failure and lost.failed == 1
    np.testing.assert_array_equal(lost.x, spv.start.x)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"gauge": "a"}, "gauge: expected a sensor of 1 pressures, got 'a'"),
        ({"width": 0}, "width: expected a finite positive number"),
        ({"gate": 2}, "gate: expected a chance between 0 and 1"),
        ({"augment": ("mass",)}, "augment: expected names out of push, other"),
        ({"x0": np.zeros(2)}, r"x0: expected finite numbers of shape \(4\)"),
    ],
)
def test_wrong_arguments_are_named(options, line):
    with pytest.raises(EstimationError, match=line):
        observer(toy_of(), **options)


def test_what_no_sensor_sees_is_an_error():
    toy = toy_of()
    F = np.diag([1.0, 0.5, 0.4, 0.3])
    H = np.array([[0.0, 1, 0, 0], [0, 0, 1, 1]])
    blind = LinearDiscrete(
        F, toy.G, toy.B, {"a": (H, np.zeros((2, 2)), np.eye(2))}, np.zeros(2), {}
    )
    points = OperatingPoints(np.zeros((1, 1)), np.zeros((1, 1, 1)), np.zeros((1, 1, N)))
    with pytest.raises(EstimationError, match="expected sensors that see all that is estimated"):
        SPV(blind, points, x0=np.zeros(N), Q_w=np.full(N, 0.01))


@pytest.mark.parametrize(
    ("commands", "line"),
    [
        ([[1.0], [0.5], [2.0]], "commands that go one way along a line"),
        ([[0.0, 0.0], [1.0, 2.0], [2.0, 2.0]], "commands on a straight line"),
        (np.zeros((0, 1)), "a row for each point"),
    ],
)
def test_points_have_to_lie_on_a_line(commands, line):
    commands = np.array(commands)
    with pytest.raises(EstimationError, match=line):
        OperatingPoints(commands, commands[np.newaxis], np.zeros((1, len(commands), N)))


STEP, LOW, HIGH, AMPLITUDE = 0.02, 2.0, 8.0, 1.0


@pytest.fixture(scope="module")
def robot() -> SPV:
    """The seed's robot in the plane, between 2 and 8 of pressure, with hysteresis."""
    sensors = (PressureSensor(name="air", noise=0.02), Marker(name="tip", disc=4, noise=0.01))
    model = dtc.build(seed_four_disc(), chart="planar", wrenches=(4,))
    discrete = model.discrete(STEP, method="sdirk2", sensors=sensors)
    points = operating_points(model, [LOW], [HIGH], n=7, amplitude=AMPLITUDE)
    walk = {"wrench": [0, 1, 0, 0, 0, 0]}
    noise = ProcessNoise(state=np.r_[np.zeros(model.n_q), np.full(model.n_q, 0.1)], walk=walk)
    return SPV(
        discrete, points, x0=points.x[0, 0], Q_w=noise, augment=("wrench",), gauge="air", width=0.1
    )


def test_branches_rest_where_the_robot_does_at_less_and_more_pressure(robot):
    """At each point the model rests: the balance of forces, not the search that found it."""
    model = robot.discrete.model
    for branch, sign in zip(robot.points.x, (-1, 1), strict=True):
        for x, command in zip(branch, robot.points.commands, strict=True):
            xdot = model.ode(x, command + sign * AMPLITUDE, model.theta0).full()
            assert np.max(np.abs(xdot)) < 1e-9
    assert np.max(np.abs(robot.points.x[0] - robot.points.x[1])) > 0.01


def led(robot: SPV, pressures: np.ndarray) -> list:
    """Estimates under measured pressures, without other readings."""
    est, found = robot.start, []
    for p in pressures:
        est = robot.update(robot.predict(est, [p]), [p], "air", [p])
        found.append(est)
    return found


def test_the_branch_follows_the_direction_without_a_look_back(robot):
    up, down = np.linspace(LOW, HIGH, 40), np.linspace(HIGH, LOW, 40)
    found = led(robot, np.concatenate([up, down]))
    branch = np.array([est.schedule[1] for est in found])
    assert np.all(np.abs(branch) <= 1) and branch[20] == branch[39] == 1 and branch[-1] == -1
    # From 1 to -1 takes twice the width.
    turning = np.flatnonzero(branch == -1)[0] - 40  # the first one down is the last one up
    assert turning == np.ceil(2 * 0.1 * (HIGH - LOW) / (up[1] - up[0]))
    # Noise of a few deviations of the gauge does not change the branch.
    noisy = led(robot, np.concatenate([up, HIGH + 0.02 * np.random.default_rng(0).normal(size=50)]))
    assert all(est.schedule[1] > 0.5 for est in noisy[45:])


def test_it_settles_where_the_branch_says_and_nothing_jumps_on_the_way(robot):
    middle = 0.5 * (LOW + HIGH)
    n = robot.discrete.model.n_q
    ends = []
    for start in (LOW, HIGH):
        way = np.concatenate([np.linspace(start, middle, 200), np.full(4000, middle)])
        if start == HIGH:
            way = np.concatenate([np.linspace(LOW, HIGH, 50), way])
        found = led(robot, way)
        ends.append(found[-1].x[:n])
        rates = np.array([est.x[n : 2 * n] for est in found])
        places = np.array([est.x[:n] for est in found])
        # A jump would be a change of place that no rate explains.
        steps = np.diff(places, axis=0) - STEP * (rates[1:] + rates[:-1]) / 2
        assert np.max(np.abs(steps)) < 1e-3
    rest = [operating_points(robot.discrete.model, [p], [p]).x[0, 0, :n] for p in (4.0, 6.0)]
    for end, expected in zip(ends, rest, strict=True):
        np.testing.assert_allclose(end, expected, atol=2e-3)
