"""A linear discrete model, x' = F x + G u + B theta, as filters and controllers see one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from scipy.linalg import logm

from dtcasadi.measuring import Sensor


@dataclass(frozen=True, eq=False)
class LinearDiscrete:
    """The matrices; `measured` is name -> (H_x, H_theta, R_v)."""

    F: np.ndarray
    G: np.ndarray
    B: np.ndarray
    measured: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]]
    theta0: np.ndarray
    theta_blocks: Mapping[str, slice]
    step_s: float = 0.1
    sensors: dict[str, Sensor] = field(init=False)

    def __post_init__(self) -> None:
        sensors = {name: self._sensor(name, *parts) for name, parts in self.measured.items()}
        object.__setattr__(self, "sensors", sensors)

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(f"x{i}" for i in range(len(self.F)))

    @property
    def linearize(self) -> ca.Function:
        x, u, theta = self._symbols()
        x_next = self.F @ x + self.G @ u + self.B @ theta
        parts = [x_next, *(ca.MX(ca.DM(part)) for part in (self.F, self.G, self.B))]
        names = ["x_next", "F_x", "F_u", "F_theta"]
        return ca.Function("linearize", [x, u, theta], parts, ["x", "u", "theta"], names)

    @property
    def linearize_checked(self) -> ca.Function:
        x, u, theta = self._symbols()
        parts = self.linearize(x, u, theta)
        status = 1 - (ca.sumsqr(parts[0]) <= 1e300)
        names = [*self.linearize.name_out(), "status"]
        ports = ["x", "u", "theta"]
        return ca.Function("linearize_checked", [x, u, theta], [*parts, status], ports, names)

    @property
    def step(self) -> ca.Function:
        x, u, theta = self._symbols()
        parts = [self.linearize_checked(x, u, theta)[k] for k in (0, -1)]
        return ca.Function("step", [x, u, theta], parts, ["x", "u", "theta"], ["x_next", "status"])

    @property
    def ode(self) -> ca.Function:
        """The continuous system whose step this is, by the logarithm of the whole matrix."""
        n, sizes = len(self.F), [self.G.shape[1], len(self.theta0)]
        whole = np.eye(n + sum(sizes))
        whole[:n] = np.hstack([self.F, self.G, self.B])
        slope = ca.DM(np.real(logm(whole))[:n] / self.step_s)
        x, u, theta = self._symbols()
        parts = [ca.mtimes(slope, ca.vertcat(x, u, theta))]
        return ca.Function("ode", [x, u, theta], parts, ["x", "u", "theta"], ["xdot"])

    def native(self, name: str) -> ca.Function:
        return getattr(self, name)

    def together(self, names: Sequence[str]) -> Sensor:
        parts = [self.measured[name] for name in names]
        if len(parts) == 1:
            return self.sensors[names[0]]
        H_x, H_theta = (np.vstack([part[k] for part in parts]) for k in (0, 1))
        return self._sensor("+".join(names), H_x, H_theta, _diagonal([p[2] for p in parts]))

    def recentre(
        self, x: np.ndarray, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return x, theta, np.eye(len(x))

    def _symbols(self) -> tuple[ca.MX, ca.MX, ca.MX]:
        sizes = {"x": len(self.F), "u": self.G.shape[1], "theta": len(self.theta0)}
        x, u, theta = (ca.MX.sym(name, size) for name, size in sizes.items())
        return x, u, theta

    def _sensor(self, name: str, H_x: np.ndarray, H_theta: np.ndarray, R_v: np.ndarray) -> Sensor:
        x, u, theta = self._symbols()
        ports = ["x", "u", "theta"]
        y = ca.DM(H_x) @ x + ca.DM(H_theta) @ theta
        output = ca.Function("output", [x, u, theta], [y], ports, ["y"])
        parts = [y, ca.MX(ca.DM(H_x)), ca.MX(ca.DM(H_theta))]
        blocks = ca.Function("sensor", [x, u, theta], parts, ports, ["y", "H_x", "H_theta"])
        channels = tuple((f"y{k}", "") for k in range(len(H_x)))
        return Sensor(name, output, blocks, blocks, R_v, channels)


def _diagonal(blocks: Sequence[np.ndarray]) -> np.ndarray:
    return np.array(ca.diagcat(*(ca.DM(block) for block in blocks)))
