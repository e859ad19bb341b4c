"""Prediction and update of the extended Kalman filter as CasADi Functions."""

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from dtcasadi.measuring import Sensor
from dtcasadi.waist import Discrete

from .covariance import predicted, updated

OPTIONS = {"cse": True}


class Pair(NamedTuple):
    """A Function for the virtual machine, and the same with C kernels for generated code."""

    plain: ca.Function
    native: ca.Function


@dataclass(frozen=True, eq=False)
class Setting:
    """What is estimated, and the noise.

    Attributes:
        discrete: the model.
        free: entries of theta that are estimated.
        Q: constant part of the process noise in a step, shape (n_z, n_z).
        noise: deviation, held over a step, of each entry of `pushed`, shape (w,).
        pushed: entries of theta that process noise acts through.
    """

    discrete: Discrete
    free: tuple[int, ...]
    Q: np.ndarray
    noise: np.ndarray
    pushed: tuple[int, ...]

    @property
    def n_x(self) -> int:
        """Number of states."""
        return len(self.discrete.state_names)

    @property
    def n_z(self) -> int:
        """Number of estimated numbers."""
        return self.n_x + len(self.free)

    def ports(self) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """Symbols x, P, u, theta."""
        n_u = self.discrete.linearize.size1_in("u")
        sym = ca.MX.sym
        n_theta = len(self.discrete.theta0)
        return (
            sym("x", self.n_x),
            sym("P", self.n_z, self.n_z),
            sym("u", n_u),
            sym("theta", n_theta),
        )


def prediction(s: Setting) -> Pair:
    """Functions predict: x, P, u, theta -> x_next, P_next, status of the step, 0: good."""
    return Pair(*(_prediction(s, native=native) for native in (False, True)))


def _prediction(s: Setting, *, native: bool) -> ca.Function:
    x, P, u, theta = s.ports()
    name = "linearize_checked"
    linearize = s.discrete.native(name) if native else s.discrete.linearize_checked
    # Inlined, so that derivatives nobody asks for are not computed.
    x_next, F_x, _, F_theta, status = linearize.call([x, u, theta], True, False)
    F = ca.horzcat(F_x, F_theta[:, list(s.free)])
    G = ca.mtimes(F_theta[:, list(s.pushed)], ca.diag(ca.DM(s.noise)))
    P_next = predicted(F, G, P, ca.MX(ca.DM(s.Q)), native=native)
    ports = {"x_next": x_next, "P_next": ca.densify(P_next), "status": status}
    names = ["x", "P", "u", "theta"]
    return ca.Function("predict", [x, P, u, theta], [*ports.values()], names, [*ports], OPTIONS)


def correction(s: Setting, sensor: Sensor, limits: np.ndarray, iterations: int, name: str) -> Pair:
    """Functions update: x, P, u, theta, y -> x_next, P_next, theta_next, nis, used, believed.

    Args:
        s: what is estimated.
        sensor: what is measured.
        limits: largest nis believed by number of finite readings, shape (n_y + 1,).
        iterations: how often the readings are linearized: 1, or more for the iterated filter
            (Bell and Cathey 1993: Gauss-Newton on the posterior).
        name: of the Functions.
    """
    return Pair(
        *(
            _correction(s, sensor, limits, iterations, name, native=native)
            for native in (False, True)
        )
    )


def _correction(
    s: Setting, sensor: Sensor, limits: np.ndarray, iterations: int, name: str, *, native: bool
) -> ca.Function:
    x, P, u, theta = s.ports()
    y = ca.MX.sym("y", sensor.n_y)
    free = list(s.free)
    z = ca.vertcat(x, theta[free])
    at, parameters, first = z, theta, None
    for _ in range(iterations):
        function = sensor.native if native else sensor.linearize
        h, H_x, H_theta = function.call([at[: s.n_x], u, parameters], True, False)
        H = ca.horzcat(H_x, H_theta[:, free])
        e = y - h - ca.mtimes(H, z - at)
        found = updated(z, P, e, H, sensor.R_v, limits, native=native)
        # Belief is settled by the readings as predicted.
        first = found if first is None else first
        at = found.z
        parameters = ca.MX(theta)
        if free:
            parameters[free] = at[s.n_x :]
    assert first is not None
    P_next = found.P
    if iterations > 1:
        kept = first.believed * found.believed
        at, P_next = ca.if_else(kept, at, z), ca.if_else(kept, P_next, P)
        if free:
            parameters[free] = at[s.n_x :]
    outputs = {"x_next": at[: s.n_x], "P_next": P_next, "theta_next": parameters}
    outputs |= {"nis": first.nis, "used": first.used, "believed": first.believed}
    ports = {"x": x, "P": P, "u": u, "theta": theta, "y": y}
    values = [ca.densify(value) for value in outputs.values()]
    return ca.Function(name, [*ports.values()], values, [*ports], [*outputs], OPTIONS)
