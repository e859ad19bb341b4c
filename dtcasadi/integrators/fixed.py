"""Fixed-step integration with an explicit tableau."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..bound import Bound
from ..compile import twin
from ..errors import SimulationError
from ..model import Model
from .explicit import explicit_step
from .problem import Problem, Trajectory
from .tableau import Tableau


@dataclass(frozen=True)
class FixedStep:
    """Equal steps of an explicit Runge-Kutta method; each piece of the command gets whole steps."""

    tableau: Tableau

    @property
    def name(self) -> str:
        """The tableau's name."""
        return self.tableau.name

    def prepare(self, model: Model) -> None:
        """Compile the step."""
        model.compiled("ode")
        twin(explicit_step(model.ode, self.tableau))

    def integrate(self, problem: Problem) -> Trajectory:
        """Step from piece to piece; stops at the last finite state.

        Raises:
            SimulationError: no step was given.
        """
        if problem.step_s is None:
            raise SimulationError(f"step_s: method {self.name} needs a step [s], got None")
        step = Bound(twin(explicit_step(problem.model.ode, self.tableau)))
        ode = problem.model.compiled("ode")
        step.inputs.theta[:] = problem.theta
        times, states, slopes, message = [problem.pieces[0].t_start], [problem.x0], [], ""
        c, x = self.tableau.c, problem.x0
        for piece in problem.pieces:
            n = max(1, round((piece.t_end - piece.t_start) / problem.step_s))
            grid = np.linspace(piece.t_start, piece.t_end, n + 1)
            step.inputs.h[:] = h = (piece.t_end - piece.t_start) / n
            for start, t in zip(grid[:-1], grid[1:], strict=True):
                step.inputs.x[:] = x
                for i, share in enumerate(c):
                    step.inputs.U[:, i] = piece(start + share * h)
                slopes.append(ode(x, piece(start), problem.theta))
                step.run()
                x_next = step.outputs.x_next.copy()
                if not np.all(np.isfinite(x_next)):
                    message = f"the state was not finite after t = {start:.6g} s (step {h:.3g} s)"
                    break
                x = x_next
                times.append(t)
                states.append(x)
                problem.advance(t)
            if message:
                break
        end = piece(times[-1])
        slopes = [*slopes[: len(times) - 1], ode(x, end, problem.theta)]
        t, xs, rates = np.array(times), np.array(states), np.array(slopes)
        evaluations = len(c) * (len(t) - 1)
        return Trajectory(t, xs.T, message, evaluations, _hermite(t, xs, rates))


def _hermite(t: np.ndarray, x: np.ndarray, rates: np.ndarray):  # noqa: ANN202
    if len(t) < 2:
        return lambda times: np.repeat(x[:1].T, len(times), axis=1)
    spline = CubicHermiteSpline(t, x, rates, axis=0)
    return lambda times: spline(times).T
