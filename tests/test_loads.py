"""Loads and payloads by virtual power and by the energies of what is carried."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.forces import Motion, by_power, state, with_forces
from oracles.robots import tensor

import dtcasadi as dtc
from dtcasadi.forces import Couple, FollowerLoad, Payload, PointLoad

CHARTS = ("cardan", "paper", "ball")
ROUND_OFF = 1e-12  # of some thousand operations, relative to the largest entry
CONDITIONED = 1e-9  # through M, cond(M) up to 1e4 here


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_loads_by_their_power(rng, assembly):
    """A dead force, a follower force, couples of both kinds, each on a disc of its own."""
    f, g, m, n = (v / np.linalg.norm(v) for v in rng.normal(size=(4, 3)))
    p, s = rng.normal(size=(2, 3))
    plain = cases.robot(4)
    robot = with_forces(
        plain,
        PointLoad(4, 3.0, f, p),
        FollowerLoad(3, -2.0, g, s),
        Couple(2, 1.5, m),
        Couple(4, 0.7, n, follower=True),
        FollowerLoad(1, 9.0, g),  # on the root: nothing moves
    )
    expected = by_power(
        plain,
        CHARTS,
        lambda at: [
            (3.0 * ca.SX(f), at.velocity(4, p)),
            (-2.0 * at.R(3) @ ca.SX(g), at.velocity(3, s)),
            (1.5 * ca.SX(m), at.w(2)),
            (0.7 * at.R(4) @ ca.SX(n), at.w(4)),
        ],
    )
    model = dtc.build(robot, chart=list(CHARTS), assembly=assembly)
    q, qd, _ = state(rng, CHARTS)
    Q = numbers(model.forces, q, qd, model.theta0)
    assert error(Q, expected(q, qd)) < ROUND_OFF


def test_they_enter_every_form_of_the_dynamics(rng):
    """tau, qdd, pd and the power lose what `forces` gives; the energy knows the dead force."""
    f, p = rng.normal(size=(2, 3))
    plain = cases.robot(4)
    loads = PointLoad(4, 3.0, f, p), FollowerLoad(3, 2.0, f), Couple(2, 1.0, p)
    without = dtc.build(plain, chart=list(CHARTS))
    model = dtc.build(with_forces(plain, *loads), chart=list(CHARTS))
    theta = model.theta0
    q, qd, qdd = state(rng, CHARTS)
    pressure = rng.uniform(1.0, 5.0, model.n_u)
    Q = numbers(model.forces, q, qd, theta)
    tau = numbers(without.inverse_dynamics, q, qd, qdd, pressure, theta) - Q
    assert error(numbers(model.inverse_dynamics, q, qd, qdd, pressure, theta), tau) < ROUND_OFF
    again = numbers(model.forward_dynamics, q, qd, pressure, tau, theta)
    assert error(again, qdd) < CONDITIONED
    p_of_qd = numbers(model.momenta, q, qd, theta)
    pd = numbers(model.canonical_ode, q, p_of_qd, pressure, tau, theta)[1]
    pd_without = numbers(without.canonical_ode, q, p_of_qd, pressure, tau, theta)[1]
    assert error(pd - pd_without, Q) < CONDITIONED
    x = np.concatenate([q, qd])
    supplied, dissipated, _ = numbers(model.power, x, pressure, theta)
    before = numbers(without.power, x, pressure, theta)
    dead = dtc.build(with_forces(plain, loads[0]), chart=list(CHARTS))
    stored = qd @ numbers(dead.forces, q, qd, theta)
    assert supplied - before[0] == pytest.approx(qd @ Q - stored, rel=1e-9)
    assert dissipated == pytest.approx(before[1], rel=1e-12)
    place = lambda at: at.place(4, p)  # noqa: E731
    motion = Motion(plain, CHARTS)
    height = numbers(ca.Function("h", [motion.q], [ca.dot(ca.SX(f), place(motion))]), q)
    energy = numbers(model.potential_energy, q, theta)
    energy_without = numbers(without.potential_energy, q, theta)
    pull = -3.0 * height / np.linalg.norm(f)
    assert energy - energy_without == pytest.approx(pull, rel=1e-11)


def test_by_default_a_load_acts_on_the_centre_of_mass():
    robot = cases.robot(3)
    for kind in (PointLoad, FollowerLoad):
        fitted = with_forces(robot, kind(3, 1.0, (0, 0, 1))).forces[0]
        assert np.array_equal(fitted.point, robot.discs[2].centre_of_mass)


def test_follower_and_dead_load_part_as_by_hand():
    """One hinged link of length l turned by b, both loads along -y of the tip at rest.

    The dead force p has the moment p l cos b about the hinge, the follower p l whatever b.
    """
    length, b, p = 0.7, 0.4, 2.0
    disc = dtc.Disc(1.0, np.eye(3))
    robot = dtc.Robot((disc, disc), (dtc.Thread(length),), gravity=0.0)
    down = (0.0, -1.0, 0.0)
    for kind, expected in ((PointLoad, p * length * np.cos(b)), (FollowerLoad, p * length)):
        model = dtc.build(with_forces(robot, kind(2, p, down)), chart="hinge")
        Q = numbers(model.forces, [b], [0.0], model.theta0)
        assert Q[0] == pytest.approx(expected, rel=1e-14)


# ---- payload ---------------------------------------------------------------------------------


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_payload_by_its_own_energies(rng, assembly):
    """Kinetic and potential energy grow by those of the body itself; the dynamics follow."""
    plain = cases.robot(4)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    mass, point, inertia = 1.7, rng.normal(size=3), tensor(rng, turn)
    loaded = with_forces(plain, Payload(3, mass, point, inertia), Payload(4, 0.4, point))
    without = dtc.build(plain, chart=list(CHARTS))
    model = dtc.build(loaded, chart=list(CHARTS), assembly=assembly)
    q, qd, qdd = state(rng, CHARTS)
    at = Motion(plain, CHARTS)
    v, v_far, w = at.velocity(3, point), at.velocity(4, point), at.R(3).T @ at.w(3)
    kinetic = mass * ca.sumsqr(v) / 2 + ca.dot(w, ca.SX(inertia) @ w) / 2
    kinetic += 0.4 * ca.sumsqr(v_far) / 2
    height = mass * ca.dot(ca.SX(plain.up), at.place(3, point))
    height += 0.4 * ca.dot(ca.SX(plain.up), at.place(4, point))
    momentum = ca.gradient(kinetic, at.qd)
    rate = ca.jtimes(momentum, at.q, at.qd) - ca.gradient(kinetic, at.q)
    rate += plain.gravity * ca.gradient(height, at.q)
    inertial = ca.jtimes(momentum, at.qd, ca.SX(ca.DM(qdd)))
    extra = ca.Function("extra", [at.q, at.qd], [kinetic, plain.gravity * height, rate + inertial])
    T, V, tau = numbers(extra, q, qd)
    theta = model.theta0
    T_gain = numbers(model.kinetic_energy, q, qd, theta) - numbers(
        without.kinetic_energy, q, qd, theta
    )
    assert T_gain == pytest.approx(T, rel=1e-11)
    V_gain = numbers(model.potential_energy, q, theta) - numbers(without.potential_energy, q, theta)
    assert V_gain == pytest.approx(V, rel=1e-11)
    still = np.zeros(model.n_u)
    gain = numbers(model.inverse_dynamics, q, qd, qdd, still, theta)
    gain = gain - numbers(without.inverse_dynamics, q, qd, qdd, still, theta)
    assert error(gain, tau) < 1e-11


def test_payload_as_a_parameter(rng):
    """`forces[1].mass` at another value is the robot with that payload."""
    robot = with_forces(cases.robot(3), Payload(3, 0.5, (0.1, 0.2, 0.3)))
    paths = ("forces[1].mass", "forces[1].inertia")
    model = dtc.build(robot, chart="cardan", parameters=paths)
    inertia = tensor(rng, np.eye(3))
    heavy = replace(robot.forces[0], mass=2.5, inertia=inertia)
    other = dtc.build(with_forces(robot, heavy), chart="cardan", parameters=paths)
    q, qd, qdd = state(rng, ("cardan",) * 2)
    pressure = np.ones(model.n_u)
    assert model.theta_blocks["forces[1].inertia"].stop == len(model.theta0)
    value = numbers(model.inverse_dynamics, q, qd, qdd, pressure, other.theta0)
    expected = numbers(
        dtc.build(with_forces(robot, heavy)).inverse_dynamics,
        *(q, qd, qdd, pressure, dtc.build(with_forces(robot, heavy)).theta0),
    )
    assert error(value, expected) < ROUND_OFF
