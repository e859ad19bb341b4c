"""Solvers of a transcribed problem: built once, called often, every solution checked."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from dtcasadi.errors import ControlError

from .nlp import Instance, Nlp, Structure
from .problem import refusal
from .solution import Residuals, Solution, Status, certificate, lagrangian, multipliers

# What the residuals of the scaled program may be.
TOLERANCE = 1e-6
_MOST = 200


def _quiet(**options: Any) -> dict[str, Any]:
    return {"print_time": False, "show_eval_warnings": False, **options}


def _ipopt(_: Structure | None, most: int) -> dict[str, Any]:
    own = {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": most, "mu_target": 0.0}
    # Relaxed bounds would be violated by up to their relaxation.
    return _quiet(ipopt={**own, "bound_relax_factor": 0.0, "honor_original_bounds": "yes"})


def _sizes(structure: Structure | None) -> dict[str, Any]:
    if structure is None:
        raise refusal("scheme", "multiple shooting or collocation for this solver", "single")
    sizes = {key: list(getattr(structure, key)) for key in ("nx", "nu", "ng")}
    return {"N": len(structure.nu) - 1, **sizes}


def _fatrop(structure: Structure | None, most: int) -> dict[str, Any]:
    # Below, the last barriers with the Hessian of Gauss-Newton lead away from the optimum.
    own = {"print_level": 0, "tol": 1e-8, "max_iter": most}
    return _quiet(structure_detection="manual", **_sizes(structure), fatrop=own)


def _hpipm(structure: Structure | None) -> dict[str, Any]:
    # Without the sizes of the stages the plugin ends the process on some programs.
    own = {
        "iter_max": 100,
        **dict.fromkeys(("res_g_max", "res_b_max", "res_d_max", "res_m_max"), 1e-10),
    }
    return {**_sizes(structure), "hpipm": own}


QP_SOLVERS: dict[str, Callable[[Structure | None], dict[str, Any]]] = {
    "hpipm": _hpipm,
    # Its proximal steps are for the singular Hessians of programs with states.
    "daqp": lambda structure: {} if structure is None else {"daqp": {"eps_prox": 1e-6}},
    "qrqp": lambda _: {"print_iter": False, "print_header": False, "max_iter": 1000},
    "osqp": lambda _: {
        "osqp": {"verbose": False, "eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 4000}
    },
    "piqp": lambda _: {"piqp": {"eps_abs": 1e-10, "eps_rel": 1e-10, "verbose": False}},
}


def _sqp(qp: str) -> Callable[[Structure | None, int], dict[str, Any]]:
    def options(structure: Structure | None, most: int) -> dict[str, Any]:
        own = {"error_on_fail": False, "print_time": False, **QP_SOLVERS[qp](structure)}
        silent = {f"print_{name}": False for name in ("header", "iteration", "status")}
        found = {"qpsol": qp, "qpsol_options": own, "max_iter": most, "min_step_size": 1e-12}
        return _quiet(**silent, **found, tol_pr=1e-9, tol_du=1e-8, error_on_fail=False)

    return options


@dataclass(frozen=True)
class _Kind:
    """A CasADi plugin, the QP plugin it needs, and its options."""

    plugin: str
    qp: str | None
    options: Callable[[Structure | None, int], dict[str, Any]]

    @property
    def present(self) -> bool:
        return ca.has_nlpsol(self.plugin) and (self.qp is None or ca.has_conic(self.qp))


SOLVERS: Mapping[str, _Kind] = {
    "ipopt": _Kind("ipopt", None, _ipopt),
    "fatrop": _Kind("fatrop", None, _fatrop),
    **{f"sqpmethod-{qp}": _Kind("sqpmethod", qp, _sqp(qp)) for qp in QP_SOLVERS},
}


def available() -> tuple[str, ...]:
    """Names of the solvers that this CasADi has."""
    return tuple(name for name, kind in SOLVERS.items() if kind.present)


class Solver:
    """A solver of one program.

    Attributes:
        name: which.
        nlp: the program.
        build_s: time to build it [s].
    """

    def __init__(
        self,
        nlp: Nlp,
        name: str = "ipopt",
        *,
        most: int = _MOST,
        tolerance: float = TOLERANCE,
        options: Mapping[str, Any] | None = None,
    ):
        """Build it.

        Args:
            nlp: the program.
            name: one of `available()`.
            most: most iterations.
            tolerance: largest residual of a solution that counts as one.
            options: of the CasADi plugin, over ours.

        Raises:
            ControlError: an unknown solver, one that this CasADi lacks, or options it refuses.
        """
        if name not in SOLVERS or not SOLVERS[name].present:
            raise refusal("solver", f"one of {', '.join(available())}", repr(name))
        start = time.perf_counter()
        kind = SOLVERS[name]
        self.name, self.nlp, self._tolerance, self._most = name, nlp, tolerance, most
        chosen = {**kind.options(nlp.structure, most), **(options or {})}
        try:
            self._solver = ca.nlpsol("solver", kind.plugin, nlp.parts, chosen)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            raise ControlError(f"{name}: cannot be built: {reason}") from None
        self._lagrangian = lagrangian(nlp)
        self._jacobian: ca.Function | None = None
        self.build_s = time.perf_counter() - start

    def __call__(
        self, instance: Instance, guess: Solution | tuple[np.ndarray, np.ndarray]
    ) -> Solution:
        """Solve.

        Args:
            instance: what holds now.
            guess: a plan (x, u), shapes (N + 1, n_x) and (N, n_u), or a solution to start from with
                its multipliers.
        """
        nlp, p = self.nlp, instance.parameters
        lower, upper = (np.array(part).ravel() for part in nlp.bounds(instance.u_now))
        limits = lower, upper
        call = {"p": p, "lbx": limits[0], "ubx": limits[1], "lbg": nlp.lbg, "ubg": nlp.ubg}
        if isinstance(guess, Solution):
            call |= {"x0": guess.w, "lam_x0": guess.lam_x, "lam_g0": guess.lam_g}
        else:
            x, u = guess
            slack = self._slack(x, instance.theta)
            call["x0"] = nlp.joined(np.transpose(x), np.transpose(u), slack)
        start = time.perf_counter()
        try:
            found, said = self._solver(**call), self._solver.stats()
        except RuntimeError as error:
            reason = (str(error).strip().splitlines() or ["no reason"])[-1]
            found = {
                "x": call["x0"],
                "lam_x": np.zeros(len(limits[0])),
                "lam_g": np.zeros(len(nlp.lbg)),
            }
            said = {"success": False, "return_status": reason}
        took = time.perf_counter() - start
        return self._checked(instance, found, said, limits, took)

    def _checked(
        self,
        instance: Instance,
        found: Mapping[str, Any],
        said: Mapping[str, Any],
        limits: tuple[np.ndarray, np.ndarray],
        took: float,
    ) -> Solution:
        w, lam_x, lam_g = (np.array(found[key]).ravel() for key in ("x", "lam_x", "lam_g"))
        p = instance.parameters
        cost, residuals = self._proof(w, p, lam_x, lam_g, limits)
        if self._tolerance < residuals.largest and residuals.feasibility <= self._tolerance:
            lam_x, lam_g = self._refitted(w, p, limits)
            cost, residuals = self._proof(w, p, lam_x, lam_g, limits)
        x, u, slack = (np.array(part).T for part in self.nlp.split(w, p))
        message = str(said.get("return_status", ""))
        iterations = int(said.get("iter_count", -1))
        return Solution(
            x=x,
            u=u,
            slack=slack,
            cost=cost * self.nlp.scale,
            status=self._status(residuals.largest, said, message, iterations),
            residuals=residuals,
            iterations=iterations,
            build_s=self.build_s,
            solve_s=took,
            solver=self.name,
            message=message,
            w=w,
            lam_x=lam_x,
            lam_g=lam_g,
        )

    def _proof(
        self,
        w: np.ndarray,
        p: np.ndarray,
        lam_x: np.ndarray,
        lam_g: np.ndarray,
        limits: tuple[np.ndarray, np.ndarray],
    ) -> tuple[float, Residuals]:
        f, g, df, dl = (np.array(part).ravel() for part in self._lagrangian(w, p, lam_g))
        return float(f[0]), certificate(self.nlp, (f, g, df, dl), w, lam_x, lam_g, limits)

    def _refitted(
        self, w: np.ndarray, p: np.ndarray, limits: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        if self._jacobian is None:
            parts = self.nlp.parts
            slopes = ca.jacobian(parts["g"], parts["x"])
            self._jacobian = ca.Function("jacobian", [parts["x"], parts["p"]], [slopes])
        _, g, df, _ = (
            np.array(part).ravel() for part in self._lagrangian(w, p, np.zeros(len(self.nlp.lbg)))
        )
        J = np.array(ca.densify(self._jacobian(w, p))).reshape(len(g), len(w))
        return multipliers(self.nlp, J, df, (w, g), limits, self._tolerance)

    def _status(
        self, residual: float, said: Mapping[str, Any], message: str, iterations: int
    ) -> Status:
        if residual <= self._tolerance:
            return Status.SOLVED
        if said.get("success", False):
            return Status.INACCURATE
        if "infeasible" in message.lower():
            return Status.INFEASIBLE
        limit = "iter" in message.lower() and "max" in message.lower()
        return Status.LIMIT if limit or iterations >= self._most else Status.FAILED

    def _slack(self, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Slacks that a plan needs, shape (n_g, N)."""
        stages = self.nlp.stages
        columns = [np.array(stages.inequality(row, theta)).ravel() for row in x[1:]]
        return np.maximum(np.array(columns).reshape(stages.horizon, len(stages.limits)), 0.0).T
