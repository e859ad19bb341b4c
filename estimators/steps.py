"""Prediction and update of the extended Kalman filter as CasADi Functions."""

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.stats import chi2

from dtcasadi.measuring import Sensor
from dtcasadi.waist import Discrete

from .covariance import predicted, updated

OPTIONS = {"cse": True}
# Without a gate every update is believed; a number, so that C can compare with it.
NO_LIMIT = 1e300
# As much noise as a number can stand, for readings that tell nothing.
MOST_NOISE = 1e30
# Share of a reading's variance that linearizing may leave out without a second look.
SMALL = 0.1


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


class Update(NamedTuple):
    """How an update is done.

    Attributes:
        limits: largest nis believed by number of finite readings, shape (n_y + 1,).
        iterations: how often the readings are linearized: 1, or more for the iterated filter
            (Bell and Cathey 1993: Gauss-Newton on the posterior).
        caution: how often the noise is raised by what the linearization leaves out.
    """

    limits: np.ndarray
    iterations: int = 1
    caution: int = 0


def limits_of(gate: float | None, n_y: int) -> np.ndarray:
    """Largest nis believed by number of finite readings, shape (n_y + 1,).

    Args:
        gate: chance that a good measurement is refused; None: every one is believed.
        n_y: number of readings.
    """
    limits = np.full(n_y + 1, NO_LIMIT)
    if gate is not None:
        limits[1:] = chi2.isf(gate, np.arange(1, n_y + 1))
    return limits


def raised_by(left_out: np.ndarray, variance: np.ndarray, before: np.ndarray) -> np.ndarray | None:
    """Noise to add to readings for what linearizing leaves out of them; None: nothing to speak of.

    Args:
        left_out: h(z + dz) - h(z) - H dz, zero where nothing was read.
        variance: of the readings.
        before: noise that was added already.
    """
    more = left_out**2
    if np.all(more <= SMALL * variance):
        return None
    # What is not finite tells nothing.
    return np.maximum(before, np.where(more <= MOST_NOISE, more, MOST_NOISE))


def correction(s: Setting, sensor: Sensor, how: Update, name: str) -> Pair:
    """Functions update: x, P, u, theta, y -> x_next, P_next, theta_next, nis, used, believed.

    Args:
        s: what is estimated.
        sensor: what is measured.
        how: iterations and the like.
        name: of the Functions.
    """
    return Pair(*(_correction(s, sensor, how, name, native=native) for native in (False, True)))


def _correction(s: Setting, sensor: Sensor, how: Update, name: str, *, native: bool) -> ca.Function:
    x, P, u, theta = s.ports()
    y = ca.MX.sym("y", sensor.n_y)
    free = list(s.free)
    z = ca.vertcat(x, theta[free])
    R = ca.MX(ca.DM(sensor.R_v))

    def parameters(at: ca.MX) -> ca.MX:
        found = ca.MX(theta)
        if free:
            found[free] = at[s.n_x :]
        return found

    def linearized(at: ca.MX) -> tuple[ca.MX, ca.MX]:
        function = sensor.native if native else sensor.linearize
        h, H_x, H_theta = function.call([at[: s.n_x], u, parameters(at)], True, False)
        return h, ca.horzcat(H_x, H_theta[:, free])

    h, H = linearized(z)
    first = found = updated(z, P, y - h, H, R, how.limits, native=native)
    # Belief is settled by the readings as predicted, with the noise they have.
    believed, unlimited = first.believed, np.full_like(how.limits, NO_LIMIT)
    raised = ca.MX(sensor.n_y, 1)
    for _ in range(how.caution):
        output = sensor.output.call([found.z[: s.n_x], u, parameters(found.z)], True, False)[0]
        left_out = (output - h - ca.mtimes(H, found.z - z)) ** 2
        # What is not finite tells nothing: as much noise as a number can stand.
        left_out = ca.if_else(left_out <= MOST_NOISE, left_out, MOST_NOISE)
        raised = ca.fmax(raised, left_out)
        found = updated(z, P, y - h, H, R + ca.diag(raised), unlimited, native=native)
    for _ in range(how.iterations - 1):
        at = found.z
        h, H = linearized(at)
        e = y - h - ca.mtimes(H, z - at)
        found = updated(z, P, e, H, R + ca.diag(raised), how.limits, native=native)
        believed = believed * found.believed
    at, P_next = found.z, found.P
    if found is not first:
        at, P_next = ca.if_else(believed, at, z), ca.if_else(believed, P_next, P)
    outputs = {"x_next": at[: s.n_x], "P_next": P_next, "theta_next": parameters(at)}
    outputs |= {"nis": first.nis, "used": first.used, "believed": believed}
    ports = {"x": x, "P": P, "u": u, "theta": theta, "y": y}
    values = [ca.densify(value) for value in outputs.values()]
    return ca.Function(name, [*ports.values()], values, [*ports], [*outputs], OPTIONS)
