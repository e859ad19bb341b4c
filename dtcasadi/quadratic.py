r"""Quadratic programs with bounds, two-sided rows and priced rows inside graphs.

.. math::
    \min_{z, s}\ \tfrac12 z^T H z + g^T z + \ell^T s + \tfrac12 s^T \Lambda s,\quad
    lo \le z \le up,\quad b_{lo} - s \le C z \le b_{up} + s,\quad s \ge 0

A row with an infinite price l is hard (s = 0). The price of a row is exact: s = 0 wherever the hard
row's multiplier is below l (Fletcher, Practical Methods of Optimization, section 14.3).
"""

from typing import NamedTuple

import casadi as ca

from .linear import native_function

# Bounds and prices from here on are none.
NONE = 1e30
# Iterations of the interior-point twin; each gains about a digit.
_TWIN = 60
# Mean product of slack and multiplier at which the twin stops moving.
_CONVERGED = 1e-15
# Slacks no smaller than this, or the step's equations lose all digits.
_NEAR = 1e-12
# Mean product at which its solution counts as one.
_SOLVED = 1e-10


class Rows(NamedTuple):
    """General rows: C^T (n, m), b_lo and b_up (m,), l and Lambda (m,)."""

    C: ca.MX
    lower: ca.MX
    upper: ca.MX
    linear: ca.MX
    quadratic: ca.MX


class Solved(NamedTuple):
    """Solution z (n,); multipliers of bounds and rows (n + m,), positive at upper ones.

    `active` (n + m,) tells what holds: 0: no bound, 1: z at its bound, 2: beyond it at its price,
    negative: at the lower one; it warm-starts the next. `status` 0: solved, 1: out of iterations,
    2: the hard bounds contradict each other, 3: H is not positive definite or something not finite.
    `worst` is the largest violation left, of rows scaled to a sum of magnitudes of 1.
    """

    z: ca.MX
    multipliers: ca.MX
    active: ca.MX
    status: ca.MX
    iterations: ca.MX
    worst: ca.MX


def solved(
    H: ca.MX,
    g: ca.MX,
    lower: ca.MX,
    upper: ca.MX,
    rows: Rows,
    warm: ca.MX,
    *,
    iterations: int,
    native: bool,
) -> Solved:
    """Solve a quadratic program with positive definite H.

    C: a dual active-set method whose multipliers are bounded by their prices, exact to round-off,
    at most `iterations` changes of the active set. Virtual machine: a primal-dual interior-point
    method (Nocedal, Wright, Numerical Optimization, 2nd ed., section 16.6) with a fixed number of
    iterations.

    Args:
        H: shape (n, n).
        g: shape (n,).
        lower: of z, shape (n,); below -1e30: none.
        upper: of z, shape (n,).
        rows: general rows.
        warm: the active set to start with, shape (n + m,).
        iterations: most changes of the active set.
        native: whether the C kernel may be embedded (generated code only).
    """
    n, m = rows.C.shape
    if not native:
        return _interior(H, g, lower, upper, rows, _TWIN)
    if m == 0:  # CasADi passes no pointer for a port without entries; a row of zeros is left out
        zero, none = ca.MX.zeros(1), ca.MX(NONE)
        rows = Rows(ca.MX.zeros(n, 1), -none, none, none, zero)
        warm = ca.vertcat(warm, 0)
    k = n + rows.C.shape[1]
    ports = {"HH": (n, n), "GG": (n, 1), "LO": (n, 1), "UP": (n, 1), "CT": rows.C.shape}
    ports |= dict.fromkeys(("BL", "BU", "PL", "PQ"), (k - n, 1)) | {"WARM": (k, 1)}
    results = {"Z": (n, 1), "LAMBDA": (k, 1), "CODE": (k, 1), "BACK": (3, 1)}
    # No more than n rows are independent; those beyond their price come on top.
    numbers = {"V": n, "M": k - n, "K": min(k, 2 * n + 16), "ITS": iterations}
    kernel = native_function(
        "quadratic_program", tuple(ports), tuple(results), ports | results, **numbers
    )
    given = (H, g, lower, upper, *rows, warm)
    z, multipliers, active, back = kernel(*(ca.densify(part) for part in given))
    return Solved(z, multipliers[: n + m], active[: n + m], *ca.vertsplit(back))


def _interior(
    H: ca.MX, g: ca.MX, lower: ca.MX, upper: ca.MX, rows: Rows, iterations: int
) -> Solved:
    """The twin: each bound and each side of a row one inequality a z - s <= b."""
    n, m = rows.C.shape
    eye = ca.MX.eye(n)
    sides = ca.horzcat(eye, rows.C)
    A = ca.densify(ca.vertcat(sides.T, -sides.T))
    b = ca.vertcat(upper, rows.upper, -lower, -rows.lower)
    linear, quadratic = (
        ca.vertcat(*[ca.vertcat(ca.MX.zeros(n) + none, price)] * 2)
        for none, price in ((NONE, rows.linear), (1.0, rows.quadratic))
    )
    scale = ca.fmax(ca.sum2(ca.fabs(A)), 1e-300)
    on = (b < NONE) * (scale > 1e-290)
    soft = linear < NONE
    symbols = [ca.MX.sym(name, *part.shape) for name, part in (("H", H), ("g", g), ("A", A))]
    names = ("b", "on", "soft", "linear", "quadratic")
    k = A.shape[0]
    vectors = [ca.MX.sym(name, k) for name in names]
    point = ca.MX.sym("point", n + 4 * k)
    step = ca.Function("step", [point, *symbols, *vectors], [_iteration(point, *symbols, *vectors)])
    b = ca.if_else(on, b, 0)
    prices = (ca.if_else(soft, linear, 0), ca.if_else(soft, quadratic, 1))
    start = ca.vertcat(ca.MX.zeros(n), ca.fmax(b, 1), ca.MX.ones(3 * k))
    given = (H, g, A, b, on, soft, *prices)
    found = start
    for _ in range(iterations):
        found = step(found, *given)
    z = ca.fmin(ca.fmax(found[:n], lower), upper)
    t, multipliers, s, _ = ca.vertsplit(found[n:], [0, k, 2 * k, 3 * k, 4 * k])
    multipliers = multipliers * on
    violated = ca.mmax(ca.vertcat(on * (ca.mtimes(A, z) - s * soft - b) / scale, 0))
    half = k // 2
    side = multipliers[:half] - multipliers[half:]
    held = on * (multipliers > t)
    beyond = held * soft * (s > 1e-9)
    active = held[:half] + beyond[:half] - held[half:] - beyond[half:]
    finite = ca.sumsqr(found) <= NONE**2
    gap = ca.dot(multipliers, t) / ca.fmax(ca.sum1(on), 1)
    unsolved = ca.if_else(violated < 1e-7, gap > _SOLVED, 2)
    status = ca.if_else(finite, unsolved, 3)
    z = ca.if_else(finite, z, 0)
    return Solved(z, side, active, status, ca.MX(iterations), violated)


def _iteration(
    point: ca.MX,
    H: ca.MX,
    g: ca.MX,
    A: ca.MX,
    b: ca.MX,
    on: ca.MX,
    soft: ca.MX,
    linear: ca.MX,
    quadratic: ca.MX,
) -> ca.MX:
    """One predictor-corrector step of (z, t, l, s, r): A z - s + t = b, l t = r s = 0.

    l is the multiplier of a row and r = linear + quadratic s - l that of s >= 0.
    """
    n, k = H.shape[0], A.shape[0]
    z, t, lam, s, r = ca.vertsplit(point, [0, n, n + k, n + 2 * k, n + 3 * k, n + 4 * k])
    priced = on * soft
    r_z = ca.mtimes(H, z) + g + ca.mtimes(A.T, on * lam)
    r_t = ca.mtimes(A, z) - soft * s + t - b
    r_s = linear + quadratic * s - lam - r
    ratio = lam / t
    give = soft / (quadratic + ratio + r / s)
    stiff = on * ratio * (1 - ratio * give)
    matrix = ca.densify(H + ca.mtimes(A.T, stiff * A))

    def moved(e_t: ca.MX, e_s: ca.MX) -> tuple[ca.MX, ...]:
        """The step for given residuals of l t and r s."""
        pull = (e_t + lam * r_t) / t
        push = -r_s + pull + e_s / s
        rhs = -r_z - ca.mtimes(A.T, on * (pull - ratio * give * push))
        dz = ca.solve(matrix, ca.densify(rhs), "ldl")
        by_z = ca.mtimes(A, dz)
        ds = give * (push + ratio * by_z)
        dt = -r_t - by_z + soft * ds
        return dz, dt, pull + ratio * (by_z - soft * ds), ds, e_s / s - r / s * ds

    def longest(steps: tuple[ca.MX, ...]) -> ca.MX:
        """The largest share of a step that keeps t, l, s, r positive."""
        _, dt, dl, ds, dr = steps
        shares = []
        for value, change, counts in ((t, dt, on), (lam, dl, on), (s, ds, priced), (r, dr, priced)):
            # Rows that do not count must not shorten the step.
            shares.append(ca.if_else(counts * (change < 0), -value / change, 1e3))
        return ca.fmin(1, 0.99 * ca.mmin(ca.vertcat(*shares)))

    pairs = ca.sum1(on) + ca.sum1(priced)
    gap = (ca.dot(on * lam, t) + ca.dot(priced * r, s)) / ca.fmax(pairs, 1)
    first = moved(-lam * t, -r * s)
    alpha = longest(first)
    _, dt, dl, ds, dr = first
    ahead = ca.dot(on * (lam + alpha * dl), t + alpha * dt)
    ahead = ahead + ca.dot(priced * (r + alpha * dr), s + alpha * ds)
    centre = gap * ca.fmax(ca.fmin(1, ahead / ca.fmax(pairs * gap, 1e-300)) ** 3, 0.01)
    floor = ca.fmax(centre, 1e-16)
    going = gap > _CONVERGED
    second = moved(floor - lam * t - dl * dt, floor - r * s - dr * ds)
    alpha = going * longest(second)
    dz, dt, dl, ds, dr = second
    changed = ((t, dt, on, _NEAR), (lam, dl, on, 0), (s, ds, priced, _NEAR), (r, dr, priced, 0))
    keep = [
        ca.if_else(counts, ca.fmax(value + alpha * change, least + 1e-18), 1)
        for value, change, counts, least in changed
    ]
    return ca.vertcat(z + alpha * dz, *keep)
