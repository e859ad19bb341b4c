"""Free parameters: `theta` holds what the robot's fields would, and external loads."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from oracles.cases import error, evaluate, numbers
from oracles.chain import cartesian_velocities, spread
from oracles.lagrangian import lagrangian
from oracles.robots import coordinates, random_robot

import dtcasadi as dtc

ROUND_OFF = 1e-12  # of some thousand operations, relative to the largest entry
EVERY_FIELD = (
    *("discs.mass", "discs.inertia", "discs.centre_of_mass", "threads.length"),
    *("threads.exit_point", "springs.start", "springs.end", "springs.stiffness"),
    *("springs.rest_length", "springs.damping", "chambers.areas", "damping.c_a", "damping.c_b"),
    *("damping.c_w", "damping.c_r", "gravity", "up"),
)


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_another_robot_by_theta_alone(rng, assembly):
    """One robot's model at a second robot's theta is the second robot's Lagrangian."""
    charts = spread("cardan", 3)
    first, second = random_robot(rng, 3), random_robot(rng, 3)
    # Centroids cannot be parameters.
    chambers = [
        replace(b, centroids=a.centroids)
        for a, b in zip(first.chambers, second.chambers, strict=True)
    ]
    second = replace(second, chambers=chambers)
    model = dtc.build(first, parameters=EVERY_FIELD, assembly=assembly)
    theta = dtc.build(second, parameters=EVERY_FIELD, assembly=assembly).theta0
    q = coordinates(rng, charts)
    qd, qdd = rng.normal(size=(2, len(q)))
    pressure = rng.uniform(1.0, 5.0, len(first.chambers))
    plain = evaluate(lagrangian(second, charts), q, qd, qdd, pressure)
    tau = numbers(model.inverse_dynamics, q, qd, qdd, pressure, theta)
    assert error(tau, plain["tau"]) < ROUND_OFF
    assert error(numbers(model.potential_energy, q, theta), plain["V"]) < ROUND_OFF
    tension = numbers(model.thread_tension, q, qd, pressure, tau, theta)
    assert error(tension, plain["tension"]) < 1e-10  # through qdd: cond(M), about 1e3


def test_one_part_by_its_path(rng):
    """A path with a number changes that part and no other."""
    robot = random_robot(rng, 3)
    model = dtc.build(robot, chart="planar", parameters=("discs[3].mass", "springs[2].stiffness"))
    assert set(model.theta_blocks) == {"discs[3].mass", "springs[2].stiffness"}
    discs = (*robot.discs[:2], replace(robot.discs[2], mass=9.0))
    springs = list(robot.springs)
    springs[1] = replace(springs[1], stiffness=33.0)
    changed = dtc.build(replace(robot, discs=discs, springs=springs), chart="planar")
    theta = model.theta0.copy()
    theta[model.theta_blocks["discs[3].mass"]] = 9.0
    theta[model.theta_blocks["springs[2].stiffness"]] = 33.0
    q, qd, qdd = rng.uniform(-1, 1, (3, 4))
    still = np.zeros(len(robot.chambers))
    value = numbers(model.inverse_dynamics, q, qd, qdd, still, theta)
    expected = numbers(changed.inverse_dynamics, q, qd, qdd, still, changed.theta0)
    assert error(value, expected) < ROUND_OFF


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_external_loads(rng, assembly):
    """Block `wrench`, [force; moment about the disc's origin] in the root frame, by its power."""
    n, discs = 4, (2, 4)
    charts = ("cardan", "paper", "ball")
    robot = random_robot(rng, n)
    model = dtc.build(robot, chart=list(charts), wrenches=discs, assembly=assembly)
    load = rng.normal(size=(2, 6))
    theta = model.theta0.copy()
    assert not np.any(theta[model.theta_blocks["wrench"]])
    theta[model.theta_blocks["wrench"]] = load.ravel()
    q = coordinates(rng, charts)
    qd, qdd = rng.normal(size=(2, len(q)))
    pressure = rng.uniform(1.0, 5.0, len(robot.chambers))
    velocities = cartesian_velocities(robot, charts)
    rates = ca.MX.sym("rates", len(q))
    v, w = velocities(q, rates)
    power = sum(
        ca.dot(part[:3], v[:, disc - 1]) + ca.dot(part[3:], w[:, disc - 1])
        for disc, part in zip(discs, load, strict=True)
    )
    Q = numbers(ca.Function("Q", [rates], [ca.gradient(power, rates)]), qd)
    plain = evaluate(lagrangian(robot, charts), q, qd, qdd, pressure)
    tau = numbers(model.inverse_dynamics, q, qd, qdd, pressure, theta)
    assert error(tau, plain["tau"] - Q) < ROUND_OFF
    # The other forms agree with inverse dynamics.
    qdd_again = numbers(model.forward_dynamics, q, qd, pressure, tau, theta)
    assert error(qdd_again, qdd) < 1e-10  # cond(M), about 1e3
    _, pd = numbers(model.canonical_ode, q, plain["p"], pressure, tau, theta)
    assert error(pd, plain["coriolis_paper"] + plain["M"] @ qdd) < 1e-10
    directions = numbers(model.poses, q, theta)[0], robot.threads[2].bend
    t = directions[0][:, 6:9] @ directions[1][:, 2]  # `ball`: the thread stays on A z of disc 3
    tension = numbers(model.thread_tension, q, qd, pressure, tau, theta)
    pull = plain["tension"][2] + t @ load[1, :3]
    assert tension[2] == pytest.approx(pull, abs=1e-10 * np.max(np.abs(plain["tension"])))
