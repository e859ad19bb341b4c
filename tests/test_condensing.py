"""Linear dynamics over a horizon: C kernels and twins against dense algebra by hand."""

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler
from scipy.linalg import block_diag, solve_discrete_are

from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.condensing import Quadratic, condensed, response, riccati

N_X, N_U, N_R, N_G, N = 5, 2, 3, 1, 6
BLOCKS = (0, 0, 1, 2, 2, 3)


class Chain(NamedTuple):
    """Blocks of a random problem, k along the first axis."""

    A: np.ndarray
    B: np.ndarray
    c: np.ndarray
    R: np.ndarray
    G: np.ndarray
    W: np.ndarray
    P: np.ndarray
    x0: np.ndarray
    u: np.ndarray


@pytest.fixture
def chain(rng) -> Chain:
    def drawn(*shape: int) -> np.ndarray:
        return rng.normal(size=shape)

    P = drawn(N_X + N_U, N_X + N_U)
    sizes = ((N, N_X, N_X), (N, N_X, N_U), (N, N_X), (N, N_R, N_X), (N, N_G, N_X))
    A, B, c, R, G = (drawn(*size) for size in sizes)
    return Chain(
        0.6 * A, B, c, R, G, rng.uniform(0, 2, (N, N_R)), P @ P.T, drawn(N_X), drawn(N, N_U)
    )


def beside(blocks: np.ndarray) -> np.ndarray:
    """Blocks, k along the first axis, side by side."""
    return np.hstack(list(blocks))


def bound(function: ca.Function, native: ca.Function, compiled: bool) -> Bound:
    return Bound(twin(function, source=native) if compiled else function)


BOTH = pytest.mark.parametrize(
    "compiled", [False, pytest.param(True, marks=needs_compiler)], ids=["twin", "kernel"]
)


def condensing(native: bool, n_r: int = N_R, n_g: int = N_G) -> ca.Function:
    shapes = {"a": (N_X, N_X * N), "b": (N_X, N_U * N), "r": (n_r, N_X * N), "g": (n_g, N_X * N)}
    shapes |= {"w": (n_r, N), "p": (N_X + N_U, N_X + N_U)}
    ports = [ca.MX.sym(name, *shape) for name, shape in shapes.items()]
    A, B, R, G, W, P = ports
    found = condensed(A, B, R, G, W, P, BLOCKS, native=native)
    return ca.Function("condensing", ports, list(found), [*shapes], ["h", "j", "c", "s"])


def states_by_commands(chain: Chain) -> np.ndarray:
    """d (x_1 ... x_N) / d v of all blocks, from the inverse of the dynamics' bidiagonal matrix."""
    dynamics = np.eye(N * N_X)
    for k in range(1, N):
        dynamics[k * N_X : (k + 1) * N_X, (k - 1) * N_X : k * N_X] = -chain.A[k]
    commands = np.kron(np.eye(max(BLOCKS) + 1)[list(BLOCKS)], np.eye(N_U))
    return np.linalg.solve(dynamics, block_diag(*chain.B)) @ commands


@BOTH
def test_condensing_is_the_elimination_of_the_states(chain, compiled):
    call = bound(condensing(False), condensing(True), compiled)
    found = call(
        beside(chain.A), beside(chain.B), beside(chain.R), beside(chain.G), chain.W.T, chain.P
    )
    S = states_by_commands(chain)
    J = block_diag(*chain.R) @ S
    last = np.eye(S.shape[1])[-N_U:]
    T = np.vstack([S[-N_X:], last])
    H = J.T @ np.diag(chain.W.ravel()) @ J + T.T @ chain.P @ T
    for value, expected in zip(
        found, (H, J.T, (block_diag(*chain.G) @ S).T, S[-N_X:]), strict=True
    ):
        # Products of some tens of numbers of order 1.
        np.testing.assert_allclose(value, expected, atol=1e-12 * np.max(np.abs(expected)))


@BOTH
def test_condensing_without_residuals_or_limits(chain, compiled):
    call = bound(condensing(False, 0, 0), condensing(True, 0, 0), compiled)
    none = np.zeros((0, N_X * N))
    found = call(beside(chain.A), beside(chain.B), none, none, np.zeros((0, N)), chain.P * 0)
    assert found.j.shape == (8, 0) and found.c.shape == (8, 0)
    assert not np.any(found.h)
    np.testing.assert_allclose(found.s, states_by_commands(chain)[-N_X:], atol=1e-12)


@BOTH
def test_response_is_the_dynamics_step_by_step(chain, compiled):
    shapes = {"a": (N_X, N_X * N), "b": (N_X, N_U * N), "c": (N_X, N)}
    shapes |= {"x": (N_X, 1), "u": (N_U, N)}
    ports = [ca.MX.sym(name, *shape) for name, shape in shapes.items()]
    sides = [
        ca.Function("response", ports, [response(*ports, native=native)], [*shapes], ["states"])
        for native in (False, True)
    ]
    states = [chain.x0]
    for k in range(N):
        states.append(chain.A[k] @ states[-1] + chain.B[k] @ chain.u[k] + chain.c[k])
    found = bound(*sides, compiled)(
        beside(chain.A), beside(chain.B), chain.c.T, chain.x0, chain.u.T
    )
    np.testing.assert_allclose(found, np.transpose(states), atol=1e-12)


def recursion(native: bool, horizon: int, n_x: int = N_X, n_u: int = N_U) -> ca.Function:
    shapes = {"a": (n_x, n_x * horizon), "b": (n_x, n_u * horizon), "c": (n_x, horizon)}
    shapes |= {"qq": (n_x, n_x * (horizon + 1)), "ss": (n_u, n_x * horizon)}
    shapes |= {"rr": (n_u, n_u * horizon), "ql": (n_x, horizon + 1), "rl": (n_u, horizon)}
    shapes |= {"x0": (n_x, 1)}
    ports = [ca.MX.sym(name, *shape) for name, shape in shapes.items()]
    A, B, c, *cost, x0 = ports
    found = riccati(A, B, c, Quadratic(*cost), x0, native=native)
    names = ["gain", "offset", "x", "u", "failed"]
    return ca.Function("recursion", ports, list(found), [*shapes], names)


@BOTH
def test_riccati_solves_the_optimality_conditions(chain, rng, compiled):
    n = N_X + N_U
    cost = [root @ root.T + np.eye(n) for root in rng.normal(size=(N + 1, n, n))]
    slope = rng.normal(size=(N + 1, n))
    Q, S, R = (
        [c[rows, cols] for c in cost]
        for rows, cols in (
            (slice(N_X), slice(N_X)),
            (slice(N_X, n), slice(N_X)),
            (slice(N_X, n), slice(N_X, n)),
        )
    )
    call = bound(recursion(False, N), recursion(True, N), compiled)
    found = call(
        *(beside(chain.A), beside(chain.B), chain.c.T, np.hstack(Q), np.hstack(S[:N])),
        *(np.hstack(R[:N]), slope[:, :N_X].T, slope[:N, N_X:].T, chain.x0),
    )
    assert found.failed == 0
    # The same problem as one dense system in x_1 ... x_N, u_0 ... u_{N-1} and multipliers.
    order = [(k, "u") for k in range(N)] + [(k, "x") for k in range(1, N + 1)]
    place, size = {}, 0
    for k, kind in order:
        place[k, kind] = slice(size, size := size + (N_U if kind == "u" else N_X))
    H, g = np.zeros((size, size)), np.zeros(size)
    E, e = np.zeros((N * N_X, size)), np.zeros(N * N_X)
    for k in range(N):
        row, u = slice(k * N_X, (k + 1) * N_X), place[k, "u"]
        H[u, u], g[u] = R[k], slope[k, N_X:]
        E[row, u], E[row, place[k + 1, "x"]], e[row] = -chain.B[k], np.eye(N_X), chain.c[k]
        if k:
            x = place[k, "x"]
            H[u, x], H[x, u], E[row, x] = S[k], S[k].T, -chain.A[k]
        else:
            g[u] += S[0] @ chain.x0
            e[row] += chain.A[0] @ chain.x0
        x = place[k + 1, "x"]
        H[x, x], g[x] = Q[k + 1], slope[k + 1, :N_X]
    whole = np.block([[H, E.T], [E, np.zeros((len(e), len(e)))]])
    solution = np.linalg.solve(whole, np.concatenate([-g, e]))
    for k in range(N):
        # Costs of order 10 and a conditioned system of some 1e3.
        np.testing.assert_allclose(found.u[:, k], solution[place[k, "u"]], atol=1e-9)
        np.testing.assert_allclose(found.x[:, k + 1], solution[place[k + 1, "x"]], atol=1e-9)
        K = found.gain[:, N_X * k : N_X * (k + 1)]
        np.testing.assert_allclose(K @ found.x[:, k] + found.offset[:, k], found.u[:, k])


@BOTH
def test_the_gain_tends_to_that_of_the_riccati_equation(rng, compiled):
    n, horizon = 3, 60
    A, B = rng.normal(size=(n, n)), rng.normal(size=(n, 1))
    P = solve_discrete_are(A, B, np.eye(n), np.eye(1))
    K = -np.linalg.solve(np.eye(1) + B.T @ P @ B, B.T @ P @ A)
    call = bound(recursion(False, horizon, n, 1), recursion(True, horizon, n, 1), compiled)
    zero = np.zeros((n, horizon + 1))
    found = call(
        *(np.tile(A, horizon), np.tile(B, horizon), zero[:, 1:], np.tile(np.eye(n), horizon + 1)),
        *(np.zeros((1, n * horizon)), np.ones((1, horizon)), zero, zero[:1, 1:], np.ones(n)),
    )
    np.testing.assert_allclose(found.gain[:, :n], K, rtol=1e-9)


@BOTH
def test_riccati_says_when_the_cost_is_not_convex(chain, compiled):
    call = bound(recursion(False, N), recursion(True, N), compiled)
    shapes = [call.function.size_in(i) for i in range(call.function.n_in())]
    arguments = [np.zeros(shape) for shape in shapes]
    arguments[5][:] = -np.hstack([np.eye(N_U)] * N)
    assert call(*arguments).failed == 1
