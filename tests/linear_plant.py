"""A linear plant with a closed-form motion, in the forms that one-step methods are built from.

M q'' = -theta K q - D q' + B pressure, pressure = u, or the state z of a lag z' = (u - z) / lag.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import block_diag, expm

from dtcasadi.integrators import OneStep
from dtcasadi.integrators.step import Plant
from dtcasadi.integrators.steppers import step_function
from dtcasadi.jacobians import ImplicitForm

N_U = 2


@dataclass(frozen=True, eq=False)
class Linear:
    """The matrices; `lag` None for a plant without actuator states.

    M, D, K have shape (n, n), B (n, 2), lag (2,) [s].
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    B: np.ndarray
    lag: np.ndarray | None

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return self.M.shape[0]

    @property
    def n_z(self) -> int:
        """Number of actuator states."""
        return 0 if self.lag is None else N_U

    @property
    def n_x(self) -> int:
        """Number of states."""
        return 2 * self.n_q + self.n_z

    def system(self) -> tuple[np.ndarray, np.ndarray]:
        """F and G of xdot = F x + G u at theta = 1, shapes (n_x, n_x) and (n_x, 2)."""
        n = self.n_q
        K, D, B = (np.linalg.solve(self.M, part) for part in (self.K, self.D, self.B))
        F = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -D]])
        if self.lag is None:
            return F, np.vstack([np.zeros((n, N_U)), B])
        rate = np.diag(1 / self.lag)
        F = block_diag(F, -rate)
        F[n : 2 * n, 2 * n :] = B
        return F, np.vstack([np.zeros((2 * n, N_U)), rate])

    def exact(self, x: np.ndarray, u: np.ndarray, du: np.ndarray, t: float) -> np.ndarray:
        """State at time t under the command u + du t: exp of [x; u; du]."""
        F, G = self.system()
        n = self.n_x
        whole = np.zeros((n + 2 * N_U, n + 2 * N_U))
        whole[:n, :n], whole[:n, n : n + N_U] = F, G
        whole[n : n + N_U, n + N_U :] = np.eye(N_U)
        return (expm(whole * t) @ np.concatenate([x, u, du]))[:n]

    def plant(self, kind: Any = ca.MX) -> Plant:
        """The forms as Functions of the kind of symbols, SX or MX."""
        n, n_z, weight = self.n_q, self.n_z, ca.DM(self.M)
        names = ("q", "v", "z", "a", "zdot", "u", "theta")
        sizes = (n, n, n_z, n, n_z, N_U, 1)
        ports = [kind.sym(name, size) for name, size in zip(names, sizes, strict=True)]
        q, v, z, a, zdot, u, theta = ports
        pressure = z if n_z else u
        force = -theta * ca.mtimes(ca.DM(self.K), q) - ca.mtimes(ca.DM(self.D), v)
        force = force + ca.mtimes(ca.DM(self.B), pressure)
        rate = (u - z) / ca.DM(self.lag) if n_z else kind(0, 1)
        residual = ca.vertcat(ca.mtimes(weight, a) - force, zdot - rate)
        by = {
            "M": ca.vertcat(a, zdot),
            "D": ca.vertcat(v, z),
            "K": ca.vertcat(q, kind(n_z, 1)),
            "U": u,
            "T": theta,
        }
        local = [kind.sym(f"{name}_", size) for name, size in zip(names, sizes, strict=True)]
        form = ca.Function("form", ports, [residual])
        at = dict(zip(names, local, strict=True))
        pairs = {"M": ("a", "zdot"), "D": ("v", "z"), "K": ("q",), "U": ("u",), "T": ("theta",)}
        blocks = []
        for name in by:
            columns = [ca.jacobian(form(*local), at[port]) for port in pairs[name]]
            block = ca.horzcat(*columns)
            if name == "K":
                block = ca.horzcat(block, kind(n + n_z, n_z))
            blocks.append(ca.densify(block))
        jacobian = ca.Function("form_jacobian", local, blocks)
        x = kind.sym("x", self.n_x)
        qs, vs, zs = ca.vertsplit(x, [0, n, 2 * n, 2 * n + n_z])
        still = [kind(n, 1), kind(n_z, 1)]
        missing = -form(qs, vs, zs, *still, u, theta)
        qdd = ca.solve(weight, missing[:n]) if n else kind(0, 1)
        ode = ca.Function("ode", [x, u, theta], [ca.vertcat(vs, qdd, missing[n:])])
        momenta = ca.mtimes(weight, v)
        rates = ca.solve(weight, a) if n else a
        return Plant(
            ode=ode,
            form=ImplicitForm(n, n_z, form, jacobian),
            momenta=ca.Function("momenta", [q, v, theta], [momenta]),
            force=ca.Function("force", [q, v, u, theta], [force]) if not n_z else form,
            rates=ca.Function("rates", [q, a, theta], [rates]),
            projection=None,
            rims=None,
            native=False,
            kind=kind,
        )


def damped(rng: np.random.Generator, n: int = 3, *, lag: bool = True) -> Linear:
    """Frequencies and decay rates of order 1, matrices full and not symmetric where allowed."""
    parts = rng.normal(size=(5, n, n))
    M = np.eye(n) + 0.2 * parts[0] @ parts[0].T
    K = np.eye(n) + 0.3 * parts[1] @ parts[1].T + 0.2 * parts[2]
    D = 0.3 * np.eye(n) + 0.1 * parts[3] @ parts[3].T + 0.1 * parts[4]
    B = rng.normal(size=(n, N_U))
    return Linear(M, D, K, B, rng.uniform(0.5, 1.5, N_U) if lag else None)


def stepper(method: OneStep, plant: Plant) -> ca.Function:
    """The step x, u, du, h, theta -> x_next, error, slack in CasADi's virtual machine."""
    return step_function(method, plant)


def after(
    step: ca.Function, x: np.ndarray, u: np.ndarray, du: np.ndarray, t_end: float, n: int
) -> np.ndarray:
    """State after n equal steps under the command u + du t."""
    h = t_end / n
    for k in range(n):
        x = step(x, u + k * h * du, du, h, 1.0)[0].full()[:, 0]
    return x
