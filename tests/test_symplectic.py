"""Gauss methods on (q, p): the symplectic form stays, and the energy of long runs has no trend."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from oracles.robots import random_robot

import dtcasadi as dtc
from dtcasadi.commands import command_pieces
from dtcasadi.integrators import METHODS, ONE_STEP, Problem
from dtcasadi.integrators.steppers import plant_of, symbols
from dtcasadi.robot import Disc, Robot, Spring, Thread


def conservative(n: int) -> Robot:
    """Plates on springs above and below the thread, under gravity, without damping."""
    disc = Disc(1.0, np.diag([0.1, 0.1, 0.15]), centre_of_mass=np.array([0.0, 0.2, 0.0]))
    ends = (np.array([0.0, 0.5, 0.0]), np.array([0.0, -0.5, 0.0]))
    springs = tuple(Spring((i, i + 1), end, end, 20.0) for i in range(1, n) for end in ends)
    return Robot((disc,) * n, (Thread(1.0),) * (n - 1), springs)


def canonical_jacobian(model: dtc.Model, name: str) -> ca.Function:
    """(q, p, h) -> d(q_next, p_next) / d(q, p)."""
    plant = plant_of(model.graphs[1])
    at, n = symbols(plant), model.n_q
    kind = plant.kind
    q, p = kind.sym("q", n), kind.sym("p", n)
    x = ca.vertcat(q, plant.rates(q, p, at.theta))
    step = ONE_STEP[name].step(plant, at._replace(x=x, du=at.zeros(model.n_u)))
    q_next, v_next = ca.vertsplit(step.x_next, n)
    end = ca.vertcat(q_next, plant.momenta(q_next, v_next, at.theta))
    jacobian = ca.jacobian(end, ca.vertcat(q, p))
    function = ca.Function("canonical", [q, p, at.h, at.u, at.theta], [ca.densify(jacobian)])
    h = ca.SX.sym("h") if kind is ca.SX else ca.MX.sym("h")
    still = ca.DM.zeros(model.n_u)
    return ca.Function("jacobian", [q, p, h], function.call([q, p, h, still, model.theta0]))


def defect(model: dtc.Model, name: str, rng: np.random.Generator) -> float:
    """Largest entry of J^T Omega J - Omega over that of J^T J, at a large step."""
    jacobian, n = canonical_jacobian(model, name), model.n_q
    omega = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    q, qd = 0.3 * rng.normal(size=n), 0.3 * rng.normal(size=n)
    p = model.momenta(q, qd, model.theta0)
    J = jacobian(q, p, 0.02).full()
    assert np.max(np.abs(J - np.eye(2 * n))) > 1e-2
    return float(np.max(np.abs(J.T @ omega @ J - omega)) / np.max(np.abs(J.T @ J)))


@cache
def planar() -> dtc.Model:
    return dtc.build(conservative(3), chart="planar")


@pytest.mark.parametrize("name", ["gauss2", "gauss4"])
def test_the_symplectic_form_stays(rng, name):
    """To the Newton iteration's last correction, which is round-off."""
    assert defect(planar(), name, rng) < 1e-13


@pytest.mark.parametrize("name", ["rk4", "radau5", "midpoint"])
def test_other_methods_do_not_keep_it(rng, name):
    """Also the implicit midpoint rule on (q, qd): those are not canonical coordinates."""
    assert defect(planar(), name, rng) > 1e-9


@pytest.mark.parametrize("name", ["gauss2", "gauss4"])
def test_the_symplectic_form_stays_in_space(rng, name):
    """Arbitrary discs and springs, whose dampers and pressures are left out."""
    robot = random_robot(rng, 3, bare=True)
    assert defect(dtc.build(robot), name, rng) < 1e-12


def energies(model: dtc.Model, name: str, h: float, steps: int) -> np.ndarray:
    """Error of T + V at 20 000 instants of a run, relative to the kinetic energy turned over."""
    n = model.n_q
    x0 = np.concatenate([0.3 * np.sin(1 + 1.7 * np.arange(n)), np.zeros(n)])
    pieces = command_pieces(0.0, model.n_u, h * steps)
    problem = Problem(model, x0, model.theta0, pieces, 1e-6, 1e-8, step_s=h)
    run = METHODS[name].integrate(problem)
    assert not run.failure and not run.recentrings
    # The run's end is reached by adding h: round-off may leave a sliver of a step more.
    assert len(run.t) - 1 in (steps, steps + 1)
    x = run.x[:, :: max(1, steps // 20_000)]
    kinetic = np.array(model.kinetic_energy(x[:n], x[n:], model.theta0)).ravel()
    total = kinetic + np.array(model.potential_energy(x[:n], model.theta0)).ravel()
    return (total - total[0]) / np.ptp(kinetic)


def trend(errors: np.ndarray) -> float:
    """What a straight line through the errors rises by from start to end."""
    return float(np.polyfit(np.linspace(0, 1, len(errors)), errors, 1)[0])


CASES = [("hinge", 3, 0.01), ("planar", 2, 0.004)]


@pytest.mark.parametrize(("chart", "n", "h"), CASES)
def test_energy_has_no_trend_over_a_million_steps(chart, n, h):
    """gauss4 within 1e-8 of the energy turned over, at 90 (hinge) and 190 (planar) steps a period.

    Its error oscillates with amplitude C h^4; what round-off adds up to in 1e6 steps of 1e-16, at
    worst 1e-10, bounds the trend. rk4's error at the same step is a trend, which wanders a little
    as the motion, chaotic in the plane, does.
    """
    model = dtc.build(conservative(n), chart=chart)
    errors = energies(model, "gauss4", h, 1_000_000)
    assert np.max(np.abs(errors)) < 1e-8
    assert abs(trend(errors)) < 1e-10
    lost = energies(model, "rk4", h, 1_000_000)
    assert trend(lost) < -1e-6 and trend(lost) == pytest.approx(lost[-1], rel=0.3)


def test_energy_of_the_midpoint_rule_has_no_trend_either():
    """gauss2 oscillates by 6e-5; a thousandth of that is left of a trend over 1e6 steps."""
    chart, n, h = CASES[0]
    model = dtc.build(conservative(n), chart=chart)
    errors = energies(model, "gauss2", h, 1_000_000)
    assert 1e-5 < np.max(np.abs(errors)) < 1e-4
    assert abs(trend(errors)) < 1e-7
