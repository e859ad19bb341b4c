"""What sigma points say of a step and of readings, as CasADi Functions.

Each is C kernels for generated code, and a graph of CasADi's own operations, by other formulas,
for the virtual machine. Images lie in columns: (2 m + 1, n), of the centre, of the m points ahead,
of the m behind; see `estimators.sigma`.
"""

from __future__ import annotations

import casadi as ca

from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.linear import native_function

from .steps import OPTIONS

_BETA = 2.0  # of a Gaussian distribution


def step_cloud(n: int, m: int) -> Bound:
    """Y (2 m + 1, n), distance, Q (n, n) -> mean (n,), P (n, n).

    Args:
        n: numbers that the points have.
        m: columns of their root.
    """
    return _bound([_step_cloud(n, m, native=native) for native in (False, True)])


def reading_cloud(n: int, m: int, k: int) -> Bound:
    r"""Y (2 m + 1, k), distance, L (n, m), y (k,), R (k, k) -> change (n,), P (n, n), nis, fit.

    Kalman's update by k readings, Joseph's form in the coordinates of the root L:

    .. math:: S = D D^T + N N^T,\quad K = L D^T S^{-1},\quad P' = (L - K D)(\cdot)^T + K N (K N)^T

    with D what the root's columns become and N N^T the noise and what is not linear; fit (k,)
    is what would be read after the change if D told all of it.

    Args:
        n: estimated numbers.
        m: columns of their root.
        k: readings.
    """
    return _bound([_reading_cloud(n, m, k, native=native) for native in (False, True)])


def _bound(pair: list[ca.Function]) -> Bound:
    plain, native = pair
    return Bound(twin(plain, source=native), matrices={"Y", "P"})


def _step_cloud(n: int, m: int, *, native: bool) -> ca.Function:
    Y, h, Q = ca.MX.sym("Y", 2 * m + 1, n), ca.MX.sym("h"), ca.MX.sym("Q", n, n)
    mean, rows = _gathered(Y, h, native=native)
    P = _gram(rows, Q, native=native)
    return _function("step_cloud", {"Y": Y, "h": h, "Q": Q}, {"mean": mean, "P": P})


def _reading_cloud(n: int, m: int, k: int, *, native: bool) -> ca.Function:
    sizes = {"Y": (2 * m + 1, k), "h": (1, 1), "L": (n, m), "y": (k, 1), "R": (k, k)}
    Y, h, L, y, R = symbols = [ca.MX.sym(name, *size) for name, size in sizes.items()]
    mean, rows = _gathered(Y, h, native=native)
    if native:
        ports = {"L": (n, m), "ROWS": rows.shape, "E": (k, 1), "R": (k, k)}
        results = {"Z": (n, 1), "ROOT": (n, m + k), "FIT": (k, 1), "BACK": (1, 1)}
        numbers = {"N": n, "M": m, "K": k}
        kernel = native_function(
            "cloud_update", tuple(ports), tuple(results), ports | results, **numbers
        )
        change, root, fit, nis = kernel(L, rows, y - mean, R)
        P = _gram(root, ca.MX.zeros(n, n), native=True)
    else:
        D, rest = rows[:, :m], rows[:, m:]
        noise = R + ca.mtimes(rest, rest.T)
        S = noise + ca.mtimes(D, D.T)
        solution = ca.solve(ca.densify(S), ca.horzcat(D, y - mean), "ldl")
        K = ca.mtimes(L, solution[:, :m].T)
        change, nis = ca.mtimes(K, y - mean), ca.dot(y - mean, solution[:, m])
        fit = ca.mtimes(D, ca.mtimes(D.T, solution[:, m]))
        P = _gram(L - ca.mtimes(K, D), ca.mtimes(ca.mtimes(K, noise), K.T), native=False)
    ports = dict(zip(sizes, symbols, strict=True))
    outputs = {"change": change, "P": P, "nis": nis, "fit": mean + fit}
    return _function("reading_cloud", ports, outputs)


def _gathered(Y: ca.MX, h: ca.MX, *, native: bool) -> tuple[ca.MX, ca.MX]:
    """Mean (n,), and rows (n, 2 m + 1) whose squares sum to the covariance."""
    m, n = Y.shape[0] // 2, Y.shape[1]
    if native:
        sizes = {"Y": Y.shape, "H": (1, 1), "MEAN": (n, 1), "ROWS": (n, 2 * m + 1)}
        kernel = native_function("cloud", ("Y", "H"), ("MEAN", "ROWS"), sizes, N=n, M=m)
        mean, rows = kernel(Y, h)
        return mean, rows
    centre, ahead, behind = Y[:1, :].T, Y[1 : m + 1, :].T, Y[m + 1 :, :].T
    bend = (ahead + behind - 2 * ca.repmat(centre, 1, m)) / (2 * h)
    delta = ca.sum2(bend) / h
    left = ca.sqrt(_BETA - ca.fmin(h**2 / m, 1))
    return centre + delta, ca.horzcat((ahead - behind) / (2 * h), bend, left * delta)


def _gram(root: ca.MX, Q: ca.MX, *, native: bool) -> ca.MX:
    """Q + root root^T."""
    n, m = root.shape
    if not native:
        P = ca.mtimes(root, root.T) + Q
        return (P + P.T) / 2
    sizes = {"A": (n, m), "Q": (n, n), "P": (n, n)}
    return native_function("gram", ("A", "Q"), ("P",), sizes, N=n, M=m)(
        ca.densify(root), ca.densify(Q)
    )


def _function(name: str, ports: dict[str, ca.MX], outputs: dict[str, ca.MX]) -> ca.Function:
    values = [ca.densify(value) for value in outputs.values()]
    return ca.Function(name, [*ports.values()], values, [*ports], [*outputs], OPTIONS)
