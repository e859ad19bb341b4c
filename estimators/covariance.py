"""Covariances inside graphs: prediction and measurement update of a Kalman filter.

Each is a C kernel for generated code, and a graph of CasADi's own operations, by another formula,
that runs and is tested in the virtual machine.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from dtcasadi.linear import native_function


def predicted(F: ca.MX, G: ca.MX, P: ca.MX, Q: ca.MX, *, native: bool) -> ca.MX:
    """P_next = [F; 0 I] P [F; 0 I]^T + [G; 0] [G; 0]^T + Q, shape (n, n).

    Args:
        F: derivative of the states that move, shape (n_x, n).
        G: columns of noise on them, shape (n_x, w).
        P: covariance, shape (n, n); its last n - n_x entries stay.
        Q: further noise, shape (n, n).
        native: whether the C kernel may be embedded (generated code only).
    """
    n_x, n = F.shape
    if G.shape[1] == 0:
        G = ca.MX(n_x, 1)
    if native:
        sizes = {"F": (n_x, n), "G": G.shape, "P": (n, n), "Q": (n, n), "PN": (n, n)}
        numbers = {"X": n_x, "N": n, "W": G.shape[1]}
        kernel = native_function(
            "covariance_predict", ("F", "G", "P", "Q"), ("PN",), sizes, **numbers
        )
        return kernel(*(ca.densify(part) for part in (F, G, P, Q)))
    whole = ca.vertcat(F, ca.horzcat(ca.MX(n - n_x, n_x), ca.MX.eye(n - n_x)))
    noise = ca.vertcat(G, ca.MX(n - n_x, G.shape[1]))
    P_next = ca.mtimes(ca.mtimes(whole, P), whole.T) + ca.mtimes(noise, noise.T) + Q
    return (P_next + P_next.T) / 2


# No reading is larger, and what is not a number is not smaller.
_HUGE = 1e300


def finite_ones(readings: ca.MX) -> ca.MX:
    """1 for each reading that is a finite number, 0 for others; CasADi takes e == e for granted."""
    return ca.fabs(readings) <= _HUGE


class Updated(NamedTuple):
    """What a measurement leaves: estimate, covariance, and how it fitted.

    nis is e^T S^-1 e over the finite readings, used their number, believed 0 where nis was beyond
    the limit and nothing changed.
    """

    z: ca.MX
    P: ca.MX
    nis: ca.MX
    used: ca.MX
    believed: ca.MX


def updated(
    z: ca.MX, P: ca.MX, e: ca.MX, H: ca.MX, R: ca.MX, limits: np.ndarray, *, native: bool
) -> Updated:
    r"""Kalman's update of z (n,) and P (n, n) by the innovation e = y - h(z), H (m, n).

    .. math:: S = H P H^T + R,\quad K = P H^T S^{-1},\quad z' = z + K e

    C: square-root form, reading by reading (Bierman, Factorization Methods for Discrete Sequential
    Estimation, chapter V). Virtual machine: Joseph's form, P' = (I - K H) P (I - K H)^T + K R K^T.

    Args:
        z: estimate.
        P: its covariance.
        e: innovation; entries that are not finite are left out.
        H: derivative of the readings.
        R: their covariance, shape (m, m).
        limits: largest e^T S^-1 e believed of 0, 1, ... m finite readings, shape (m + 1,).
        native: whether the C kernel may be embedded (generated code only).
    """
    m, n = H.shape
    if native:
        ports = {"Z": (n, 1), "P": (n, n), "E": (m, 1), "H": (m, n), "R": (m, m)}
        ports["LIMITS"] = (m + 1, 1)
        results = {"ZN": (n, 1), "PN": (n, n), "BACK": (3, 1)}
        kernel = native_function(
            "covariance_update", tuple(ports), tuple(results), ports | results, N=n, M=m
        )
        given = (z, P, e, H, R, ca.DM(limits))
        z_next, P_next, back = kernel(*(ca.densify(part) for part in given))
        return Updated(z_next, P_next, *ca.vertsplit(back))
    return _joseph(z, P, e, H, R, limits)


def _joseph(z: ca.MX, P: ca.MX, e: ca.MX, H: ca.MX, R: ca.MX, limits: np.ndarray) -> Updated:
    """The update with a reading that is not finite replaced by one that tells nothing."""
    m, n = H.shape
    finite = finite_ones(e)
    e = ca.if_else(finite, e, 0)
    H = ca.mtimes(ca.diag(finite), ca.densify(H))
    R = R * ca.mtimes(finite, finite.T) + ca.diag(1 - finite)
    S = ca.mtimes(ca.mtimes(H, P), H.T) + R
    solution = ca.solve(ca.densify(S), ca.densify(ca.horzcat(ca.mtimes(H, P), e)), "ldl")
    K, nis = solution[:, :n].T, ca.dot(e, solution[:, n])
    used = ca.sum1(finite)
    limit = ca.dot(ca.DM(limits), ca.DM(np.arange(m + 1)) == used)
    believed = nis <= limit
    left = ca.MX.eye(n) - ca.mtimes(K, H)
    P_next = ca.mtimes(ca.mtimes(left, P), left.T) + ca.mtimes(ca.mtimes(K, R), K.T)
    P_next = ca.if_else(believed, (P_next + P_next.T) / 2, P)
    return Updated(z + believed * ca.mtimes(K, e), P_next, nis, used, believed)
