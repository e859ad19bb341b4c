"""Dense output and event location against closed forms, and what a step's checks say."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from moving import full, full_theta, swift
from scipy.integrate import solve_ivp

import dtcasadi as dtc
from dtcasadi.errors import SimulationError
from dtcasadi.presets import seed_four_disc
from dtcasadi.robot import Disc, Robot, Thread

# A mass of 1 kg with an inertia of 0.07 kg m^2 on 0.7 m: as a point mass on l + I / (m l).
G, THREAD, INERTIA = 9.81, 0.7, 0.07
LENGTH = THREAD + INERTIA / THREAD
# One tight run and one at the tolerances users take.
TIGHT: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-12}


@cache
def pendulum() -> dtc.Model:
    """A rigid pendulum that hangs along +z: beta'' = -g/l sin beta."""
    disc = Disc(1.0, INERTIA * np.eye(3))
    robot = Robot((disc, disc), (Thread(THREAD),), up=np.array([0, 0, -1.0]))
    return dtc.build(robot, chart="hinge")


def exact(times: np.ndarray, start: float) -> np.ndarray:
    """Angle and rate by another program's eighth-order method at 1e-13."""
    found = solve_ivp(
        lambda t, y: [y[1], -G / LENGTH * np.sin(y[0])],
        (0, times[-1]),
        [start, 0.0],
        "DOP853",
        t_eval=times,
        rtol=1e-13,
        atol=1e-14,
    )
    return found.y


def period(amplitude: float) -> float:
    """2 pi sqrt(l/g) / agm(1, cos(amplitude / 2)), the pendulum's exact period."""
    a, b = 1.0, np.cos(amplitude / 2)
    for _ in range(8):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return float(2 * np.pi * np.sqrt(LENGTH / G) / a)


def angle(t: float, x: np.ndarray, theta: np.ndarray) -> float:
    return x[0]


@pytest.mark.parametrize("method", ["tsit5", "rodas4", "auto", "DOP853"])
def test_states_between_the_steps(method):
    """As accurate as the steps themselves: ten times the local tolerance over one swing."""
    run = dtc.simulate(pendulum(), [1.0, 0.0], t_end=2.0, method=method, **TIGHT)
    times = np.linspace(0.0, 2.0, 337)
    between = run.at(times)
    assert between.x.shape == (2, 337) and np.array_equal(between.t, times)
    assert np.max(np.abs(between.x - exact(times, 1.0))) < 1e-7
    assert np.array_equal(run.at(run.t).x, run.x)


def test_the_interpolant_has_order_six():
    """Between steps of rk4 whose ends are nearly exact: halved, its own error falls 2^6 in q."""
    errors = []
    for h in (0.1, 0.05):
        run = dtc.simulate(pendulum(), [1.0, 0.0], t_end=0.1, method="radau5", step_s=h)
        middle = run.at([h / 2])
        ends = exact(np.array([h / 2, h]), 1.0)
        errors.append(abs(middle.q[0, 0] - ends[0, 0]))
    assert 5.5 < np.log2(errors[0] / errors[1]) < 7.5


@pytest.mark.parametrize("method", ["rk4", "tsit5", "rodas4", "auto", "radau5"])
def test_crossings_are_where_the_pendulum_has_them(method):
    """Every half period; located far below the step, so only the method's error remains."""
    options: dict[str, Any] = TIGHT | ({"step_s": 2e-3} if method in ("rk4", "radau5") else {})
    events = [dtc.Event(angle, "lowest", terminal=False)]
    T = period(1.0)
    run = dtc.simulate(pendulum(), [1.0, 0.0], t_end=2 * T, method=method, events=events, **options)
    assert run.success and [event.name for event in run.events] == ["lowest"] * 4
    times = np.array([event.t for event in run.events])
    assert np.max(np.abs(times - T * (0.25 + 0.5 * np.arange(4)))) < 1e-7
    # The state stored there is just behind the zero, and a step of the run ends on it.
    assert all(abs(event.x[0]) < 1e-12 for event in run.events)
    assert set(times) <= set(run.t)


def test_direction_and_end():
    T = period(1.0)
    rising = dtc.Event(angle, "rising", direction=1)
    run = dtc.simulate(pendulum(), [1.0, 0.0], t_end=5.0, events=rising, **TIGHT)
    assert run.success and run.t[-1] == pytest.approx(0.75 * T, abs=1e-7)
    assert run.message.startswith("event 'rising' ended the run at t = ")
    assert run.events[0].t == run.t[-1] and np.array_equal(run.events[0].x, run.x[:, -1])
    # Starting on the zero is no passage of it.
    falling = dtc.Event(angle, "falling", direction=-1)
    swung = dtc.simulate(pendulum(), [0.0, 1.0], t_end=5.0, events=[falling], **TIGHT)
    small = period(2 * np.arcsin(1.0 / (2 * np.sqrt(G / LENGTH))))
    assert swung.t[-1] == pytest.approx(small / 2, abs=1e-7)


def test_two_zeros_in_one_step_come_in_order():
    """The earlier one first, though the later one is listed first."""
    events = [
        dtc.Event(lambda t, x, theta: t - 0.52, "later", terminal=False),
        dtc.Event(lambda t, x, theta: t - 0.51, "earlier", terminal=False),
    ]
    run = dtc.simulate(
        pendulum(), [1.0, 0.0], t_end=1.0, method="radau5", step_s=0.1, events=events
    )
    assert [event.name for event in run.events] == ["earlier", "later"]
    assert [event.t for event in run.events] == pytest.approx([0.51, 0.52], abs=1e-13)


def test_the_twin_finds_the_same(monkeypatch):
    """Without a compiler, the Python loop."""
    options: dict[str, Any] = {"t_end": 2.0, "method": "tsit5", **TIGHT}
    events = [dtc.Event(angle, "lowest", terminal=False)]
    native = dtc.simulate(pendulum(), [1.0, 0.0], events=events, **options)
    monkeypatch.setattr("dtcasadi.integrators.loop.load_library", lambda *_: None)
    model = dtc.build(pendulum().robot, chart="hinge")
    twin = dtc.simulate(model, [1.0, 0.0], events=events, **options)
    assert len(native.events) == len(twin.events) == 2
    for one, other in zip(native.events, twin.events, strict=True):
        assert one.t == pytest.approx(other.t, abs=1e-12)


def test_a_pose_is_passed_wherever_the_charts_are_centred():
    """Across re-centrings, at the sign changes that a fine look at the dense output shows."""
    model = full()

    def turned(t: float, x: np.ndarray, theta: np.ndarray) -> float:
        return float(model.poses(x[: model.n_q], theta)[0][0, -1])

    options: dict[str, Any] = {"pressure": [3.0, 2.0, 1.0], "method": "tsit5"}
    event = dtc.Event(turned, "axis crosses the plane", terminal=False)
    run = dtc.simulate(
        model, swift(model), theta=full_theta(), events=event, t_end=1.0, **options, **TIGHT
    )
    assert run.success and len(run.recentrings) > 1
    times = np.linspace(0.0, 1.0, 2001)
    values = run.at(times).poses()[0][:, -1, 0, 2]
    k = np.flatnonzero(values[:-1] * values[1:] < 0)
    crossed = times[k] - values[k] * 5e-4 / (values[k + 1] - values[k])
    assert len(k) and crossed[-1] > run.recentrings[0][0]
    # A chord over 0.5 ms is off by its square times the curvature.
    assert [each.t for each in run.events] == pytest.approx(crossed, abs=1e-5)


def test_coordinates_of_choice():
    """About the robot's own A and B, they give the run's poses with the parameters of the start."""
    model = full()
    options: dict[str, Any] = {"pressure": [3.0, 2.0, 1.0], "method": "tsit5"}
    run = dtc.simulate(model, swift(model), theta=full_theta(), t_end=0.5, **options)
    own = np.array(full_theta())
    own[model.theta_blocks["frames"]] = model.theta0[model.theta_blocks["frames"]]
    q, qd = run.coordinates("cardan")
    R, r = run.poses()
    assert run.recentrings
    for k in range(0, len(run.t), 10):
        rotation, origin = model.poses(q[:, k], own)
        assert np.max(np.abs(np.array(origin).T - r[k])) < 1e-9
        assert np.max(np.abs(np.array(rotation)[:, -3:] - R[k, -1])) < 1e-9
    # Rates belong to the coordinates: central differences over 1e-4 s, away from singular poses.
    near = run.at(np.array([0.2 - 1e-4, 0.2, 0.2 + 1e-4]))
    q, qd = near.coordinates("cardan")
    slope = (q[:, 2] - q[:, 0]) / 2e-4
    assert np.max(np.abs(slope - qd[:, 1])) < 1e-4 * max(1.0, np.max(np.abs(qd)))


def two_discs() -> Robot:
    """The first segment of the paper's robot."""
    whole = seed_four_disc()
    springs = tuple(spring for spring in whole.springs if spring.discs == (1, 2))
    damping = dtc.Damping(c_a=100.0, c_b=100.0, c_w=100.0)
    parts = (whole.discs[:2], whole.threads[:1], springs, (dtc.Chamber((1, 2)),), damping)
    return Robot(*parts, up=whole.up)


def test_auto_leaves_a_chart_only_where_the_physics_stay():
    """The paper's chart at beta = 0: with physical damping in cardan, with its own a reason."""
    robot = two_discs()
    options: dict[str, Any] = {"pressure": 12.0, "t_end": 0.5}
    start = np.zeros(10)  # straight
    run = dtc.simulate(dtc.build(robot, chart="paper"), start, **options)
    assert run.success and {chart.name for chart in run.model.charts} == {"cardan"}
    assert run.choice.startswith("chart cardan from the start, the same physics (segment 1: beta")
    flat = np.zeros(4)
    planar = dtc.simulate(dtc.build(robot, chart="planar"), flat, **options)
    gap = run.poses(np.array([-1]))[1] - planar.poses(np.array([-1]))[1]
    assert np.max(np.abs(gap)) < 1e-5
    for tied in ({"damping": "coordinate"}, {"velocity_terms": "none"}):
        failed = dtc.simulate(dtc.build(robot, chart="paper", **tied), start, **options)
        assert not failed.success and "singularity of chart paper" in failed.message


@pytest.mark.parametrize(
    ("events", "text"),
    [
        (3, "events: expected an Event or a list of them, got 3"),
        ([dtc.Event(lambda t, x, theta: np.nan, "hole")], r"events: hole\(0\): expected a finite"),
        ([dtc.Event(lambda t, x, theta: "low", "word")], r"events: word\(0\): .* got 'low'"),
    ],
)
def test_unfit_events_are_refused(events, text):
    with pytest.raises(SimulationError, match=text):
        dtc.simulate(pendulum(), [1.0, 0.0], t_end=1.0, events=events)


def test_fields_are_checked():
    with pytest.raises(SimulationError, match="events: function: expected a function of t, x"):
        dtc.Event(3.0)
    with pytest.raises(SimulationError, match="events: direction: expected -1, 0 or 1, got 2"):
        dtc.Event(angle, direction=2)
    with pytest.raises(SimulationError, match="events: method LSODA cannot locate them"):
        dtc.simulate(pendulum(), [1.0, 0.0], t_end=1.0, method="LSODA", events=dtc.Event(angle))


@pytest.mark.parametrize("times", [[1.0, 0.5], [-0.1], [9.0], [[0.0, 1.0]], [np.nan]])
def test_times_outside_a_run_are_refused(times):
    run = dtc.simulate(pendulum(), [1.0, 0.0], t_end=1.0)
    with pytest.raises(SimulationError, match="times: expected increasing times from 0 to 1 s"):
        run.at(times)


def test_an_error_estimate_is_of_the_size_of_the_error():
    """tsit5's own, for a step of 0.1 s, within a factor of 30 of the true local error of order 4.

    The estimate belongs to the lower order, so it is the larger one.
    """
    discrete = pendulum().discrete(0.2, method="tsit5")
    x_next, status, error, residual = discrete.checked([1.0, 0.0], [], pendulum().theta0)
    true = np.abs(np.array(x_next)[:, 0] - exact(np.array([0.1, 0.2]), 1.0)[:, 1])
    estimate = np.abs(np.array(error)[:, 0])
    assert float(status) == 0 and float(residual) == 0
    assert np.max(true) < np.max(estimate) < 1e-3


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "radau5", "gauss4"])
def test_the_residual_tells_a_solved_step_from_an_unsolved_one(method):
    """Round-off of forces of 10 N m; far beyond that when a step spans more than a period."""
    model = pendulum()
    solved = model.discrete(0.05, method=method).checked([1.0, 0.0], [], model.theta0)
    assert float(solved[1]) == 0 and float(solved[3]) < 1e-12
    long = model.discrete(2.0, method=method).checked([1.0, 3.0], [], model.theta0)
    assert float(long[1]) == 1 and float(long[3]) > 1e-6
