"""Slopes at a command that stands exactly at its limit, where the actuator cuts it off too."""

import casadi as ca
import numpy as np
import pytest
from control_robot import rest, robot, tip

from ocp import stages
from ocp.calls import Functions
from ocp.slopes import inside
from ocp.target import TargetCalculator, TargetStatus
from ocp.terminal import TerminalCost

LIMIT = np.zeros(1)


@pytest.fixture(scope="module")
def posed():
    return stages(robot(), tip(reference=9.0, terminal="riccati", soft=()))


@pytest.fixture(scope="module")
def slope(posed):
    """F_u a little within, by differences of the step alone."""
    step, theta = robot().compiled("step"), robot().theta0
    x = rest(4.0)
    return (step(x, [1e-3], theta).x_next - step(x, [1e-4], theta).x_next) / 9e-4


def test_the_step_itself_has_half_the_slope(slope):
    """What `inside` is for; were it not so, it could go."""
    F_u = robot().compiled("linearize")(rest(4.0), LIMIT, robot().theta0).F_u[:, 0]
    assert np.allclose(F_u, slope / 2, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("scheme", ["shooting", "legendre"])
def test_transcriptions_have_the_whole_slope(posed, slope, scheme):
    motion = Functions(posed, scheme, exact=False).motion
    ports = motion.mx_in()
    F_u = ca.Function("F_u", ports, [ca.jacobian(motion(*ports), ports[1])])
    at, theta = rest(4.0), robot().theta0
    found = np.array(F_u(at, LIMIT, theta)).ravel()
    if scheme == "legendre":
        ode = robot().ode
        # Linear in the command where it is not cut off.
        slope = np.array(ode(at, [1.0], theta) - ode(at, [0.5], theta)).ravel() / 0.5
    assert np.allclose(found, slope, rtol=1e-6, atol=1e-8)
    # The value is that of the command itself.
    whole = robot().step if scheme == "shooting" else robot().ode
    value = whole.call([ca.DM(at), ca.DM(LIMIT), ca.DM(theta)])[0]
    assert np.allclose(np.array(motion(at, LIMIT, theta)), np.array(value), rtol=1e-12, atol=1e-12)


def test_target_and_terminal_cost_have_the_whole_slope(posed):
    """At the equilibrium of a small pressure, with that command and with none."""
    find, cost, theta = TargetCalculator(posed), TerminalCost(posed), robot().theta0
    x = rest(1e-3)
    y = np.array(posed.residual(x, theta, [0.0])).ravel()
    near, at = (find(y, theta, x, u, most=1, patient=False) for u in (LIMIT + 1e-3, LIMIT))
    assert near.status is TargetStatus.REACHED and at.u[0] == 0.0
    assert np.allclose(at.slope, near.slope, rtol=1e-6)
    assert np.allclose(cost(at, theta), cost(near, theta), rtol=1e-5, atol=1e-7)


def test_commands_without_limits_stay_as_they_are():
    free = stages(robot(), tip(limits=type(tip().limits)()))
    values = np.array([[-1e9, 0.0, 3.0]])
    assert np.array_equal(np.array(inside(free, ca.DM(values))), values)
