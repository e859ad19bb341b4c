"""ocp.problem and ocp.stages: terms on a model, and what is refused."""

import re

import casadi as ca
import numpy as np
import pytest
from control_toy import cart

import dtcasadi as dtc
from dtcasadi.errors import ControlError
from dtcasadi.sensors import IMU, Marker, PressureSensor
from ocp import Band, Effort, HalfSpace, Limits, Problem, Sphere, Tracking, stages


@pytest.fixture(scope="module")
def robot():
    """The planar seed robot with a pressure that is commanded directly."""
    model = dtc.load_scene("seed_four_disc").build(chart="planar")
    sensors = (
        Marker(name="tip", disc=4, noise=0.01),
        Marker(name="middle", disc=3, noise=0.01),
        IMU(name="chip", disc=4, noise=0.01),
        PressureSensor(name="gauge", noise=1.0),
    )
    return model.discrete(0.05, method="midpoint", sensors=sensors)


def test_outputs_and_soft_limits_are_those_of_the_poses(robot):
    soft = (
        Sphere("middle", (0.0, 1.0, 1.0), 0.5),
        HalfSpace("tip", (0.0, 0.0, 2.0), 0.7),
        Band("tip", lower=-1.0, upper=3.0, channels="z"),
    )
    tracking = Tracking("tip", channels=("z", 2), reference=(3.0, 1.0))
    posed = stages(robot, Problem(3, tracking, soft=soft))
    x = np.random.default_rng(1).uniform(-0.5, 0.5, posed.n_x)
    r, R_x, g, G_x = (np.array(part) for part in posed.linearize(x, robot.theta0, [3.0, 1.0]))
    model = robot.model
    _, places = model.poses(x[: model.n_q], model.theta0)
    tip, middle = np.array(places)[:, 3], np.array(places)[:, 2]
    assert np.allclose(r.ravel(), [tip[2] - 3.0, tip[1] - 1.0], atol=1e-14)
    ball = 0.5 - np.linalg.norm(middle - [0, 1, 1])
    expected = [ball, 0.7 - tip[2], -1.0 - tip[2], tip[2] - 3.0]
    assert np.allclose(g.ravel(), expected, atol=1e-14)
    assert [unit for _, unit in (*posed.channels, *posed.limits)] == ["m"] * 6
    # The derivatives are the recursion's; CasADi's of the same graph are another way to them.
    at = ca.MX.sym("x", posed.n_x)
    values = [posed.residual(at, robot.theta0, [0, 0]), posed.inequality(at, robot.theta0)]
    slopes = ca.Function("slopes", [at], [ca.jacobian(value, at) for value in values])(x)
    assert np.allclose(R_x, np.array(slopes[0]), atol=1e-13)
    assert np.allclose(G_x, np.array(slopes[1]), atol=1e-13)


def test_numbers_spread_over_the_horizon():
    weight = np.arange(1.0, 5.0).reshape(4, 1)
    tracking = (Tracking("place", weight=weight), Tracking("both", weight=(5.0, 6.0)))
    limits = Limits(lower=-2.0, upper=[[3.0], [4.0], [5.0]], rate=10.0)
    posed = stages(cart(), Problem(3, tracking, Effort(change=0.1), limits, blocks=(1, 2)))
    assert np.array_equal(
        posed.weight, np.hstack([weight, np.full((4, 1), 5.0), np.full((4, 1), 6)])
    )
    assert np.array_equal(posed.upper[:, 0], [3, 4, 5]) and np.array_equal(posed.lower, [[-2]] * 3)
    assert np.allclose(posed.rate, 1.0)  # 10 a second, a step of 0.1 s
    assert np.array_equal(posed.block_of, [0, 1, 1])
    assert not np.any(stages(cart(), Problem(3, tracking, terminal="riccati")).weight[-1])


def test_references_are_read_at_the_times_of_the_steps():
    profile = dtc.Profile([0.0, 1.0], [0.0, 10.0], "linear")
    tracking = (Tracking("place", profile), Tracking("both", lambda t: (t, -1.0)))
    found = stages(cart(), Problem(2, tracking)).references(0.5)
    expected = [[5.0, 0.5, -1], [6.0, 0.6, -1], [7.0, 0.7, -1]]
    assert np.allclose(found, expected, atol=1e-14)


def test_a_safe_pressure_is_the_one_nearest_to_zero():
    limits = Limits(lower=[[1.0], [2.0]], upper=5.0)
    assert stages(cart(), Problem(2, limits=limits)).safe == 2.0
    assert stages(cart(), Problem(2)).safe == 0.0


REFUSED = [
    (lambda: Problem(0), "horizon: expected an integer from 1 to 10000, got 0"),
    (lambda: Problem(2, tracking=["tip"]), "tracking: expected terms of ocp.problem, got 'tip'"),
    (
        lambda: Problem(2, effort="x"),  # type: ignore[arg-type]
        "effort: expected a value of Effort, got 'x'",
    ),
    (lambda: Problem(2, terminal="lqr"), "terminal: expected riccati, a matrix or None, got 'lqr'"),
    (lambda: Problem(4, blocks=(1, 2)), "lengths of blocks that add up to 4, got 3 from [1, 2]"),
    (lambda: Problem(2, Tracking("tip")), "tracking[1].output: expected a sensor out of place,"),
    (lambda: Problem(2, Tracking("place", weight=-1.0)), "tracking[1].weight: expected non-neg"),
    (lambda: Problem(2, Tracking("both", weight=[1, 2, 3])), "of shape (3, 2), got shape (3,)"),
    (lambda: Problem(2, Tracking("both", channels="z")), "tracking[1].channels: expected names"),
    (lambda: Problem(2, Tracking("both", channels=(1, 1))), "expected different channels"),
    (lambda: Problem(2, limits=Limits(lower=1, upper=0)), "limits: expected lower limits up to"),
    (lambda: Problem(2, limits=Limits(rate=0)), "limits.rate: expected positive numbers, got 0"),
    (lambda: Problem(2, effort=Effort(np.nan)), "effort.change: expected finite numbers"),
    (lambda: Problem(2, soft=Sphere("both", (0, 0, 0), 1.0)), "a sensor with three channels"),
    (lambda: Problem(2, soft=Sphere("triple", (0, 0, 0), -1.0)), "soft[1].radius: expected"),
    (lambda: Problem(2, soft=Band("both", quadratic=0.0)), "soft[1].quadratic: expected a pos"),
    (lambda: Problem(2, soft=HalfSpace("triple", (0, 0, 0), 1)), "soft[1].normal: expected a dir"),
    (lambda: Problem(2, terminal=-np.eye(3)), "terminal: expected a symmetric positive semidef"),
    (lambda: Problem(2, terminal=np.eye(2)), "terminal: expected finite numbers of shape (3, 3)"),
    (lambda: Problem(2, limits=Limits(1, 2), safe_pressure=3), "safe_pressure: expected a command"),
]


@pytest.mark.parametrize(("make", "text"), REFUSED, ids=[text[:40] for _, text in REFUSED])
def test_what_does_not_fit_is_refused(make, text):
    with pytest.raises(ControlError, match=re.escape(text)):
        stages(cart(), make())


@pytest.mark.parametrize("name", ["chip", "gauge"])
def test_outputs_depend_on_the_state_alone(robot, name):
    with pytest.raises(ControlError, match=f"depends on the state alone, got '{name}'"):
        stages(robot, Problem(2, Tracking(name)))


def test_a_reference_that_is_no_number_is_refused():
    posed = stages(cart(), Problem(2, Tracking("place", lambda t: float("nan"))))
    with pytest.raises(ControlError, match=r"tracking\[1\].reference: expected finite numbers"):
        posed.references(0.0)
