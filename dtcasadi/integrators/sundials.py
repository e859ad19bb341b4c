"""CasADi's cvodes and idas on the compiled state equation, as yardsticks."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..compile import external_with_jacobian
from ..model import Model
from ..profile import Piece
from .package import affine
from .problem import Problem, Trajectory, refuse_events

# Output times per piece; the solvers do not say which steps they took in between.
GRID = 200


@dataclass(frozen=True)
class Sundials:
    """`cvodes` (BDF) or `idas` through `casadi.integrator`, with the model's exact Jacobian."""

    name: str

    def prepare(self, model: Model) -> None:
        """Compile the state equation together with its Jacobian."""
        model.compiled("ode")
        _ode_of(model)

    def integrate(self, problem: Problem) -> Trajectory:
        """Run piece by piece on a grid; a failing piece ends the run before it."""
        refuse_events(self.name, problem)
        ode = problem.model.compiled("ode")
        pieces = affine(self.name, problem)
        t, x, failure = pieces[0].t_start, problem.x0, ""
        evaluations = 0
        times, states = [t], [x]
        rates = [ode(x, pieces[0](t), problem.theta)]
        for piece in pieces:
            grid = np.linspace(piece.t_start, piece.t_end, GRID + 1)
            solver = self._solver(problem, piece, grid)
            try:
                found = np.array(solver(x0=x)["xf"]).T
            except RuntimeError as error:
                reason = str(error).strip().splitlines()[-1]
                failure = f"{self.name}: stopped after t = {times[-1]:.6g} s: {reason[:200]}"
                break
            evaluations += int(solver.stats()["nfevals"])
            if not np.all(np.isfinite(found)):
                failure = f"{self.name}: the state was not finite after t = {times[-1]:.6g} s"
                break
            times.extend(grid[1:])
            states.extend(found)
            rates.extend(
                ode(row, piece(time), problem.theta)
                for row, time in zip(found, grid[1:], strict=True)
            )
            x = found[-1]
            problem.advance(piece.t_end)
        all_x = np.array(states).T
        spline = CubicHermiteSpline(times, states, rates) if len(times) > 1 else None
        return Trajectory(
            np.array(times),
            all_x,
            all_x[:, 1:],
            np.repeat(problem.theta[:, np.newaxis], len(times), axis=1),
            lambda nodes: spline(nodes).T if spline is not None else all_x[:, :0],
            self.name,
            failure,
            evaluations=evaluations,
        )

    def _solver(self, problem: Problem, piece: Piece, grid: np.ndarray) -> ca.Function:
        ode = _ode_of(problem.model)
        x, t = ca.MX.sym("x", problem.model.n_x), ca.MX.sym("t")
        u = ca.DM(piece.start) + (t - piece.t_start) * ca.DM(piece.slope)
        dae = {"x": x, "t": t, "ode": ode(x, u, ca.DM(problem.theta))}
        options = {
            "reltol": problem.rtol,
            "abstol": problem.atol,
            "max_num_steps": 1_000_000,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        return ca.integrator("solver", self.name, dae, grid[0], list(grid[1:]), options)


def _ode_of(model: Model) -> ca.Function:
    """The compiled state equation with its derivative, or the symbolic one without a compiler."""

    def build() -> ca.Function:
        if "ode_jacobian" in model.interpreted:
            return model.ode
        pair = (model.native("ode"), model.native("ode_jacobian"))
        return external_with_jacobian(*pair) or model.ode

    return model.once("external_ode", build)
