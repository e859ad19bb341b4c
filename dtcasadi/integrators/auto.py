"""Choose between an explicit and a linearly implicit method by measured stiffness."""

from dataclasses import dataclass, replace

import numpy as np

from ..bound import Bound
from ..commands import FunctionPiece
from ..model import Model
from .package import Advance, Package, affine
from .problem import Problem, Trajectory
from .recorder import Recorder
from .rosenbrock import RODAS4
from .scipy_methods import Scipy
from .steppers import ONE_STEP

EXPLICIT, IMPLICIT = Package(ONE_STEP["tsit5"]), Package(RODAS4)
# Real stability interval of tsit5, |R(z)| <= 1 for z in (-3.0, 0).
EXPLICIT_REACH = 3.0
# Steps of a look at what accuracy allows, and the longest stretch without looking.
LOOK, LONGEST = 12, 1600
# Beyond this many coordinates a Jacobian takes minutes to compile and as long as hundreds of
# explicit steps to evaluate and factor: `tsit5` throughout.
LARGE = 100


def cost_ratio(n_q: int) -> float:
    """Cost of a step of rodas4 in steps of tsit5: 1.4 with 6 coordinates, 3 with 15."""
    return 1 + n_q / 8


@dataclass(frozen=True)
class Auto:
    """`tsit5` where its steps are limited by accuracy, `rodas4` where stability would limit them.

    rodas4 takes a few steps; their size, which accuracy sets, is compared with the largest step
    tsit5 could take beside the fastest decay rate (power iteration on F_x). The comparison is
    repeated, at growing intervals. A command that is a function of time goes to SciPy's LSODA.
    """

    name: str = "auto"

    def prepare(self, model: Model) -> None:
        """Compile both methods."""
        EXPLICIT.prepare(model)
        if model.n_q <= LARGE:
            IMPLICIT.prepare(model)
            model.compiled("ode_jacobian")

    def integrate(self, problem: Problem) -> Trajectory:
        """Run, looking at the stiffness from time to time."""
        if any(isinstance(piece, FunctionPiece) for piece in problem.pieces):
            found = Scipy("LSODA").integrate(problem)
            return replace(found, note="LSODA: the pressure is a function of time")
        if problem.model.n_q > LARGE:
            found = EXPLICIT.integrate(problem)
            note = f"tsit5 throughout: more than {LARGE} coordinates"
            return replace(found, method="auto: tsit5", note=note)
        recorder = Recorder(problem)
        jacobian = problem.model.compiled("ode_jacobian")
        run = Advance(problem, recorder)
        uses: list[tuple[float, str, str]] = []
        method, why, failure = IMPLICIT, "a first look at the step that accuracy allows", ""
        # Stretches grow while a method stays the choice; a short look follows a change.
        most = stretch = LOOK
        for piece in affine(self.name, problem):
            while run.t < piece.t_end and not failure:
                if not uses or uses[-1][1] != method.name:
                    uses.append((run.t, method.name, why))
                failure = run.over(method, piece, piece.t_end, most)
                if failure and method is EXPLICIT:
                    failure, method, why, most = "", IMPLICIT, "tsit5 failed", LOOK
                    run.h = None  # the collapsed step is no start for another method
                    continue
                before = method
                method, why = self._choice(jacobian, run, method, piece(run.t))
                if method is EXPLICIT:
                    most = stretch = min(2 * stretch, LONGEST)
                else:
                    most = LOOK if before is EXPLICIT else min(2 * most, LONGEST)
            if failure:
                break
        note = "; ".join(f"{name} from t = {t:.3g} s ({why})" for t, name, why in uses)
        used = "+".join(dict.fromkeys(name for _, name, _ in uses))
        return recorder.finish(f"auto: {used}", failure, note)

    @staticmethod
    def _choice(
        jacobian: Bound, run: Advance, method: Package, u: np.ndarray
    ) -> tuple[Package, str]:
        """The method for the next steps, and why."""
        step, n_q = run.h or 0.0, run.problem.model.n_q
        fastest = _fastest_rate(jacobian, run, u)
        allowed = EXPLICIT_REACH / max(fastest, 1e-300)
        if method is IMPLICIT:
            stiff = step > cost_ratio(n_q) * allowed
            text = f"accuracy allows steps of {step:.2g} s, explicit stability {allowed:.2g} s"
            return (IMPLICIT if stiff else EXPLICIT), text
        # An explicit step close to its stability limit hides what accuracy would allow: look again.
        if step > 0.5 * allowed:
            return IMPLICIT, f"explicit steps of {step:.2g} s are at the stability limit"
        return EXPLICIT, ""


def _fastest_rate(jacobian: Bound, run: Advance, u: np.ndarray) -> float:
    """Spectral radius of F_x by power iteration [1/s]."""
    jacobian.inputs.x[:], jacobian.inputs.u[:] = run.x, u
    jacobian.inputs.theta[:] = run.theta
    jacobian.run()
    F_x, size = jacobian.outputs.F_x, 0.0
    vector = np.ones(len(run.x))
    for _ in range(8):
        vector = np.einsum("ij,j->i", F_x, vector)  # too small for BLAS and its threads
        size = float(np.max(np.abs(vector)))
        if not np.isfinite(size) or size == 0:
            return 0.0
        vector = vector / size
    return size
