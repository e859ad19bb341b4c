"""The model's equations of motion (`dtcasadi.model`) against the plain Lagrangian by AD."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.chain import spread
from oracles.lagrangian import inverse_dynamics_jacobian
from oracles.newton import last_disc_tension
from oracles.robots import coordinates

# One of each kind where a test needs further builds of the model.
FEW = [(3, spread("cardan", 3)), (3, ("paper", "rigid")), (3, ("ball", "planar"))]
CHARTS = [
    *FEW,
    (2, ("cardan",)),
    (4, spread("cardan", 4)),
    (3, spread("paper", 3)),
    (4, spread("planar", 4)),
    (3, spread("hinge", 3)),
]
# Seconds each to build; the default run has every chart and every number of discs without them.
SLOW = [
    (2, ("paper",)),
    (4, spread("paper", 4)),
    (2, ("planar",)),
    (3, spread("ball", 3)),
    (4, ("cardan", "planar", "ball")),
    (4, ("hinge", "rigid", "paper")),
]

# Round-off of some thousand operations is 1e-13 of the largest term; cancellation adds a decade.
ROUND_OFF = 1e-12


def name(value: object) -> str:
    """A test's id: the number of discs, then the charts."""
    return "_".join(dict.fromkeys(value)) if isinstance(value, tuple) else str(value)


every_chart = pytest.mark.parametrize(
    ("n", "charts"),
    CHARTS + [pytest.param(*case, marks=pytest.mark.slow) for case in SLOW],
    ids=name,
)
some_charts = pytest.mark.parametrize(("n", "charts"), FEW, ids=name)


class Point(NamedTuple):
    """A state of the shared robot with inputs, and every term of its equations there."""

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    pressure: np.ndarray
    tau: np.ndarray
    plain: dict[str, np.ndarray]


@cache
def points(n: int, charts: tuple[str, ...]) -> list[Point]:
    """Three random points."""
    rng = np.random.default_rng(n + len(set(charts)))
    oracle = cases.oracle(n, charts)
    result = []
    for _ in range(3):
        q = coordinates(rng, charts)
        qd, qdd, tau = rng.normal(size=(3, len(q)))
        pressure = rng.uniform(-1.0, 5.0, len(cases.robot(n).chambers))
        plain = cases.evaluate(oracle, q, qd, qdd, pressure)
        result.append(Point(q, qd, qdd, pressure, tau, plain))
    return result


@every_chart
def test_terms(n, charts):
    """Kinematics, Table I, eq (6), every force, energies and momenta."""
    model = cases.model(n, charts)
    theta = model.theta0
    for at in points(n, charts):
        expected = {
            "angular_jacobians": ((at.q,), "J"),
            "mass_matrix": ((at.q,), "M"),
            "coriolis": ((at.q, at.qd), "coriolis"),
            "gravity": ((at.q,), "gravity"),
            "spring": ((at.q,), "spring"),
            "damping": ((at.q, at.qd), "damping"),
            "inflation": ((at.q, at.pressure), "inflation"),
            "kinetic_energy": ((at.q, at.qd), "T"),
            "potential_energy": ((at.q,), "V"),
            "momenta": ((at.q, at.qd), "p"),
            "lagrangian_gradient": ((at.q, at.qd), "dL_dq"),
            "inverse_dynamics": ((at.q, at.qd, at.qdd, at.pressure), "tau"),
        }
        for function, (arguments, term) in expected.items():
            value = numbers(getattr(model, function), *arguments, theta)
            assert error(value, at.plain[term]) < ROUND_OFF, function
        R, r = numbers(model.poses, at.q, theta)
        assert error(R, at.plain["R"]) < ROUND_OFF
        assert error(r, at.plain["r"]) < ROUND_OFF


@every_chart
def test_forward_dynamics_leaves_no_residual(n, charts):
    """The Lagrangian's equations hold with the model's accelerations in them."""
    model, oracle = cases.model(n, charts), cases.oracle(n, charts)
    for at in points(n, charts):
        qdd = numbers(model.forward_dynamics, at.q, at.qd, at.pressure, at.tau, model.theta0)
        reached = cases.evaluate(oracle, at.q, at.qd, qdd, at.pressure)["tau"]
        # Relative to the largest product in M qdd, as round-off in solving is.
        scale = np.max(np.abs(at.plain["M"]) @ np.abs(qdd)) + np.max(np.abs(at.tau))
        assert np.max(np.abs(reached - at.tau)) < ROUND_OFF * scale


@some_charts
@pytest.mark.parametrize(
    ("velocity_terms", "damping"),
    [("full", "coordinate"), ("paper", "physical"), ("paper", "coordinate"), ("none", "physical")],
)
def test_options(n, charts, velocity_terms, damping):
    """Each choice of velocity terms and damping, in every form of the equations."""
    model = cases.model(n, charts, velocity_terms=velocity_terms, damping=damping)
    for at in points(n, charts):
        plain = at.plain
        kept = {"full": plain["coriolis"], "paper": plain["coriolis_paper"], "none": 0 * at.q}
        coriolis = kept[velocity_terms]
        friction = plain["damping" if damping == "physical" else "damping_coordinate"]
        change = coriolis - plain["coriolis"] + friction - plain["damping"]
        theta = model.theta0
        assert error(numbers(model.coriolis, at.q, at.qd, theta), coriolis) < ROUND_OFF
        assert error(numbers(model.damping, at.q, at.qd, theta), friction) < ROUND_OFF
        tau = numbers(model.inverse_dynamics, at.q, at.qd, at.qdd, at.pressure, theta)
        assert error(tau, plain["tau"] + change) < ROUND_OFF
        # Forward dynamics with that tau gives the accelerations back; 1e-9 allows for cond(M).
        again = numbers(model.forward_dynamics, at.q, at.qd, at.pressure, tau, theta)
        assert error(again, at.qdd) < 1e-9


@every_chart
def test_inverse_dynamics_jacobian(n, charts):
    """The recursive derivatives against forward-mode AD of the Lagrangian's equations."""
    model = cases.model(n, charts)
    exact = inverse_dynamics_jacobian(cases.oracle(n, charts))
    for at in points(n, charts)[:1]:
        arguments = at.q, at.qd, at.qdd, at.pressure
        values = numbers(model.inverse_dynamics_jacobian, *arguments, model.theta0)
        for value, expected in zip(values, exact(*arguments), strict=True):
            # A derivative takes a few times the operations of its function.
            assert error(value.reshape(expected.shape), expected) < 10 * ROUND_OFF


@every_chart
def test_forward_dynamics_derivatives(n, charts):
    """In `ode_jacobian`, x = [q; qd], u = pressure: d qdd = -M^-1 d(inverse dynamics)."""
    model, n_q = cases.model(n, charts), len(points(n, charts)[0].q)
    exact = inverse_dynamics_jacobian(cases.oracle(n, charts))
    zero = np.zeros(n_q)
    for at in points(n, charts)[:1]:
        x = np.concatenate([at.q, at.qd])
        xdot, F_x, F_u = numbers(model.ode_jacobian, x, at.pressure, model.theta0)
        F_u = F_u.reshape(2 * n_q, -1)
        qdd = numbers(model.forward_dynamics, at.q, at.qd, at.pressure, zero, model.theta0)
        assert error(xdot, np.concatenate([at.qd, qdd])) < ROUND_OFF
        by_q, by_qd = exact(at.q, at.qd, qdd, at.pressure)
        upper = np.hstack([np.zeros((n_q, n_q)), np.eye(n_q)])
        lower = -np.linalg.solve(at.plain["M"], np.hstack([by_q, by_qd]))
        # The solve loses cond(M), up to 1e5 at these points.
        assert error(F_x, np.vstack([upper, lower])) < 1e-9
        for k, unit in enumerate(np.eye(len(at.pressure))):
            push = numbers(model.inflation, at.q, unit, model.theta0)
            expected = np.concatenate([zero, np.linalg.solve(at.plain["M"], push)])
            assert error(F_u[:, k], expected) < 1e-9


@some_charts
@pytest.mark.parametrize("velocity_terms", ["full", "paper"])
def test_canonical_form_is_the_same_motion(n, charts, velocity_terms):
    """Eq (7): with p = M qd, the canonical rates are qd and d(M qd)/dt = Mdot qd + M qdd."""
    model = cases.model(n, charts, velocity_terms=velocity_terms)
    theta = model.theta0
    for at in points(n, charts):
        inputs = at.pressure, at.tau, theta
        qdd = numbers(model.forward_dynamics, at.q, at.qd, *inputs)
        qd, pd = numbers(model.canonical_ode, at.q, at.plain["p"], *inputs)
        assert error(qd, at.qd) < 1e-9  # solves with M: cond(M) up to 1e5
        expected = at.plain["coriolis_paper"] + at.plain["M"] @ qdd
        scale = np.max(np.abs(at.plain["M"]) @ np.abs(qdd))  # of the terms that cancel
        assert np.max(np.abs(pd - expected)) < 1e-9 * max(scale, np.max(np.abs(expected)))


@every_chart
def test_power_balance(n, charts):
    """Energy's rate d(T + V)/dt = qd . (inflation + tau - damping) with everything on."""
    model = cases.model(n, charts)
    theta = model.theta0
    for at in points(n, charts):
        qdd = numbers(model.forward_dynamics, at.q, at.qd, at.pressure, at.tau, theta)
        fixed = np.zeros(np.shape(theta))
        T = numbers(model.kinetic_energy, at.q, at.qd, theta)
        V = numbers(model.potential_energy, at.q, theta)
        kinetic = numbers(model.kinetic_energy.forward(1), at.q, at.qd, theta, T, at.qd, qdd, fixed)
        potential = numbers(model.potential_energy.forward(1), at.q, theta, V, at.qd, fixed)
        force = (
            numbers(model.inflation, at.q, at.pressure, theta)
            + at.tau
            - numbers(model.damping, at.q, at.qd, theta)
        )
        # Relative to the powers that cancel.
        scale = np.abs(at.qd) @ np.abs(force) + np.abs(at.plain["p"]) @ np.abs(qdd)
        assert abs(kinetic[0] + potential[0] - at.qd @ force) < ROUND_OFF * scale


@every_chart
def test_thread_tension(n, charts):
    """The multiplier of each thread's length; and Newton's law of the last disc."""
    model, oracle = cases.model(n, charts), cases.oracle(n, charts)
    for at in points(n, charts):
        inputs = at.pressure, at.tau, model.theta0
        qdd = numbers(model.forward_dynamics, at.q, at.qd, *inputs)
        tension = numbers(model.thread_tension, at.q, at.qd, *inputs)
        expected = cases.evaluate(oracle, at.q, at.qd, qdd, at.pressure)["tension"]
        last = last_disc_tension(cases.robot(n), charts, at.q, at.qd, qdd, at.pressure)
        assert error(tension, expected) < ROUND_OFF
        # The last one may be small beside the others.
        assert abs(tension[-1] - last) < ROUND_OFF * np.max(np.abs(expected))
