"""Choose between an explicit and a linearly implicit method by measured stiffness."""

from dataclasses import dataclass

import numpy as np

from ..commands import FunctionPiece
from ..model import Model
from .package import Advance, Package, affine
from .problem import Problem, Trajectory
from .recorder import Recorder
from .rosenbrock import RODAS4
from .scipy_methods import Scipy
from .steppers import ONE_STEP

EXPLICIT, IMPLICIT = Package(ONE_STEP["tsit5"]), Package(RODAS4)
# One step of rodas4 costs about as much as four of tsit5 (benchmarks/results/integrators.md).
COST_RATIO = 4.0
# Real stability interval of tsit5, |R(z)| <= 1 for z in (-3.0, 0).
EXPLICIT_REACH = 3.0
FIRST_LOOK, NEXT_LOOK = 12, 400


@dataclass(frozen=True)
class Auto:
    """`tsit5` where its steps are limited by accuracy, `rodas4` where stability would limit them.

    rodas4 takes a few steps; their size, which accuracy sets, is compared with the largest step
    tsit5 could take beside the fastest decay rate (power iteration on F_x). The comparison is
    repeated every few hundred steps.
    """

    name: str = "auto"

    def prepare(self, model: Model) -> None:
        """Compile both methods."""
        for method in (EXPLICIT, IMPLICIT):
            method.prepare(model)
        model.compiled("ode_jacobian")

    def integrate(self, problem: Problem) -> Trajectory:
        """Run, looking at the stiffness from time to time."""
        if any(isinstance(piece, FunctionPiece) for piece in problem.pieces):
            return Scipy("LSODA").integrate(problem)
        recorder = Recorder(problem)
        run = Advance(problem, recorder)
        uses: list[tuple[float, str, str]] = []
        method, most, failure = IMPLICIT, FIRST_LOOK, ""
        why = "a first look at the step that accuracy allows"
        for piece in affine(self.name, problem):
            while run.t < piece.t_end and not failure:
                if not uses or uses[-1][1] != method.name:
                    uses.append((run.t, method.name, why))
                start, before = run.t, recorder.accepted
                failure = run.over(method, piece, piece.t_end, most)
                if failure and method is EXPLICIT:
                    failure, method, most = "", IMPLICIT, NEXT_LOOK
                    why = "tsit5 failed"
                    continue
                mean = (run.t - start) / max(1, recorder.accepted - before)
                method, why = self._choice(problem, run, method, piece(run.t), mean)
                most = NEXT_LOOK
            if failure:
                break
        note = "; ".join(f"{name} from t = {t:.3g} s ({why})" for t, name, why in uses[-4:])
        used = "+".join(dict.fromkeys(name for _, name, _ in uses))
        return recorder.finish(f"auto: {used}", failure, note)

    @staticmethod
    def _choice(
        problem: Problem, run: Advance, method: Package, u: np.ndarray, mean: float
    ) -> tuple[Package, str]:
        """The method for the next steps, and why."""
        fastest = _fastest_rate(problem, run, u)
        allowed = EXPLICIT_REACH / max(fastest, 1e-300)
        if method is IMPLICIT:
            stiff = mean > COST_RATIO * allowed
            text = f"accuracy allows steps of {mean:.2g} s, explicit stability {allowed:.2g} s"
            return (IMPLICIT if stiff else EXPLICIT), text
        # An explicit step close to its stability limit hides what accuracy would allow: look again.
        if mean > 0.5 * allowed:
            return IMPLICIT, f"explicit steps of {mean:.2g} s are at the stability limit"
        return EXPLICIT, ""


def _fastest_rate(problem: Problem, run: Advance, u: np.ndarray) -> float:
    """Spectral radius of F_x by power iteration [1/s]."""
    jacobian = problem.model.compiled("ode_jacobian")
    jacobian.inputs.x[:], jacobian.inputs.u[:] = run.x, u
    jacobian.inputs.theta[:] = run.theta
    jacobian.run()
    F_x = jacobian.outputs.F_x
    vector = np.ones(len(run.x))
    for _ in range(8):
        vector = F_x @ vector
        size = float(np.max(np.abs(vector)))
        if not np.isfinite(size) or size == 0:
            return 0.0
        vector = vector / size
    return float(np.linalg.norm(F_x @ vector) / np.linalg.norm(vector))
