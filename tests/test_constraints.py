"""Bilateral constraints: multipliers by hand, catenary, linkage, redundancy, derivatives, drift."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.forces import state
from scipy.integrate import solve_ivp
from scipy.optimize import root

import dtcasadi as dtc
from dtcasadi.constraints import Guided, Joined, Pinned, Strap, examine
from dtcasadi.errors import ConstraintError, ModelError, SimulationError, StaticsError

G = 9.81


def moment(arm: np.ndarray, force: np.ndarray) -> float:
    """About x, of vectors (y, z)."""
    return arm[0] * force[1] - arm[1] * force[0]


def test_multiplier_of_two_discs_by_newton_and_euler(rng):
    """A disc on a thread, its far rim point on a slope: forces, moments and kinematics by hand.

    In the plane, with mass m at c from the origin o, inertia I about it, thread tension T towards
    the root and the slope's push N along n at the point p:

        m a_c = m g - T t + N n,    I alpha = (o - c) x (-T t) + (p - c) x (N n),
        t . a_o = -|v_o|^2 / l,     n . a_p = 0.

    The multiplier is -N, as the robot feels -A^T lambda.
    """
    length, m = 0.8, 1.7
    disc = dtc.Disc.solid(m, 0.5)
    inertia = disc.inertia[0, 0]
    n = np.array([0.6, 0.8])  # (y, z)
    for _ in range(5):
        beta, psi, spin = rng.uniform(-0.6, 0.6, 3)
        t = np.array([-np.sin(beta), np.cos(beta)])
        o = length * t
        up = np.array([np.cos(beta + psi), np.sin(beta + psi)])  # the disc's y axis
        c, p = o + 0.5 * up, o + 1.0 * up
        slope = Guided(2, (0, 1, 0), (0, *p), normal=(0, *n))
        robot = dtc.Robot((disc, disc), (dtc.Thread(length),), gravity=G, constraints=(slope,))
        model = dtc.build(robot, chart="planar")
        across = np.array([-t[1], t[0]])  # d t / d beta
        turn = np.array([-up[1], up[0]])
        # n . v_p = 0 ties psi's rate to beta's.
        total = -spin * length * (n @ across) / (n @ turn)  # beta-dot + psi-dot
        v_o = spin * length * across

        def acceleration(a_c: np.ndarray, alpha: Any, arm: np.ndarray, w=total) -> Any:
            return a_c + alpha * np.array([-arm[1], arm[0]]) - w**2 * arm

        def balance(z: np.ndarray, at=(t, o, c, p, v_o)) -> np.ndarray:
            t, o, c, p, v_o = at
            a_c, alpha, T, N = z[:2], z[2], z[3], z[4]
            pull, push = -T * t, N * n
            turn = moment(o - c, pull) + moment(p - c, push)
            return np.array(
                [
                    *(m * a_c - m * np.array([-G, 0]) - pull - push),
                    inertia * alpha - turn,
                    t @ acceleration(a_c, alpha, o - c) + v_o @ v_o / length,
                    n @ acceleration(a_c, alpha, p - c),
                ]
            )

        zero = balance(np.zeros(5))
        matrix = np.column_stack([balance(e) - zero for e in np.eye(5)])
        expected = np.linalg.solve(matrix, -zero)
        at = ([beta, psi], [spin, total - spin], [], [0, 0], model.theta0)
        assert numbers(model.constraint_terms, at[0], at[1], at[4])[0] == pytest.approx([0])
        assert numbers(model.multipliers, *at)[0] == pytest.approx(-expected[4], rel=1e-9)
        assert numbers(model.thread_tension, *at)[0] == pytest.approx(expected[3], rel=1e-9)
        assert numbers(model.forward_dynamics, *at).sum() == pytest.approx(expected[2], rel=1e-9)


def links(n: int, length: float, *constraints: Any, mass: float = 1.0, **options: Any) -> dtc.Robot:
    """A hanging chain of n links whose masses are at the thread's ends; y is up."""
    disc = dtc.Disc(mass, 1e-3 * mass * np.eye(3))
    fields = {"up": (0, 1, 0), "gravity": G, "constraints": constraints} | options
    return dtc.Robot((disc,) * (n + 1), (dtc.Thread(length),) * n, **fields)


def hung(n: int, length: float, span: float) -> tuple[np.ndarray, float, float]:
    """A chain of links between two pins at the same height: angles from z, tension's two parts.

    Joint k carries the horizontal H and a vertical part that grows by each weight: its slope is
    tan theta_k = (weight of what hangs to its right - V) / H.
    """
    hanging = G * np.arange(n, 0, -1)  # masses beyond link k, the one at the far pin included

    def ends(z: np.ndarray) -> np.ndarray:
        H, V = z
        angle = np.arctan2(hanging - V, H)
        return np.array([np.sum(length * np.cos(angle)) - span, np.sum(length * np.sin(angle))])

    H, V = root(ends, [G * n / 3, G * (n + 1) / 2], tol=1e-13).x
    return np.arctan2(hanging - V, H), H, V


@pytest.mark.parametrize(("n", "assembly"), [(6, "flat"), (24, "graph")])
def test_chain_pinned_at_both_ends(n, assembly):
    """The discrete catenary rests, and the multipliers are the far pin's reaction."""
    total, span = 6.0, 4.0
    angle, H, V = hung(n, total / n, span)
    far = Guided(n + 1, (0, 0, 0), (0, 0, span), along=(1, 0, 0))
    model = dtc.build(links(n, total / n, far), chart="hinge", assembly=assembly)
    q = np.diff(angle, prepend=0.0)  # turning about x takes z towards -y: downwards is positive
    at = (q, np.zeros(n), [], np.zeros(n), model.theta0)
    phi, A, _ = numbers(model.constraint_terms, q, np.zeros(n), model.theta0)
    assert np.max(np.abs(phi)) < 1e-12 * total
    assert np.max(np.abs(numbers(model.forward_dynamics, *at))) < 1e-8 * G
    # -A^T lambda is the force (0, V, H) of the pin on the last disc: rows are directions across x.
    directions = np.array([row.pulls[0].direction for row in far.rows(ends_at(model, q))])
    force = -numbers(model.multipliers, *at) @ directions.reshape(2, 3)
    assert force == pytest.approx([0, V, H], rel=1e-8, abs=1e-8)


def ends_at(model: dtc.Model, q: np.ndarray) -> Any:
    """The poses a constraint takes."""
    from dtcasadi.constraints.values import Poses

    R, r = model.poses(q, model.theta0)
    return Poses(ca.horzsplit(R, 3), ca.horzsplit(r))


def test_the_chain_becomes_the_catenary():
    """Sag of the discrete chain against a cosh(s) curve of the same length: second order."""
    total, span = 6.0, 4.0
    a = root(lambda a: 2 * a * np.sinh(span / (2 * a)) - total, 1.0).x[0]
    sag = a * (np.cosh(span / (2 * a)) - 1)
    errors = []
    for n in (8, 16, 32):
        angle, _, _ = hung(n, total / n, span)
        # Trapezoidal masses: half of one at each pin is what the end masses of `hung` do not move.
        errors.append(np.cumsum(total / n * np.sin(angle)).max() - sag)
    ratios = np.divide(errors[:-1], errors[1:])
    assert ratios == pytest.approx([4, 4], rel=0.15)


def test_a_linkage_is_a_pendulum():
    """Three links pinned at both ends, the outer ones parallel: one coordinate theta.

    Masses m at the middle link's ends and inertias J of the discs that turn with the outer links,
    the last of them at the pin: 2 (m l^2 + J) theta'' = -2 m g l sin theta.
    """
    length, middle, theta0 = 0.7, 0.5, 0.9
    threads = (dtc.Thread(length), dtc.Thread(middle), dtc.Thread(length))
    pin = Guided(4, (0, 0, 0), (0, 0, middle), along=(1, 0, 0))
    robot = replace(links(3, 1.0, pin), threads=threads)
    model = dtc.build(robot, chart="hinge")
    # Angles from z about x, downwards positive: the first hangs down at pi/2 - theta.
    first = np.pi / 2 - theta0
    q0 = np.array([first, -first, -first])
    q0[2] = -np.pi + first  # the last link goes up again, parallel to the first
    found = examine(model, q0 + [0.05, -0.02, 0.03])
    assert (found.rows, found.rank, found.redundant) == (2, 2, 0)
    run = dtc.simulate(
        model,
        np.concatenate([q0, np.zeros(3)]),
        t_end=2.0,
        rtol=1e-9,
        atol=1e-11,
        method="dopri5",
    )
    assert run.success and "2 rows of rank 2" in run.message
    exact = solve_ivp(
        lambda t, z: [z[1], -G * length / (length**2 + 1e-3) * np.sin(z[0])],
        (0, 2.0),
        [theta0, 0.0],
        rtol=1e-11,
        atol=1e-12,
        t_eval=run.t,
    )
    assert np.max(np.abs(np.pi / 2 - run.q[0] - exact.y[0])) < 1e-7  # rtol over some 100 steps
    phi = [
        numbers(model.constraint_terms, q, qd, model.theta0)
        for q, qd in zip(run.q.T, run.qd.T, strict=True)
    ]
    assert max(np.max(np.abs(p[0])) for p in phi) < 1e-13
    rates = [p[1] @ qd for p, qd in zip(phi, run.qd.T, strict=True)]
    assert np.max(np.abs(rates)) < 1e-12
    assert np.max(np.abs(run.energy["residual"])) < 1e-7 * np.ptp(run.energy["kinetic"])
    assert run.multipliers.shape == (2, len(run.t))


def held(robot: dtc.Robot, *constraints: Any) -> dtc.Robot:
    return replace(robot, constraints=constraints)


SEVERAL = (
    Guided(3, (0.1, 0.9, 0.1), (0.2, 0.8, 2.0), normal=(1, 2, 1)),
    Strap((1, 3), (0.2, 0.5, 0), (0, 1.2, 0), 2.2),
    Joined((2, 3), (0.3, 1.0, 0.9), (0.3, 1.0, -0.1)),
)


@pytest.mark.parametrize("options", [{}, {"assembly": "graph"}], ids=["flat", "graph"])
def test_derivatives_and_canonical_form_are_exact(rng, options):
    """Against differentiation of the flat functions; eq (7) against d(M qd)/dt."""
    charts = ("cardan", "paper")
    model = dtc.build(held(cases.robot(3), *SEVERAL), chart=list(charts), **options)
    q, qd, _ = state(rng, charts)
    u, theta = np.ones(model.n_u), model.theta0
    x = ca.MX.sym("x", model.n_x)
    reference = ca.Function("J", [x], [ca.jacobian(model.plain("ode")(x, u, theta), x)])
    at = np.concatenate([q, qd])
    _, F_x, _ = numbers(model.ode_jacobian, at, u, theta)
    assert error(F_x, numbers(reference, at)) < 1e-7  # the condition of A M^-1 A^T on a real robot
    tau = rng.normal(size=model.n_q)
    qdd = numbers(model.forward_dynamics, q, qd, u, tau, theta)
    phi, A, bias = numbers(model.constraint_terms, q, qd, theta)
    assert len(phi) == 5
    assert np.max(np.abs(A @ qdd + bias)) < 1e-9 * np.max(np.abs(A @ qdd))
    multipliers = numbers(model.multipliers, q, qd, u, tau, theta)
    missing = numbers(model.inverse_dynamics, q, qd, qdd, u, theta) - tau
    assert error(missing, -A.T @ multipliers) < 1e-9
    sq, sv = ca.MX.sym("q", model.n_q), ca.MX.sym("v", model.n_q)
    rate = ca.jtimes(model.momenta(sq, sv, theta), ca.vertcat(sq, sv), ca.vertcat(sv, ca.DM(qdd)))
    p = numbers(model.momenta, q, qd, theta)
    found = numbers(model.canonical_ode, q, p, u, tau, theta)
    assert error(found[1], numbers(ca.Function("pd", [sq, sv], [rate]), q, qd)) < 1e-8


def test_rows_are_the_slopes_of_phi(rng):
    charts = ("cardan", "paper")
    model = dtc.build(held(cases.robot(3), *SEVERAL, Pinned(2, (0, 1, 0), (0, 1, 1))))
    q, qd, _ = state(rng, charts)
    at = ca.MX.sym("q", model.n_q)
    phi, _, _ = model.constraint_terms(at, qd, model.theta0)
    exact = numbers(ca.Function("A", [at], [ca.jacobian(phi, at)]), q)
    assert error(numbers(model.constraint_terms, q, qd, model.theta0)[1], exact) < 1e-12


def test_redundant_constraints_share_evenly():
    """The same pin twice: half of the multiplier each, the motion of one."""
    pin = Guided(3, (0, 0, 0), (0, 0, 1.5), along=(1, 0, 0))
    once, twice = (dtc.build(links(2, 1.0, *pins), chart="hinge") for pins in ((pin,), (pin, pin)))
    found = examine(twice, [0.5, -1.0])
    assert (found.rows, found.rank, found.redundant) == (4, 2, 2)
    assert found.message.endswith("4 rows of rank 2, 2 redundant: multipliers of least norm")
    at = (found.q, [0.0, 0.0], [], [0.3, -0.2], once.theta0)
    single = numbers(once.multipliers, *at)
    assert numbers(twice.multipliers, *at) == pytest.approx(np.tile(single / 2, 2), rel=1e-6)
    assert numbers(twice.forward_dynamics, *at) == pytest.approx([0, 0], abs=1e-6)


def test_impossible_constraints_are_refused():
    far = dtc.build(links(2, 1.0, Pinned(3, (0, 0, 0), (0, 0, 2.5))), chart="hinge")
    with pytest.raises(ConstraintError, match=r"met together, got none nearer than 0\.50. m off"):
        examine(far, [0.3, -0.2])
    with pytest.raises(ConstraintError, match="met together"):
        dtc.simulate(far, np.zeros(4), t_end=0.1)
    both = Pinned(3, (0, 0, 0), (0, 0, 1.5)), Pinned(3, (0, 0, 0), (0, 0, 1.7))
    with pytest.raises(ConstraintError, match="met together"):
        examine(dtc.build(links(2, 1.0, *both), chart="hinge"), [0.3, -0.2])
    with pytest.raises(ConstraintError, match="expected a robot that has some"):
        examine(dtc.build(links(2, 1.0), chart="hinge"))


def test_what_does_not_take_constraints_says_so():
    model = dtc.build(links(2, 1.0, Strap((1, 3), (0, 0, 0), (0, 0, 0), 1.5)), chart="hinge")
    with pytest.raises(SimulationError, match="method: expected one that keeps constraints"):
        dtc.simulate(model, [0.5, -1.0, 0, 0], t_end=0.1, method="gauss4", step_s=0.01)
    with pytest.raises(ModelError, match="method: expected one that keeps constraints"):
        model.discrete(0.01, method="gauss2")
    with pytest.raises(StaticsError, match="a robot without constraints"):
        dtc.equilibrium(model)


def test_steps_for_filters_and_controllers_stay_on_the_constraints(rng):
    """An implicit step and its derivatives, against differences along the constraints."""
    model = dtc.build(links(3, 1.0, Strap((1, 4), (0, 0, 0), (0, 0, 0), 2.0)), chart="hinge")
    discrete = model.discrete(0.02, method="sdirk2")
    q = examine(model, [0.5, -1.0, 0.4]).q
    _, A, _ = numbers(model.constraint_terms, q, [0, 0, 0], model.theta0)
    qd = rng.normal(size=3)
    qd -= A[0] * (A[0] @ qd) / (A[0] @ A[0])
    x = np.concatenate([q, qd])
    x_next, F_x, *_ = numbers(discrete.linearize, x, [], discrete.theta0)
    phi, A, _ = numbers(model.constraint_terms, x_next[:3], x_next[3:], model.theta0)
    assert abs(phi[0]) < 1e-10 and abs(A @ x_next[3:]) < 1e-10
    for k, step in enumerate(1e-6 * np.eye(6)):
        ends = [numbers(discrete.step, x + s, [], discrete.theta0)[0] for s in (step, -step)]
        assert error((ends[0] - ends[1]) / 2e-6, F_x[:, k]) < 1e-6
