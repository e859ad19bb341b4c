"""Choose between an explicit and a linearly implicit method by measured stiffness."""

from dataclasses import dataclass, replace

import numpy as np

from ..bound import Bound
from ..commands import FunctionPiece
from ..model import Model
from .package import Advance, Package, affine, kept
from .problem import Problem, Trajectory
from .recorder import Recorder
from .rosenbrock import RODAS4
from .scipy_methods import Scipy
from .steppers import ONE_STEP

EXPLICIT, IMPLICIT = Package(ONE_STEP["tsit5"]), Package(RODAS4)
# Real stability interval of tsit5, |R(z)| <= 1 for z in (-3.0, 0).
EXPLICIT_REACH = 3.0
# Fewest steps of rodas4 before its step is compared (its first size is a guess, and grows by 5 at
# most) and most before the first look, steps of later looks, of tsit5 before it is looked at, and
# the longest stretch without looking.
LOOK, LATEST_LOOK, LOOK_AGAIN, LONGEST = 16, 64, 4, 1600
# A change of method has to promise so much: switching to and fro costs a dozen steps each time.
MARGIN = 1.25
# Share of the stability limit from which on it may be what sets explicit steps: a fast mode that
# hardly decays does so long before the limit on the real axis.
HIDDEN = 0.2
# What is left of a run gains nothing from a choice if it is as short as so many steps of rodas4.
FEW = 80
# Beyond this many coordinates a Jacobian takes minutes to compile and as long as hundreds of
# explicit steps to evaluate and factor: `tsit5` throughout.
LARGE = 100


def cost_ratio(model: Model) -> float:
    """Cost of a step of rodas4 in steps of tsit5.

    A fit to chains of 2 and of 5 coordinates a segment: 1.2 to 1.7 with 4 to 32 coordinates in the
    plane, 2.9 and 7 with 15 and 75 in space.
    """
    each = model.n_q / max(len(model.charts), 1)
    return float(1 + 0.037 * each**1.7 * model.n_q**0.5)


def first_look(n_q: int) -> int:
    """Steps of rodas4 before the first look: as long as a look or two take (some 60 us each)."""
    return max(LOOK, min(300 // max(n_q, 1), LATEST_LOOK))


def step_ratio(rtol: float) -> float:
    """Steps of tsit5 in steps of rodas4 where accuracy sets both: 1.8 at 1e-3, 3.7 at 1e-9.

    The steps go with rtol^(1/5) and rtol^(1/4), by the orders of the error estimates; the factor is
    that of swinging robots, whose steps agree with this to a factor of 1.6 from 1e-3 to 1e-10.
    """
    return 1.3 * rtol ** (1 / 5 - 1 / 4)


@dataclass(frozen=True)
class Auto:
    """`tsit5` where its steps are limited by accuracy, `rodas4` where stability would limit them.

    From the size of rodas4's steps follows that of tsit5's, unless stability sets them: the largest
    step it could take beside the fastest decay rate (power iteration on F_x). What goes on is what
    takes less time for a stretch of the motion. The comparison is repeated at growing intervals;
    while tsit5's steps are far from that limit, without a step of rodas4. A command that is a
    function of time goes to SciPy's LSODA.
    """

    name: str = "auto"

    def prepare(self, model: Model) -> None:
        """Compile both methods."""
        EXPLICIT.prepare(model)
        if model.n_q <= LARGE:
            IMPLICIT.prepare(model)
            kept(model, "ode_jacobian")

    def integrate(self, problem: Problem) -> Trajectory:
        """Run, looking at the stiffness from time to time."""
        if any(isinstance(piece, FunctionPiece) for piece in problem.pieces):
            found = Scipy("LSODA").integrate(problem)
            return replace(found, note="LSODA: the pressure is a function of time")
        if problem.model.n_q > LARGE:
            found = EXPLICIT.integrate(problem)
            note = f"tsit5 throughout: more than {LARGE} coordinates"
            return replace(found, method="auto: tsit5", note=note)
        return _Choosing(problem).run(self.name)


class _Choosing:
    """A run under way with two methods."""

    def __init__(self, problem: Problem):
        self._problem, self._recorder = problem, Recorder(problem)
        self._advance = Advance(problem, self._recorder)
        self._jacobian = kept(problem.model, "ode_jacobian")
        self._uses: list[tuple[float, str, str]] = []
        self._sizes: dict[str, float | None] = {}  # each method's own step goes on where it was
        self._stretch = 2 * first_look(problem.model.n_q)
        self._taken = np.inf  # the explicit method's steps, where stability may have set them

    def run(self, name: str) -> Trajectory:
        """Piece by piece, stretch by stretch; stretches grow while a method stays the choice."""
        (method, most, why), failure = self._first(), ""
        run, recorder, left = self._advance, self._recorder, most
        self._uses.append((run.t, method.name, why))
        for piece in affine(name, self._problem):
            while run.t < piece.t_end and not (failure or recorder.ended):
                run.h = self._sizes.get(method.name, run.h)
                before = recorder.steps
                failure = run.over(method, piece, piece.t_end, left)
                self._sizes[method.name] = run.h
                left -= recorder.steps - before
                if failure and method is EXPLICIT:
                    # Its collapsed step is no start for another method.
                    failure, method, most = "", IMPLICIT, LOOK
                    left = most
                    self._sizes = {method.name: None, EXPLICIT.name: None}
                    self._uses.append((run.t, method.name, "tsit5 failed"))
                elif left <= 0:
                    method, most = self._next(method, most, piece(run.t))
                    left = most
            if failure or recorder.ended:
                break
        note = "; ".join(f"{used} from t = {t:.3g} s ({why})" for t, used, why in self._uses)
        names = "+".join(dict.fromkeys(used for _, used, _ in self._uses))
        return recorder.finish(f"{name}: {names}", failure, note)

    def _first(self) -> tuple[Package, int, str]:
        """The method that begins, its steps until the first look, and why.

        Where stability asks for few explicit steps, nothing else can gain much. Else the method
        begins whose steps up to the look are lost at the least cost if it is the wrong one.
        """
        cost, u = cost_ratio(self._problem.model), self._problem.pieces[0](self._advance.t)
        allowed = self._allowed(u)
        if self._left(allowed) < FEW * cost:
            return EXPLICIT, self._stretch, f"explicit stability allows steps of {allowed:.2g} s"
        why = "a first look at the step that accuracy allows"
        if cost > 2:
            return EXPLICIT, LOOK, why
        return IMPLICIT, first_look(self._problem.model.n_q), why

    def _allowed(self, u: np.ndarray) -> float:
        """Largest step that is stable for tsit5 here [s]."""
        return EXPLICIT_REACH / max(_fastest_rate(self._jacobian, self._advance, u), 1e-300)

    def _left(self, step: float) -> float:
        """Steps of this size to the end of the run."""
        return (self._problem.pieces[-1].t_end - self._advance.t) / step

    def _next(self, method: Package, most: int, u: np.ndarray) -> tuple[Package, int]:
        """The method for the next steps, and how many."""
        run, cost = self._advance, cost_ratio(self._problem.model)
        step = run.h or 0.0
        growth = self._growth(most) if most >= LOOK else 1.0
        if growth > 2 and method is IMPLICIT:
            # too early to compare; where steps cost little more, a look is the dearer
            return IMPLICIT, 2 * most if cost < 2 else most
        allowed = self._allowed(u)
        if method is EXPLICIT:
            if step < HIDDEN * allowed and growth > 2 and most == LOOK:
                return EXPLICIT, LOOK
            stretch, self._stretch = self._stretch, min(3 * self._stretch, LONGEST)
            if step < HIDDEN * allowed or self._left(step) < FEW * cost:
                return EXPLICIT, stretch
            # Near its stability limit, an explicit step hides what accuracy would allow: try steps
            # of rodas4 that would be worth it.
            t = self._recorder.latest(first_look(self._problem.model.n_q))
            self._taken = (t[-1] - t[0]) / (len(t) - 1)
            self._sizes[IMPLICIT.name] = 2 * MARGIN * cost * self._taken
            return IMPLICIT, LOOK_AGAIN
        accurate = step_ratio(self._problem.rtol) * step
        # Steps near the stability limit pay for it before they reach it.
        worth = cost * min(1 / (1 / accurate + 1 / allowed), self._taken)
        explicit = self._uses[-1][1] == EXPLICIT.name
        if growth > 1.5 and 10 * accurate > allowed:
            # A transient that fades: growing on, steps will soon be beyond what is stable.
            return IMPLICIT, most
        if worth * (MARGIN if explicit else 1 / MARGIN) > step:
            if not explicit:
                why = f"accuracy allows steps of {step:.2g} s, explicit stability {allowed:.2g} s"
                self._uses.append((run.t, EXPLICIT.name, why))
                self._sizes[EXPLICIT.name] = min(step, allowed)
            return EXPLICIT, self._stretch
        if explicit:
            why = f"explicit steps of {allowed:.2g} s are at the stability limit"
            self._uses.append((run.t, IMPLICIT.name, why))
            self._stretch, self._taken = 2 * first_look(self._problem.model.n_q), np.inf
            return IMPLICIT, first_look(self._problem.model.n_q)
        return IMPLICIT, min(4 * most, LONGEST)

    def _growth(self, most: int) -> float:
        """How many times larger steps have become over the second half of the last stretch."""
        t = self._recorder.latest(most // 2 + 1)
        return float((t[-1] - t[-2]) / (t[1] - t[0])) if len(t) > 2 else 1.0


def _fastest_rate(jacobian: Bound, run: Advance, u: np.ndarray) -> float:
    """Spectral radius of F_x by power iteration [1/s]."""
    jacobian.inputs.x[:], jacobian.inputs.u[:] = run.x, u
    jacobian.inputs.theta[:] = run.theta
    jacobian.run()
    F_x = jacobian.outputs.F_x
    scale = float(np.abs(F_x).max())
    if not 0 < scale < np.inf:
        return 0.0
    scaled = F_x / scale
    before = scaled @ np.ones(len(run.x))
    for _ in range(6):
        before = scaled @ before
    after = scaled @ before
    size = np.abs(before).max()
    return float(scale * np.abs(after).max() / size) if size > 0 else 0.0
