"""This package's one-step methods as integration methods: the loop, re-centring, failures."""

import math
from dataclasses import dataclass
from threading import get_ident

import casadi as ca
import numpy as np

from ..bound import Bound
from ..errors import SimulationError
from ..events import Passed, guards_of
from ..model import Model
from ..profile import Piece
from ..recentring import LIMIT, NEAR, chart_limit, guard_indices, off_centre, singular_angles
from .loop import Loop, Work, build_loop
from .loop_state import LoopState, Stop, Watched
from .problem import Problem, Trajectory
from .recorder import Recorder, Sink, segment_of
from .stability import stability_limit
from .step import OneStep
from .steppers import step_in

# Steps per call of the compiled loop: the progress bar and Ctrl-C wait no longer than this.
CHUNK = 4096
# A last Newton correction above this share of the stages is a failed step.
SLACK_MAX = 1e-6
# Numbers a run may store (0.8 GB): a run that needs more is not going to end.
MOST_NUMBERS = 10**8
_WHY = {
    Stop.TOO_SMALL: "the step became too small for the tolerances",
    Stop.NOT_FINITE: "the step gave a state that is not finite",
    Stop.NEWTON: "the Newton iteration of the step did not converge",
    Stop.SINGULAR: "the mass matrix lost its condition",
}
# The slack of a step with contact is the defect of its cones, not of a Newton iteration.
_CONTACT = "the impulses of the step's contacts were not found"


@dataclass(frozen=True)
class Package:
    """A one-step method with error control where it has an estimate, else with a fixed step.

    Attributes:
        method: the formula.
        fixed: leave its error estimate alone and take steps of `step_s` throughout.
    """

    method: OneStep
    fixed: bool = False

    @property
    def name(self) -> str:
        """The method's name."""
        return self.method.name

    @property
    def adaptive(self) -> bool:
        """Whether the error estimate sets the step."""
        return self.method.error_order > 0 and not self.fixed

    def prepare(self, model: Model) -> None:
        """Compile the loop."""
        self.loop(model)
        model.compiled("ode")

    def loop(self, model: Model) -> Loop:
        """The compiled loop of this method for a model, built once."""

        def build() -> Loop:
            def step(native: bool) -> ca.Function:
                return step_in(model, self.name, native=native)

            if self.method.a_stable and "ode_jacobian" in model.interpreted:
                return Loop(step(False), None)
            return build_loop(step(True), lambda: step(False), model.flags)

        return model.once(("loop", self.name), build)

    def integrate(self, problem: Problem) -> Trajectory:
        """Run piece by piece, re-centring where a watched angle leaves its limit.

        Raises:
            SimulationError: a step is needed, or it is beyond the linear stability limit.
        """
        self._refuse_unstable(problem)
        recorder = Recorder(problem)
        return recorder.finish(self.name, self.through(problem, recorder))

    def through(self, problem: Problem, sink: Sink) -> str:
        """Run piece by piece into a sink, to the end or until the sink has enough.

        Returns:
            Why it failed, or nothing.

        Raises:
            SimulationError: the command is a function of time.
        """
        run, failure = Advance(problem, sink), ""
        for piece in affine(self.name, problem):
            failure = run.over(self, piece, piece.t_end)
            if failure or sink.ended:
                break
        return failure

    def _refuse_unstable(self, problem: Problem) -> None:
        if self.adaptive:
            return
        if problem.step_s is None:
            raise SimulationError(
                f"step_s: expected a step [s] for {self.name} without error control, got none (on "
                "the command line: --step)"
            )
        if problem.force or self.method.a_stable:
            return
        limit = stability_limit(problem, self.method)
        if problem.step_s > limit:
            raise SimulationError(
                f"step_s: {problem.step_s:g} s is beyond the linear stability limit {limit:.3g} s "
                f"of {self.name} at the start; take a smaller step, an L-stable method (rodas4, "
                "radau5), or force=True (--force)"
            )


class Advance:
    """A run under way: state, parameters and the size of the next step."""

    def __init__(self, problem: Problem, recorder: Sink):
        self.problem, self.recorder = problem, recorder
        self.x, self.theta = problem.x0.copy(), problem.theta.copy()
        self.t = problem.pieces[0].t_start
        self.h: float | None = None
        self._watched = watched(problem.model)
        self._work: dict[str, Work] = {}

    def over(self, method: Package, piece: Piece, t_end: float, most: int | None = None) -> str:
        """Advance to t_end inside a piece (or `most` steps); returns why it failed, or nothing.

        A terminal event ends it too; `recorder.ended` then names it.
        """
        state = self._state(method, piece, t_end)
        loop = method.loop(self.problem.model)
        if method.name not in self._work:
            self._work[method.name] = loop.work(len(self.x))
        command = (piece(piece.t_start), np.asarray(piece.slope, dtype=float))
        state.capacity = CHUNK if most is None else most
        tried = rejected = 0
        while True:
            guards = guards_of(self.problem.events, self.theta)
            why, t, x = loop.run(
                state,
                command,
                self.theta,
                self._watched,
                self.x,
                guards,
                self._work[method.name],
            )
            self.recorder.add(t, x, self.theta)
            self.recorder.rejected += state.rejected - rejected
            done = state.accepted + state.rejected
            self.recorder.evaluations += (done - tried) * method.method.evaluations
            tried, rejected = done, state.rejected
            self.t, self.h = state.t, state.h
            self.problem.advance(self.t)
            if why is Stop.GUARD:
                self._recentre()
            elif why is Stop.EVENT:
                self._note_event(state.event)
            elif why not in (Stop.AT_END, Stop.FULL):
                return self._failure(method.name, why, state.h)
            if why is Stop.AT_END or self.recorder.ended or state.accepted == most:
                return ""
            if most is not None:
                state.capacity = most - state.accepted
            elif self.recorder.size > MOST_NUMBERS:
                return (
                    f"{method.name}: stopped after t = {self.t:.6g} s: steps of {state.h:.2g} s "
                    "would fill the memory; try a shorter run, looser tolerances or softer forces"
                )

    def _state(self, method: Package, piece: Piece, t_end: float) -> LoopState:
        problem = self.problem
        if method.adaptive:
            if self.h is None:
                self.h = problem.step_s or self._first_step(piece)
            h, h_max = self.h, t_end - self.t
        else:
            span = piece.t_end - piece.t_start
            assert problem.step_s is not None
            h = h_max = span / max(1, math.ceil(span / problem.step_s - 1e-9))
        return LoopState(
            t=self.t,
            h=h,
            previous=1e-4,
            t_end=t_end,
            rtol=problem.rtol,
            atol=problem.atol,
            h_max=h_max,
            order=method.method.error_order + 1,
            slack_max=SLACK_MAX,
            limit=LIMIT,
            near=NEAR,
            t_command=piece.t_start,
            adaptive=method.adaptive,
        )

    def _first_step(self, piece: Piece) -> float:
        """Hairer, Norsett, Wanner, section II.4, without its second evaluation: 0.01 |x|/|xdot|."""
        ode = kept(self.problem.model, "ode")
        rate = ode(self.x, piece(self.t), self.theta)
        scale = self.problem.atol + self.problem.rtol * np.abs(self.x)
        size, speed = np.max(np.abs(self.x) / scale), np.max(np.abs(rate) / scale)
        guess = 0.01 * size / speed if size > 1e-5 and speed > 1e-5 else 1e-6
        return float(min(max(guess, 1e-9 * piece.t_end), piece.t_end - self.t))

    def _note_event(self, index: int) -> None:
        event = self.problem.events[index]
        self.recorder.events.append(Passed(event.name, self.t, self.x.copy(), self.theta.copy()))
        if event.terminal:
            self.recorder.ended = event.name

    def _recentre(self) -> None:
        model = self.problem.model
        segments = off_centre(model, self.x)
        self.x, self.theta, _ = model.recentre(self.x, self.theta)
        self.recorder.replace_last(self.x, self.theta, tuple(i + 1 for i in segments))

    def _failure(self, name: str, why: Stop, h: float) -> str:
        """What failed, when, where, and what to try."""
        model = self.problem.model
        rates = self.x[model.n_q : 2 * model.n_q]
        fastest = int(np.argmax(np.abs(rates))) if model.n_q else 0
        where = f"segment {segment_of(model, fastest)}" if model.n_q else "the actuator"
        singular = chart_limit(model, self.x)
        if singular:
            hint = f"{singular}; try chart='cardan' with damping='physical'"
        elif why is Stop.NEWTON and name == "moreau":
            hint = "try a smaller step or fewer rim points"
        elif why is Stop.NEWTON:
            hint = "try a smaller step or an adaptive method"
        elif name in ("rodas4", "ros2", "ros3"):
            hint = "try tighter tolerances, or look at the forces there"
        else:
            hint = "try a smaller step, or method rodas4 if the scene is stiff"
        reason = _CONTACT if why is Stop.NEWTON and name == "moreau" else _WHY[why]
        return (
            f"{name}: {reason} after t = {self.t:.6g} s (step {h:.2g} s, {where} moves "
            f"fastest); {hint}"
        )


def kept(model: Model, name: str) -> Bound:
    """A compiled Function's buffers, kept with the model for each thread."""
    return model.once(("kept", name, get_ident()), lambda: model.compiled(name))


def watched(model: Model) -> np.ndarray:
    """States a run watches, rows (entry of x, `Watched`), shape (m, 2)."""
    rows = [(int(k), Watched.LIMITED) for k in guard_indices(model)]
    rows += [
        (k, Watched.SINE if measure is np.sin else Watched.COSINE)
        for k, measure in singular_angles(model)
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 2)


def affine(name: str, problem: Problem) -> tuple[Piece, ...]:
    """The command's pieces, which the compiled loop needs to be affine in time.

    Raises:
        SimulationError: the command is a function of time.
    """
    pieces = tuple(piece for piece in problem.pieces if isinstance(piece, Piece))
    if len(pieces) < len(problem.pieces):
        raise SimulationError(
            f"method {name} takes a pressure as numbers or a Profile; with a function of time use "
            "auto, LSODA, Radau or another of SciPy's"
        )
    return pieces
