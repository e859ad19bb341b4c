"""SciPy's solvers on the compiled state equation with its exact Jacobian."""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.integrate import BDF, DOP853, LSODA, RK23, RK45, OdeSolution, OdeSolver, Radau

from ..model import Model
from ..recentring import chart_limit
from .problem import Problem, Trajectory, refuse_events

_SOLVERS = {solver.__name__: solver for solver in (LSODA, Radau, BDF, DOP853, RK45, RK23)}
_WITH_JACOBIAN = frozenset({"LSODA", "Radau", "BDF"})


class _NotFiniteError(Exception):
    """A solver met numbers it cannot go on with."""


@dataclass(frozen=True)
class Scipy:
    """One of SciPy's `OdeSolver`s, started again at each piece of the command."""

    name: str

    def prepare(self, model: Model) -> None:
        """Compile the state equation, and its Jacobian where the method uses one."""
        model.compiled("ode")
        if self.name in _WITH_JACOBIAN:
            model.compiled("ode_jacobian")

    def integrate(self, problem: Problem) -> Trajectory:
        """Run piece by piece; a failing piece ends the run at its last good state."""
        refuse_events(self.name, problem)
        ode = problem.model.compiled("ode")
        ode.inputs.theta[:] = problem.theta
        jacobian = ode
        if self.name in _WITH_JACOBIAN:
            jacobian = problem.model.compiled("ode_jacobian")
            jacobian.inputs.theta[:] = problem.theta
        times = [problem.pieces[0].t_start]
        states = [problem.x0]
        interpolants: list = []
        message, evaluations = "", 0
        for piece in problem.pieces:

            def rate(t: float, x: np.ndarray, piece=piece) -> np.ndarray:
                if np.isnan(t):  # Runge-Kutta solvers would repeat such a step for ever
                    raise _NotFiniteError("the state equation gave no finite rate")
                ode.inputs.x[:], ode.inputs.u[:] = x, piece(t)
                ode.run()
                return ode.outputs.xdot.copy()

            def slope(t: float, x: np.ndarray, piece=piece) -> np.ndarray:
                jacobian.inputs.x[:], jacobian.inputs.u[:] = x, piece(t)
                jacobian.run()
                if not np.all(np.isfinite(jacobian.outputs.F_x)):
                    raise _NotFiniteError("the Jacobian was not finite")
                return jacobian.outputs.F_x

            solver = None
            try:
                solver = _SOLVERS[self.name](
                    rate,
                    piece.t_start,
                    states[-1],
                    piece.t_end,
                    rtol=problem.rtol,
                    atol=problem.atol,
                    **({"jac": slope} if jacobian is not ode else {}),
                )
                while solver.status == "running" and not message:
                    message = _stepped(solver, times, states, interpolants)
                    problem.advance(times[-1])
            except (_NotFiniteError, np.linalg.LinAlgError) as error:
                message = str(error)
            evaluations += solver.nfev if solver else 0
            if message:
                message = self._failure(problem, message, times[-1], states[-1])
                break
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

    def _failure(self, problem: Problem, why: str, t: float, x: np.ndarray) -> str:
        """What failed, when, and where the chart has its part in it."""
        singular = chart_limit(problem.model, x)
        hint = f"; {singular}; try chart='cardan' with damping='physical'" if singular else ""
        return f"{self.name}: {why} after t = {t:.6g} s{hint}"


def _stepped(solver: OdeSolver, times: list, states: list, interpolants: list) -> str:
    """Take one step and keep it when it is good; returns why it failed, or nothing."""
    with warnings.catch_warnings():
        # LSODA reports its failures as warnings too; they are in the message.
        warnings.simplefilter("ignore", UserWarning)
        why = solver.step()
    if solver.status == "failed":
        return why or "the solver stopped"
    if not np.all(np.isfinite(solver.y)):
        return "the state was not finite"
    times.append(float(solver.t))
    states.append(solver.y.copy())
    interpolants.append(solver.dense_output())
    # As in the package's own loop; SciPy compares with the spacing of numbers at t, none at zero.
    if solver.status == "running" and solver.step_size < 1e-14 * solver.t_bound:
        return "the step became too small for the tolerances"
    return ""
