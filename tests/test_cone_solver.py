"""The cone solver: against all modes of plane friction, least squares, and Coulomb's law itself."""

import itertools
from functools import cache

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler
from scipy.optimize import nnls

from dtcasadi.compile import compile_functions
from dtcasadi.contact.kernels import solution
from dtcasadi.contact.solver import solve_contacts
from dtcasadi.linear import Factored

SOLVED = 1e-11  # what the solver promises, of the largest impulse


def system(rng: np.random.Generator, m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """G = J J^T of random contacts and the velocities b they would have, in the range of J."""
    J = rng.normal(size=(3 * m, n))
    return J @ J.T, J @ rng.normal(size=n)


def defect(G: np.ndarray, b: np.ndarray, mu: np.ndarray, p: np.ndarray) -> float:
    """Largest violation of Signorini's and Coulomb's conditions, each written out."""
    u = (G @ p + b).reshape(-1, 3)
    P = p.reshape(-1, 3)
    slip, pull = np.linalg.norm(u[:, 1:], axis=1), np.linalg.norm(P[:, 1:], axis=1)
    aligned = slip[:, np.newaxis] * P[:, 1:] + (mu * P[:, 0])[:, np.newaxis] * u[:, 1:]
    parts = [-u[:, 0], -P[:, 0], P[:, 0] * u[:, 0], pull - mu * P[:, 0], np.abs(aligned).ravel()]
    return max(float(np.max(part)) for part in parts)


@pytest.mark.parametrize("m", [1, 3, 6])
def test_coulombs_law_holds(rng, m):
    for _ in range(20):
        G, b = system(rng, m, int(rng.integers(3, 3 * m + 2)))
        mu = rng.uniform(0, 1, m)
        p, residual = solve_contacts(G, b, mu, np.ones(m))
        assert residual < SOLVED
        scale = np.max(np.abs(p), initial=1.0) * np.max(np.abs(G))
        assert defect(G, b, mu, p) < 1e-9 * scale  # impulses enter squared
        pull = np.linalg.norm(p.reshape(-1, 3)[:, 1:], axis=1)
        assert np.all(pull <= mu * p[::3] * (1 + 1e-15))


def test_without_friction_it_is_nonnegative_least_squares(rng):
    """With G = J J^T: the least |J^T p + c|^2 over p >= 0."""
    for _ in range(20):
        J, c = rng.normal(size=(5, 7)), rng.normal(size=7)
        expected, _ = nnls(J.T, -c, maxiter=1000)
        G, b = np.zeros((15, 15)), np.zeros(15)
        G[::3, ::3], b[::3] = J @ J.T, J @ c
        p, _ = solve_contacts(G, b, np.zeros(5), np.ones(5))
        assert p[::3] == pytest.approx(expected, abs=1e-9)
        assert not np.any(p.reshape(-1, 3)[:, 1:])


def modes(G: np.ndarray, b: np.ndarray, mu: np.ndarray) -> list[np.ndarray]:
    """Every solution of plane contact by trying open, stick and both slips at each contact."""
    m, found = len(mu), []
    for mode in itertools.product(("open", "stick", "left", "right"), repeat=m):
        A, rhs = np.zeros((2 * m, 2 * m)), np.zeros(2 * m)
        for s, kind in enumerate(mode):
            n, t = 2 * s, 2 * s + 1
            sign = {"left": 1.0, "right": -1.0}.get(kind, 0.0)
            if kind == "open":
                A[n, n] = A[t, t] = 1.0
            else:
                A[n], rhs[n] = G[n], -b[n]
                if kind == "stick":
                    A[t], rhs[t] = G[t], -b[t]
                else:
                    A[t, t], A[t, n] = 1.0, -sign * mu[s]
        if abs(np.linalg.det(A)) < 1e-12:
            continue
        p = np.linalg.solve(A, rhs)
        u = G @ p + b
        good = True
        for s, kind in enumerate(mode):
            n, t = 2 * s, 2 * s + 1
            good &= u[n] > -1e-10 and p[n] > -1e-10 and abs(p[t]) <= mu[s] * p[n] + 1e-10
            good &= kind != "left" or u[t] <= 1e-10
            good &= kind != "right" or u[t] >= -1e-10
        if good:
            found.append(p)
    return found


def test_against_every_mode_of_plane_friction(rng):
    """Three contacts in a plane: the solution is one of those that enumeration finds."""
    for _ in range(15):
        J = rng.normal(size=(6, 7))
        G, b, mu = J @ J.T, J @ rng.normal(size=7), rng.uniform(0, 0.6, 3)
        exact = modes(G, b, mu)
        whole, flat = np.zeros((9, 9)), np.zeros(9)
        at = np.array([0, 1, 3, 4, 6, 7])
        whole[np.ix_(at, at)], flat[at] = G, b
        p, _ = solve_contacts(whole, flat, mu, np.ones(3))
        assert exact
        assert min(np.max(np.abs(p[at] - each)) for each in exact) < 1e-8


def linked(rng: np.random.Generator, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on a circle that inextensible links join: J, W unsymmetric as with follower loads, b.

    Impulses along a link move nothing, so G is singular; gaps that are left keep b out of its
    range, and the impulses that hold it differ by orders of magnitude.
    """
    turn = 0.4 * (np.arange(m) - (m - 1) / 2)
    out = np.column_stack([np.cos(turn), np.sin(turn)])
    links = np.zeros((m - 1, 2 * m))
    for k in range(m - 1):
        links[k, 2 * k : 2 * k + 4] = np.concatenate([out[k] - out[k + 1], out[k + 1] - out[k]])
    free = np.linalg.svd(links)[2][m - 1 :].T
    frames = np.zeros((3 * m, 2 * m))
    for k in range(m):
        frames[3 * k, 2 * k : 2 * k + 2] = out[k]
        frames[3 * k + 2, 2 * k : 2 * k + 2] = -out[k, 1], out[k, 0]
    J, (A, S) = frames @ free, rng.normal(size=(2, m + 1, m + 1))
    W = A @ A.T + 0.1 * np.eye(m + 1) + 0.05 * (S - S.T)
    b = J @ rng.normal(size=m + 1)
    b[::3] -= rng.random()
    b = J @ np.linalg.lstsq(J, b, rcond=None)[0]
    b[::3] += 1e-3 * rng.random(m) * (rng.random(m) < 0.5)
    return J, W, b


def test_contacts_that_links_hold_apart(rng):
    """Of two points solutions are known by enumeration; the solver finds one wherever there is."""
    solved = 0
    for _ in range(40):
        J, W, b = linked(rng, 2)
        G, mu = J @ np.linalg.solve(W, J.T), np.full(2, rng.uniform(0.1, 1.2))
        p, residual = solve_contacts(G, b, mu, np.ones(2))
        at = np.array([0, 2, 3, 5])
        if modes(G[np.ix_(at, at)], b[at], mu):
            assert residual < SOLVED
            solved += np.any(p > 0)
    assert solved > 20


def L(G: np.ndarray) -> np.ndarray:
    """J with J J^T = G, square."""
    values, vectors = np.linalg.eigh(G)
    return vectors * np.sqrt(np.maximum(values, 0))


@cache
def compiled(m: int) -> ca.Function:
    """The C kernel."""
    sizes = [(3 * m, 3 * m), (3 * m, 3 * m), (3 * m, 1), (m, 1), (m, 1), (1, 1)]
    ports = [ca.MX.sym(f"a{k}", *size) for k, size in enumerate(sizes)]
    solve = solution(m, 3 * m, Factored(ports[0], native=True))
    function = ca.Function("cone", ports, solve(*ports[1:]))
    return compile_functions([function])["cone"]


@needs_compiler
def test_c_and_numpy_agree(rng):
    for trial in range(40):
        G, b = system(rng, 4, int(rng.integers(4, 14)))
        mu, who = rng.uniform(0, 1, 4), np.ones(4)
        who[2] = trial % 2
        p, _ = solve_contacts(G, b, mu, who)
        # With as many coordinates as rows, W the identity.
        found = compiled(4)(np.eye(12), L(G), b, mu, who, 1.0)
        other, reply, residual = (np.array(part).ravel() for part in found)
        assert residual[0] < SOLVED
        assert reply == pytest.approx(L(G).T @ other, abs=1e-9)
        # Where contacts repeat each other impulses are not unique; the velocities are.
        assert G @ other == pytest.approx(G @ p, abs=1e-7 * np.max(np.abs(G)))


@needs_compiler
def test_c_finds_them_too(rng):
    """The C kernel and its twin where plain rounds fail."""
    hard = 0
    for _ in range(40):
        J, W, b = linked(rng, 4)
        mu, wide = np.full(4, rng.uniform(0.1, 1.2)), np.zeros((12, 12))
        W_wide = np.eye(12)
        wide[:, :5], W_wide[:5, :5] = J, W
        p, residual = solve_contacts(J @ np.linalg.solve(W, J.T), b, mu, np.ones(4))
        found = compiled(4)(W_wide, wide, b, mu, np.ones(4), 1.0)
        other, _, defect = (np.array(part).ravel() for part in found)
        assert (defect[0] < SOLVED) == (residual < SOLVED)
        hard += residual < SOLVED and np.max(p) > 0
        assert J.T @ other == pytest.approx(J.T @ p, abs=1e-6 * np.max(p, initial=1.0))
    assert hard > 20


def test_contacts_that_repeat_each_other_and_none(rng):
    G, b = system(rng, 2, 4)
    twice = np.kron(np.ones((2, 2)), G)
    p, residual = solve_contacts(twice, np.tile(b, 2), np.full(4, 0.3), np.ones(4))
    single, _ = solve_contacts(G, b, np.full(2, 0.3), np.ones(2))
    assert residual < SOLVED
    assert p[:6] + p[6:] == pytest.approx(single, abs=1e-8)
    p, residual = solve_contacts(G, np.abs(b), np.full(2, 0.3), np.ones(2))
    assert not np.any(p) and residual == 0
