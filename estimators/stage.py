"""One step of a moving window as CasADi Functions: the filter's update and step about a point."""

from __future__ import annotations

import casadi as ca
import numpy as np

from dtcasadi.linear import solve_spd
from dtcasadi.measuring import Sensor

from .covariance import finite_ones, predicted, updated
from .steps import NO_LIMIT, OPTIONS, Pair, Setting


def stage(s: Setting, sensor: Sensor) -> Pair:
    r"""Functions stage: the Kalman filter of the model linearized about z.

    .. math:: z' \approx f(z, u) + F d + w,\quad y \approx h(z, u) + H d + v

    Inputs: z (n_z,), the point; m (n_z,) and P, mean and covariance of d before the readings; the
    command of the step and that of the readings; theta; y, entries that are not finite count for
    nothing; R, the readings' noise. Outputs: d (n_z,) and P_d after the readings, F (n_z, n_z), H
    with rows of zeros for what was not read, SH = S^-1 H and Se = S^-1 e with the innovation e and
    its covariance S = H P H^T + R, follow = f(z) + F d and P_next of the next step, status of the
    step, 0: good.
    """
    return Pair(*(_stage(s, sensor, native=native) for native in (False, True)))


def _stage(s: Setting, sensor: Sensor, *, native: bool) -> ca.Function:
    n, n_y, free = s.n_z, sensor.n_y, list(s.free)
    _, P, u, theta = s.ports()
    z, m, u_read = ca.MX.sym("z", n), ca.MX.sym("m", n), ca.MX.sym("u_read", *u.shape)
    y, R = ca.MX.sym("y", n_y), ca.MX.sym("R", n_y, n_y)
    at = ca.MX(theta)
    if free:
        at[free] = z[s.n_x :]
    x = z[: s.n_x]
    read = sensor.native if native else sensor.linearize
    # Inlined, so that derivatives nobody asks for are not computed.
    h, H_x, H_theta = read.call([x, u_read, at], True, False)
    finite = finite_ones(y)
    H = ca.densify(ca.horzcat(H_x, H_theta[:, free]))
    e = y - h - ca.mtimes(H, m)
    found = updated(m, P, e, H, R, np.full(n_y + 1, NO_LIMIT), native=native)
    H = ca.mtimes(ca.diag(finite), H)
    masked = R * ca.mtimes(finite, finite.T) + ca.diag(1 - finite)
    S = ca.mtimes(ca.mtimes(H, P), H.T) + masked
    solution = solve_spd(S, ca.horzcat(H, ca.if_else(finite, e, 0)), native=native)
    name = "linearize_checked"
    linearize = s.discrete.native(name) if native else s.discrete.linearize_checked
    x_next, F_x, _, F_theta, status = linearize.call([x, u, at], True, False)
    moves = ca.densify(ca.horzcat(F_x, F_theta[:, free]))
    F = ca.vertcat(moves, ca.horzcat(ca.MX(n - s.n_x, s.n_x), ca.MX.eye(n - s.n_x)))
    G = ca.mtimes(F_theta[:, list(s.pushed)], ca.diag(ca.DM(s.noise)))
    outputs = {
        "d": found.z,
        "P_d": found.P,
        "F": F,
        "H": H,
        "SH": solution[:, :n],
        "Se": solution[:, n],
        "follow": ca.vertcat(x_next, z[s.n_x :]) + ca.mtimes(F, found.z),
        "P_next": predicted(moves, G, found.P, ca.MX(ca.DM(s.Q)), native=native),
        "status": status,
    }
    ports = {"z": z, "m": m, "P": P, "u": u, "u_read": u_read, "theta": theta, "y": y, "R": R}
    values = [ca.densify(value) for value in outputs.values()]
    return ca.Function("stage", [*ports.values()], values, [*ports], [*outputs], OPTIONS)
