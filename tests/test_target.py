"""ocp.target and ocp.terminal: equilibria to go to, and what the rest of time costs."""

import numpy as np
import pytest
from control_toy import cart
from scipy.linalg import solve_discrete_are

import dtcasadi as dtc
from dtcasadi.errors import ControlError
from dtcasadi.sensors import Marker
from ocp import Effort, Limits, Problem, Tracking, stages
from ocp.target import TargetCalculator, TargetStatus
from ocp.terminal import TerminalCost, regulator_cost


def test_a_load_in_theta_is_held_against():
    # At rest the spring of 2 pushes back 2 * place; command and load push with 1 each.
    find = TargetCalculator(stages(cart(), Problem(3, Tracking("place"), limits=Limits(-5, 5))))
    found = find([1.0], np.array([0.5]), np.zeros(2), np.zeros(1))
    assert found.status is TargetStatus.REACHED and found.stable
    assert np.allclose(found.u, [1.5], atol=1e-12) and np.allclose(found.x, [1.0, 0.0], atol=1e-12)


def test_limits_and_unreachable_references_give_the_nearest_equilibrium():
    posed = stages(cart(), Problem(3, Tracking("both", weight=(1, 3)), limits=Limits(-5, 5)))
    find = TargetCalculator(posed)
    start = np.zeros(1), np.zeros(2), np.zeros(1)
    far = find([10.0, 0.0], *start)
    assert far.status is TargetStatus.SATURATED and np.allclose(far.distance, [-7.5, 0], atol=1e-9)
    moving = find([1.0, 1.0], *start)  # a speed cannot be held
    assert moving.status is TargetStatus.NEAREST and moving.cost == pytest.approx(3.0)
    assert "nearest" in moving.status.sentence


@pytest.fixture(scope="module")
def robot():
    model = dtc.load_scene("seed_four_disc").build(chart="planar", actuator="regulator")
    sensors = (Marker(name="tip", disc=4, noise=0.01),)
    return model.discrete(0.05, method="midpoint", sensors=sensors)


@pytest.mark.parametrize("pressure", [4.0, 12.0])
def test_a_robot_finds_the_pressure_of_a_pose_from_the_straight_one(robot, pressure):
    """Statics solves another equation by another method; the start is far and multistable."""
    rest = dtc.equilibrium(robot.model, pressure)
    posed = stages(robot, Problem(3, Tracking("tip", channels="y"), limits=Limits(0.0, 14.0)))
    find = TargetCalculator(posed)
    at = (robot.theta0, np.zeros(posed.n_x), np.array([6.0]))
    found = find([rest.poses[1][-1][1]], *at)
    assert found.status is TargetStatus.REACHED
    assert np.allclose(found.u, pressure, rtol=1e-7)
    assert np.allclose(found.x[: robot.model.n_q], rest.q, atol=1e-7)
    again = find([rest.poses[1][-1][1]], robot.theta0, found.x, found.u)
    assert again.iterations <= 2


def test_more_outputs_than_chambers_give_the_distance(robot):
    """One chamber moves the tip along a curve; no point of a fine sweep of it is nearer."""
    posed = stages(robot, Problem(3, Tracking("tip", channels=("y", "z")), limits=Limits(0, 12)))
    model = robot.model
    sweep = [dtc.equilibrium(model, p) for p in np.linspace(8.0, 12.0, 41)]
    curve = np.array([rest.poses[1][-1][1:] for rest in sweep])
    aim = curve[20] + [0.05, 0.1]
    start = np.concatenate([sweep[10].q, np.zeros(model.n_q), [9.0]])
    found = TargetCalculator(posed)(aim, robot.theta0, start, np.array([9.0]))
    assert found.status is TargetStatus.NEAREST
    nearest = np.min(np.linalg.norm(curve - aim, axis=1))
    assert nearest * 0.98 < np.linalg.norm(found.distance) <= nearest * (1 + 1e-9)


def test_a_model_that_cannot_rest_has_no_target():
    discrete = cart()
    broken = type(discrete)(
        F=np.diag([1.0, 1.0]) + [[0, 0.1], [0, 0]],
        G=discrete.G,
        B=discrete.B,
        measured=discrete.measured,
        theta0=discrete.theta0,
        theta_blocks=discrete.theta_blocks,
    )
    find = TargetCalculator(stages(broken, Problem(3, Tracking("place"), limits=Limits(1, 2))))
    found = find([0.0], np.zeros(1), np.zeros(2), np.ones(1))
    assert found.status is TargetStatus.FAILED and not found.found


def test_the_terminal_cost_is_that_of_the_regulator():
    """Against the textbook equation without changes, and the sum over a long future with them."""
    discrete = cart()
    F, G = discrete.F, discrete.G
    Q = np.diag([2.0, 0.0])
    P = regulator_cost(F, G, Q, np.zeros(1), np.array([0.3]))
    assert np.allclose(P[:2, :2], solve_discrete_are(F, G, Q, [[0.3]]), rtol=1e-10)
    assert np.allclose(P[2:], 0, atol=1e-12)
    problem = Problem(3, Tracking("place", weight=2.0), Effort(0.4, 0.3), terminal="riccati")
    posed = stages(discrete, problem)
    target = TargetCalculator(posed)([0.0], np.zeros(1), np.zeros(2), np.zeros(1))
    P = TerminalCost(posed)(target, np.zeros(1))
    # The recursion of costs to go, from nothing, 400 steps back.
    A = np.block([[F, np.zeros((2, 1))], [np.zeros((1, 3))]])
    B = np.vstack([G, [[1.0]]])
    H = np.zeros((3, 3))
    for _ in range(400):
        E = np.diag([2.0, 0.0, 0.4]) + A.T @ H @ A
        cross = A.T @ H @ B - [[0], [0], [0.4]]
        H = E - cross @ np.linalg.solve(0.7 + B.T @ H @ B, cross.T)
    assert np.allclose(P, H, rtol=1e-9, atol=1e-12)


def test_a_drifting_mode_that_no_command_reaches_has_no_terminal_cost():
    with pytest.raises(ControlError, match="terminal: expected a target with a regulator"):
        regulator_cost(np.diag([1.2, 0.5]), np.array([[0.0], [1.0]]), np.eye(2), *np.ones((2, 1)))
