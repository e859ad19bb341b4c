"""Drag by virtual power, by hand, and that it only ever takes energy from a robot."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.forces import Motion, by_power, state, with_forces
from test_derivatives import exact

import dtcasadi as dtc
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.forces import Drag

CHARTS = ("cardan", "paper")


def link(*forces: dtc.Force) -> dtc.Model:
    """A disc of mass 2 on a hinged thread of length 0.7, hanging down along z."""
    disc = dtc.Disc(2.0, np.eye(3))
    robot = dtc.Robot((disc, disc), (dtc.Thread(0.7),), up=(0.0, 0.0, -1.0), forces=forces)
    return dtc.build(robot, chart="hinge")


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_by_its_power(rng, assembly):
    a, b, c = rng.uniform(0.1, 2.0, (3, 3))
    flow, point = rng.normal(size=(2, 3))
    plain = cases.robot(3)

    def loads(at: Motion) -> list[tuple[ca.SX, ca.SX]]:
        R = at.R(3)
        u = R.T @ (at.velocity(3, point) - ca.SX(flow))
        across = ca.norm_2(u[:2])
        speed = ca.vertcat(across, across, ca.fabs(u[2]))
        force = -R @ (ca.SX(a) * u + ca.SX(b) * speed * u)
        moment = -R @ (ca.SX(c) * (R.T @ at.w(3)))
        return [(force, at.velocity(3, point)), (moment, at.w(3))]

    robot = with_forces(plain, Drag(3, a, b, c, flow, point))
    model = dtc.build(robot, chart=list(CHARTS), assembly=assembly)
    q, qd, _ = state(rng, CHARTS)
    expected = by_power(plain, CHARTS, loads)(q, qd)
    assert error(numbers(model.forces, q, qd, model.theta0), expected) < 1e-12


def test_of_a_link_by_hand():
    """The disc moves at l qd across its axis: Q = -(a l + b l |l qd|) l qd - c qd."""
    a, b, c, length = 0.3, 0.5, 0.2, 0.7
    model = link(Drag(2, a, b, c))
    for qd in (-2.0, 0.0, 1e-12, 0.4):
        expected = -(a + b * abs(length * qd)) * length**2 * qd - c * qd
        Q = numbers(model.forces, [0.3], [qd], model.theta0)
        assert Q[0] == pytest.approx(expected, rel=1e-12)


def test_of_a_link_in_the_wind_by_hand():
    """At rest in a side wind U the linear drag a U balances the weight: tan(angle) = a U / m g.

    The quadratic drag of a wind along the axis is not felt by the hinge.
    """
    a, wind = 3.0, 2.5
    model = link(Drag(2, linear=a, flow=(0.0, wind, 0.0)))
    found = dtc.equilibrium(model)
    assert found.success
    angle = np.arctan(a * wind / (2.0 * model.robot.gravity))
    assert abs(found.q[0]) == pytest.approx(angle, rel=1e-9)
    assert found.poses[1][-1] @ [0.0, 1.0, 0.0] > 0  # downwind


def test_it_has_a_slope_at_rest():
    """At a standstill the Jacobian is finite and the linear part all of it."""
    model = link(Drag(2, 0.3, 0.5))
    outputs = numbers(model.forward_dynamics_jacobian, [0.0], [0.0], [], [0.0], model.theta0)
    d_rate = outputs[2]
    assert np.squeeze(d_rate) == pytest.approx(-0.3 * 0.7**2 / (2.0 * 0.7**2 + 1.0), rel=1e-12)


def test_derivatives_are_exact_in_still_fluid(rng):
    """Where the wrench along the disc's axes does not depend on the pose."""
    robot = with_forces(cases.robot(3), Drag(3, 0.3, (0.2, 0.5, 0.1), 0.1), Drag(2, 0.2))
    model = dtc.build(robot, chart=list(CHARTS))
    arguments = *state(rng, CHARTS), np.ones(model.n_u), model.theta0
    value = numbers(model.inverse_dynamics_jacobian, *arguments)
    for mine, reference in zip(value, exact(model.inverse_dynamics, arguments, 2), strict=True):
        assert error(mine, reference) < 1e-11  # ten times the operations of its function


def test_it_only_takes(rng):
    """In a fluid at rest its power is never positive, and the run books it as dissipated."""
    drags = [Drag(i, rng.uniform(0, 1, 3), rng.uniform(0, 1, 3), 0.1) for i in (2, 3, 4)]
    seed = replace(seed_robot(4), chambers=(), damping=dtc.Damping())
    model = dtc.build(with_forces(seed, *drags), chart="cardan")
    for _ in range(50):
        q, qd, _ = state(rng, ("cardan",) * 3)
        assert qd @ numbers(model.forces, q, qd, model.theta0) < 0
    flat = dtc.build(with_forces(seed, *drags), chart="planar")
    start = np.concatenate([0.1 * np.ones(6), np.zeros(6)])
    run = dtc.simulate(flat, start, t_end=1.0, rtol=1e-9, atol=1e-11, method="dopri5")
    assert run.success, run.message
    lost = run.energy["dissipated"]
    assert np.all(np.diff(lost) >= 0) and lost[-1] > 1e-2 * np.ptp(run.energy["kinetic"])
    assert np.max(np.abs(run.energy["residual"])) < 1e-7 * np.ptp(run.energy["kinetic"])


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Drag(2, -1.0), "linear: expected a finite non-negative number, got -1"),
        (lambda: Drag(2, 0.0, (1, -1, 0)), "quadratic: expected non-negative numbers, got"),
        (lambda: Drag(2, angular=(1, 1)), r"angular: expected finite numbers of shape \(3\), got"),
        (lambda: Drag(2, flow=(np.nan, 0, 0)), "flow: expected finite numbers"),
    ],
)
def test_it_refuses(make, text):
    with pytest.raises(dtc.errors.RobotError, match=text):
        make()
