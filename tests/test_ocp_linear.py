"""ocp on linear plants: against LQR, an independent QP, and the definition of the cost."""

import casadi as ca
import numpy as np
import pytest
from control_case import case
from control_toy import cart
from linear_toy import LinearDiscrete
from scipy.linalg import solve_discrete_are
from scipy.optimize import lsq_linear

from dtcasadi.errors import ControlError
from ocp import (
    Band,
    Cost,
    Effort,
    Limits,
    Problem,
    Solver,
    Sphere,
    Status,
    Tracking,
    available,
    multi_start,
    stages,
    transcribe,
)
from ocp.slopes import first_order
from ocp.solution import certificate, lagrangian

EXACT = ("sqpmethod-hpipm", "sqpmethod-qrqp", "sqpmethod-daqp")
X0, U0 = np.array([0.7, -0.4]), np.zeros(1)


@pytest.mark.parametrize("name", [*EXACT, "ipopt", "fatrop"])
def test_inside_the_constraints_the_solution_is_the_linear_regulator(name):
    discrete = cart()
    problem = Problem(10, Tracking("place", weight=4.0), Effort(level=0.1), terminal="riccati")
    found = case(stages(discrete, problem), X0, U0)
    solution = Solver(transcribe(found.stages), name)(found.instance, found.plan)
    F, G, Q = discrete.F, discrete.G, np.diag([4.0, 0.0])
    P = solve_discrete_are(F, G, Q, [[0.1]])
    K = np.linalg.solve(0.1 + G.T @ P @ G, G.T @ P @ F)
    x = X0
    for k in range(10):
        assert np.allclose(solution.u[k], -K @ x, atol=1e-8)
        x = F @ x + G @ solution.u[k]
    assert solution.status is Status.SOLVED and solution.residuals.largest < 1e-7


@pytest.mark.parametrize("scheme", ["shooting", "radau", "legendre"])
@pytest.mark.parametrize("name", EXACT[:2])
def test_inside_limits_the_solution_is_that_of_bounded_least_squares(scheme, name):
    """The condensed problem by SciPy's BVLS, an active-set method of its own."""
    discrete, N = cart(), 12
    limits = Limits(-1.0, 0.8)
    problem = Problem(N, Tracking("place", 1.0, weight=3.0), Effort(0.2, 0.1), limits)
    found = case(stages(discrete, problem), X0, U0)
    nlp = transcribe(found.stages, scheme, degree=6 if scheme != "shooting" else 1)
    solution = Solver(nlp, name)(found.instance, found.plan)
    F, G = discrete.F, discrete.G
    power = [np.linalg.matrix_power(F, k) for k in range(N + 1)]
    reach = np.array(
        [
            [(power[k - 1 - j] @ G)[0, 0] if j < k else 0.0 for j in range(N)]
            for k in range(1, N + 1)
        ]
    )
    free = np.array([(power[k] @ X0)[0] for k in range(1, N + 1)])
    change = np.eye(N) - np.eye(N, k=-1)
    A = np.vstack([np.sqrt(3) * reach, np.sqrt(0.2) * change, np.sqrt(0.1) * np.eye(N)])
    u_s = found.instance.target_u[0]
    b = np.concatenate([np.sqrt(3) * (1 - free), np.zeros(N), np.full(N, np.sqrt(0.1) * u_s)])
    expected = lsq_linear(A, b, (-1.0, 0.8), method="bvls", tol=1e-15)
    assert np.any(expected.active_mask)
    assert np.allclose(solution.u[:, 0], expected.x, atol=1e-8)
    # Collocation of degree 6 follows exp(A h) to far below that.
    assert solution.cost == pytest.approx(2 * expected.cost, rel=1e-10)


def test_costs_rates_blocks_and_slacks_are_as_the_problem_says():
    limits = Limits(-2.0, 1.9, rate=6.0)
    soft = Band("both", upper=0.1, channels=2, linear=0.02, quadratic=2.0)
    tracking = Tracking("place", lambda t: np.sin(3 * t), weight=3.0)
    problem = Problem(12, tracking, Effort(0.2, 0.1), limits, soft, "riccati", (1, 1, 2, 3, 5))
    found = case(stages(cart(), problem), np.zeros(2), U0)
    nlp = transcribe(found.stages)
    solution = Solver(nlp, "sqpmethod-qrqp")(found.instance, found.plan)
    u = solution.u[:, 0]
    assert solution.good and "optimum" in solution.text
    assert np.allclose(u[7:], u[7], atol=1e-12) and len(set(u.round(9))) == 5
    assert np.max(np.abs(np.diff(u, prepend=0.0))) <= 0.6 + 1e-12
    assert np.isclose(u[0], 0.6)  # the rate limit binds at once
    assert np.allclose(solution.slack[:, 0], np.maximum(solution.x[1:, 1] - 0.1, 0), atol=1e-9)
    assert np.max(solution.slack) > 0.01
    by_definition = Cost(found.stages)(found.instance, solution.x, solution.u)
    assert solution.cost == pytest.approx(by_definition, rel=1e-10)
    for scheme, exact in (("single", False), ("shooting", True), ("radau", False), ("radau", True)):
        other = Solver(transcribe(found.stages, scheme, exact=exact), "ipopt")
        assert other(found.instance, found.plan).cost == pytest.approx(solution.cost, rel=1e-7)


def test_an_exact_penalty_keeps_a_limit_where_it_can():
    limited = {}
    for linear in (0.0, 50.0):
        soft = Band("both", upper=0.3, channels=2, linear=linear)
        problem = Problem(12, Tracking("place", 1.0), Effort(0.01), soft=soft)
        found = case(stages(cart(), problem), np.zeros(2), U0)
        solution = Solver(transcribe(found.stages), "sqpmethod-qrqp")(found.instance, found.plan)
        limited[linear] = np.max(solution.slack)
    assert limited[0.0] > 0.05 and limited[50.0] < 1e-9


def test_a_solution_outside_its_bounds_is_not_called_one():
    """What some QP solvers return with success: the check sees each of the three faults."""
    problem = Problem(5, Tracking("place", 5.0), Effort(0.1), Limits(-1, 1))
    found = case(stages(cart(), problem), X0, U0)
    nlp = transcribe(found.stages)
    solver = Solver(nlp, "sqpmethod-qrqp")
    solution = solver(found.instance, found.plan)
    limits = tuple(np.array(part).ravel() for part in nlp.bounds(U0))
    check = lagrangian(nlp)

    def residuals(w, lam_x):
        at = check(w, found.instance.parameters, solution.lam_g)
        parts = tuple(np.array(part).ravel() for part in at)
        return certificate(nlp, parts, w, lam_x, solution.lam_g, limits)

    assert residuals(solution.w, solution.lam_x).largest < 1e-9
    at = int(np.argmax(np.abs(solution.lam_x)))  # a command at its limit
    moved = solution.w.copy()
    moved[at] += 0.01
    assert residuals(moved, solution.lam_x).feasibility >= 0.01 - 1e-12
    assert residuals(solution.w, 0 * solution.lam_x).stationarity > 1e-3
    flipped = solution.lam_x.copy()
    flipped[at] *= -1
    assert residuals(solution.w, flipped).complementarity > 1e-3
    said = {"success": True, "return_status": "Solve_Succeeded"}
    wrong = solver._status(residuals(moved, solution.lam_x).largest, said, "", 3)
    assert wrong is Status.INACCURATE and "fails the check" in wrong.sentence


def test_a_solver_stopped_early_says_so():
    problem = Problem(5, Tracking("place", 5.0), Effort(0.1), Limits(-1, 1))
    found = case(stages(cart(), problem), X0, U0)
    solution = Solver(transcribe(found.stages), "ipopt", most=2)(found.instance, found.plan)
    assert solution.status is Status.LIMIT and not solution.good
    assert solution.residuals.largest > 1e-6


def test_an_infeasible_start_is_no_crash():
    """A command in force beyond its limits: the first step goes as near as its rate allows."""
    problem = Problem(5, Tracking("place"), Effort(0.1), Limits(-1, 1, rate=5.0))
    found = case(stages(cart(), problem), X0, np.array([3.0]))
    solution = Solver(transcribe(found.stages), "sqpmethod-hpipm")(found.instance, found.plan)
    assert solution.u[0] == pytest.approx(1.0)


def test_second_derivatives_are_those_of_gauss_newton():
    x, theta = ca.MX.sym("x", 2), ca.MX.sym("theta", 1)
    r = ca.vertcat(ca.sin(x[0] * x[1]), x[0] ** 2 * theta)
    ports = ["x", "theta"]
    value = ca.Function("value", [x, theta], [r], ports, ["r"])
    slopes = ca.Function("slopes", [x, theta], [r, ca.jacobian(r, x)], ports, ["r", "R_x"])
    flat = first_order("flat", value, slopes, (1, None))
    hessian = ca.Function("h", [x, theta], [ca.hessian(ca.sumsqr(flat(x, theta)), x)[0]])
    J = np.array(slopes([0.3, -0.7], 2.0)[1])
    assert np.allclose(np.array(hessian([0.3, -0.7], 2.0)), 2 * J.T @ J, atol=1e-14)


def test_several_starts_find_the_shorter_way_round_a_ball():
    """A point driven in the plane; the straight plan is stuck behind a ball off the line."""
    eye, zero = np.eye(2), np.zeros((2, 1))
    flat = np.vstack([eye, np.zeros((1, 2))])
    measured = {"place": (eye, zero, eye), "point": (flat, np.zeros((3, 1)), np.eye(3))}
    discrete = LinearDiscrete(eye, 0.1 * eye, zero, measured, np.zeros(1), {"none": slice(0, 1)})
    ball = Sphere("point", (0.5, 0.1, 0.0), 0.3, linear=50.0, quadratic=100.0)
    problem = Problem(12, Tracking("place", (1.0, 0.0)), Effort(1e-3), Limits(-2, 2), ball)
    found = case(stages(discrete, problem), np.zeros(2), np.zeros(2))
    solver = Solver(transcribe(found.stages), "ipopt")
    best, tried = multi_start(solver, found.instance, n=10, solves=4)
    costs = [solution.cost for solution in tried if solution.good]
    assert len(tried) == 4 and best.good and best.cost == min(costs)
    assert max(costs) > 1.05 * min(costs)  # there is more than one minimum
    assert np.min(best.x[:, 1]) < -0.15  # below the ball, whose centre is above the line


def test_solvers_of_stages_refuse_a_program_without():
    nlp = transcribe(stages(cart(), Problem(2, Tracking("place"), Effort(1.0))), "single")
    for name in ("fatrop", "sqpmethod-hpipm"):
        with pytest.raises(ControlError, match="scheme: expected multiple shooting or collocation"):
            Solver(nlp, name)


def test_unknown_solvers_and_schemes_are_refused():
    found = stages(cart(), Problem(2, Tracking("place"), Effort(1.0)))
    with pytest.raises(ControlError, match="solver: expected one of .*ipopt.*, got 'snopt7'"):
        Solver(transcribe(found), "snopt7")
    with pytest.raises(
        ControlError, match="scheme: expected one of shooting, single, radau, legendre"
    ):
        transcribe(found, "euler")
    with pytest.raises(ControlError, match="ipopt: cannot be built: "):
        Solver(transcribe(found), "ipopt", options={"no_such": 1})
    assert {"ipopt", "sqpmethod-qrqp"} <= set(available())
