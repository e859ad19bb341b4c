"""ocp.rti on linear plants: the linear regulator, exact constrained solutions, phases, blocks."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler
from control_toy import cart
from linear_toy import LinearDiscrete
from scipy.linalg import solve_discrete_are

import ocp.mpc
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from ocp import Band, Effort, Limits, PressureMPC, Problem, Tracking

N = 12


def pushed(rng: np.random.Generator) -> LinearDiscrete:
    """Five states, two commands, an output for each; a mode that grows."""
    F = 0.2 * rng.normal(size=(5, 5)) + np.diag([1.02, 0.9, 0.5, 0.3, 0.1])
    measured = {"y": (rng.normal(size=(2, 5)), np.zeros((2, 1)), np.eye(2))}
    G, B = rng.normal(size=(5, 2)), rng.normal(size=(5, 1))
    return LinearDiscrete(F, G, B, measured, np.zeros(1), {"load": slice(0, 1)})


def moved(plant: LinearDiscrete, x: np.ndarray, u: np.ndarray, load: float = 0.0) -> np.ndarray:
    return plant.F @ x + plant.G @ u + plant.B[:, 0] * load


def dense(plant: LinearDiscrete, problem: Problem, x, u_last, reference, load=0.0) -> np.ndarray:
    """First commands by a dense program in all commands and slacks, written down anew.

    Bounds, rates and soft bands of `y` are rows; the plan comes from CasADi's daqp.
    """
    H_y = plant.measured["y"][0]
    N, n_u, m = problem.horizon, plant.G.shape[1], len(H_y)
    n = N * n_u
    effort, limits = problem.effort, problem.limits
    # y_k = free_k + forced_k u by stepping through the plant with unit commands.
    outputs = np.zeros((N, m, n + 1))
    for column in range(n + 1):
        z = x if column == n else np.zeros(len(x))
        for k in range(N):
            u = np.zeros(n_u)
            if column < n and column // n_u == k:
                u[column % n_u] = 1.0
            z = moved(plant, z, u, load if column == n else 0.0)
            outputs[k, :, column] = H_y @ z
    free, forced = outputs[:, :, n].ravel(), outputs[:, :, :n].reshape(N * m, n)
    change = np.eye(n) - np.eye(n, k=-n_u)
    before = np.zeros(n)
    before[:n_u] = u_last
    W = np.tile(np.broadcast_to(problem.tracking[0].weight, m), N)
    H = forced.T @ (W[:, None] * forced) + effort.change * change.T @ change
    g = forced.T @ (W * (free - np.tile(reference, N))) - effort.change * change.T @ before
    rows, below, above = [change], [before - limits.rate * 0.1], [before + limits.rate * 0.1]
    sizes = [0, N * m, N * m] if problem.soft else [0]
    k = sum(sizes)
    if problem.soft:
        band = problem.soft[0]
        for sign, bound in ((1, band.upper), (-1, band.lower)):
            rows.append(sign * forced)
            below.append(np.full(N * m, -np.inf))
            above.append(sign * (bound - free))
        H = np.block([[H, np.zeros((n, k))], [np.zeros((k, n)), band.quadratic * np.eye(k)]])
        g = np.concatenate([g, np.full(k, band.linear / 2)])
    A = np.hstack([np.vstack(rows), np.vstack([np.zeros((n, k)), -np.eye(k)])])
    shapes = {"h": ca.Sparsity.dense(*H.shape), "a": ca.Sparsity.dense(*A.shape)}
    tight = {"daqp": {"primal_tol": 1e-11, "dual_tol": 1e-14}}
    solver = ca.conic("reference", "daqp", shapes, tight)
    lbx = np.concatenate([np.full(n, limits.lower), np.zeros(k)])
    ubx = np.concatenate([np.full(n, limits.upper), np.full(k, np.inf)])
    found = solver(
        h=H, g=g, a=A, lba=np.concatenate(below), uba=np.concatenate(above), lbx=lbx, ubx=ubx
    )
    return np.array(found["x"])[:n, 0].reshape(N, n_u)


@needs_compiler
def test_within_the_limits_it_is_the_linear_regulator(rng):
    plant = pushed(rng)
    n, m = 5, 2
    weight, change, level = np.array([2.0, 0.7]), 0.3, 0.1
    H_y = plant.measured["y"][0]
    # The regulator of z = (x; u before) for w = u - u before, from its textbook form.
    A = np.block([[plant.F, plant.G], [np.zeros((m, n)), np.eye(m)]])
    B = np.vstack([plant.G, np.eye(m)])
    Q = np.zeros((n + m, n + m))
    Q[:n, :n] = H_y.T @ np.diag(weight) @ H_y
    Q[n:, n:] = level * np.eye(m)
    S = np.vstack([np.zeros((n, m)), level * np.eye(m)])
    R = (change + level) * np.eye(m)
    P = solve_discrete_are(A, B, Q, R, s=S)
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A + S.T)
    problem = Problem(
        N,
        Tracking("y", 0.0, weight),
        effort=Effort(change=change, level=level),
        limits=Limits(-1e4, 1e4),
        terminal="riccati",
    )
    controller = PressureMPC(plant, problem, u0=np.zeros(m))
    x, before = rng.normal(size=n), np.zeros(m)
    for _ in range(20):
        u, info = controller.step(x)
        assert info.status == 0 and info.text == "the plan is solved; the command is the plan's"
        expected = before - K @ np.concatenate([x, before])
        np.testing.assert_allclose(u, expected, atol=1e-8)
        x, before = moved(plant, x, u), u
    assert np.max(np.abs(x)) < 0.1


LIMITED = Problem(
    N,
    Tracking("y", 0.0, (1.0, 2.0)),
    effort=Effort(change=0.05),
    limits=Limits(-0.5, 0.6, rate=2.0),
    soft=Band("y", -0.4, 0.6, linear=20.0, quadratic=5.0),
)


@pytest.mark.parametrize("soft", [False, True])
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=needs_compiler)])
def test_constrained_steps_are_those_of_an_exact_program(rng, soft, compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(ocp.mpc, "twin", lambda plain, source: plain)
    plant = pushed(rng)
    problem = LIMITED if soft else replace(LIMITED, soft=())
    controller = PressureMPC(plant, problem, u0=np.zeros(2))
    x, before, active = rng.normal(size=5), np.zeros(2), set()
    for k in range(25 if compiled else 6):
        reference = np.array([1.0, -1.0]) if k % 20 < 10 else np.array([-0.5, 0.5])
        u, info = controller.step(x, reference=reference, theta=[0.1])
        assert info.status == 0
        expected = dense(plant, problem, x, before, reference, 0.1)
        np.testing.assert_allclose(info.plan, expected, atol=1e-8)
        active |= set(np.round(controller.memory[26:-2]))
        x, before = moved(plant, x, u, 0.1), u
    assert {-1.0, 0.0, 1.0} <= active


@needs_compiler
def test_the_phases_make_the_step(rng):
    """On a linear plant, feedback from any preparation is the step; a preparation has no side."""
    plant = pushed(rng)
    whole = PressureMPC(plant, replace(LIMITED, horizon=6), u0=np.zeros(2))
    functions, memory = whole.functions(), whole.memory
    prepare, feedback = (
        Bound(twin(each.function, source=each.source))
        for each in (functions[f"control_{name}"] for name in ("prepare", "feedback"))
    )
    x = 0.3 * rng.normal(size=5)
    reference = np.zeros((7, 2))
    for _ in range(8):
        u, info = whole.step(x)
        prepared = prepare(rng.normal(size=5), np.zeros(1), reference.T, memory)
        found = feedback(x, prepared, memory)
        memory = found.memory_next
        np.testing.assert_allclose(found.u, u, atol=1e-9)
        np.testing.assert_allclose(found.states.T, info.states, atol=1e-8)
        x = moved(plant, x, u)


@needs_compiler
def test_blocks_share_their_commands(rng):
    plant = pushed(rng)
    problem = replace(LIMITED, horizon=6, blocks=(1, 2, 3), soft=())
    controller = PressureMPC(plant, problem, u0=np.zeros(2))
    x = 0.5 * rng.normal(size=5)
    for _ in range(5):
        u, info = controller.step(x)
        starts = np.repeat([0, 1, 3], (1, 2, 3))
        # A jump cut to its rate limit by a round-off is made up for in the next interval.
        np.testing.assert_allclose(info.plan, info.plan[starts], atol=1e-12)
        x = moved(plant, x, u)
    free = PressureMPC(plant, replace(problem, blocks=None), u0=np.zeros(2))
    blocked = PressureMPC(plant, problem, u0=np.zeros(2))
    costs = [c.check(c.step(x)[1]).cost for c in (free, blocked)]
    assert costs[0] < costs[1]


def test_a_cart_is_brought_to_its_place_and_its_plans_hold_in_simulation():
    plant = cart()
    problem = Problem(
        20,
        Tracking("place", 1.0, 10.0),
        effort=Effort(change=0.1),
        limits=Limits(-3, 3, rate=10.0),
    )
    controller = PressureMPC(plant, problem, u0=0.0)
    x = np.zeros(2)
    for _ in range(60):
        u, info = controller.step(x)
        checked = controller.check(info)
        assert checked.good and checked.gap < 1e-12 and checked.excess < 1e-12
        x = plant.F @ x + plant.G @ u
    np.testing.assert_allclose(x, [1, 0], atol=1e-3)
    # The spring of 2 at place 1.
    np.testing.assert_allclose(u, 2, atol=1e-2)
