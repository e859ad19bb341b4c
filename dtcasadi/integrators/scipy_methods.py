"""SciPy's solvers on the compiled state equation with its exact Jacobian."""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from ..model import Model
from .problem import Problem, Trajectory

_WITH_JACOBIAN = frozenset({"LSODA", "Radau", "BDF"})


@dataclass(frozen=True)
class Scipy:
    """One of `scipy.integrate.solve_ivp`'s methods, restarted at each piece of the command."""

    name: str

    def prepare(self, model: Model) -> None:
        """Compile the state equation, and its Jacobian where the method uses one."""
        model.compiled("ode")
        if self.name in _WITH_JACOBIAN:
            model.compiled("ode_jacobian")

    def integrate(self, problem: Problem) -> Trajectory:
        """Run piece by piece; a failing piece ends the run at its last good state."""
        ode = problem.model.compiled("ode")
        ode.inputs.theta[:] = problem.theta
        jacobian = ode
        if self.name in _WITH_JACOBIAN:
            jacobian = problem.model.compiled("ode_jacobian")
            jacobian.inputs.theta[:] = problem.theta
        times: list[float] = []
        states: list[np.ndarray] = []
        interpolants: list = []
        message = ""
        evaluations, x = 0, problem.x0
        for piece in problem.pieces:

            def rate(t: float, x: np.ndarray, piece=piece) -> np.ndarray:
                ode.inputs.x[:], ode.inputs.u[:] = x, piece(t)
                ode.run()
                return ode.outputs.xdot.copy()

            def slope(t: float, x: np.ndarray, piece=piece) -> np.ndarray:
                jacobian.inputs.x[:], jacobian.inputs.u[:] = x, piece(t)
                jacobian.run()
                return jacobian.outputs.F_x

            with warnings.catch_warnings():
                # LSODA reports its failures as warnings too; they are in the message.
                warnings.simplefilter("ignore", UserWarning)
                solution = solve_ivp(
                    rate,
                    (piece.t_start, piece.t_end),
                    x,
                    method=self.name,
                    rtol=problem.rtol,
                    atol=problem.atol,
                    dense_output=True,
                    **({"jac": slope} if jacobian is not ode else {}),
                )
            good = int(np.sum(np.cumprod(np.isfinite(solution.y).all(axis=0))))
            first = 1 if times else 0
            times.extend(solution.t[first:good])
            states.extend(solution.y.T[first:good])
            interpolants.extend(solution.sol.interpolants[: max(good - 1, 0)])
            evaluations += solution.nfev
            problem.advance(float(times[-1]))
            if not solution.success or good < len(solution.t):
                why = solution.message if not solution.success else "the state was not finite"
                message = f"{why} after t = {times[-1]:.6g} s"
                break
            x = states[-1]
        t, x_all = np.array(times), np.array(states).T
        return Trajectory(
            t,
            x_all,
            x_all[:, 1:],
            np.repeat(problem.theta[:, np.newaxis], len(t), axis=1),
            OdeSolution(t, interpolants) if interpolants else lambda nodes: x_all[:, :0],
            self.name,
            message,
            evaluations=evaluations,
        )
