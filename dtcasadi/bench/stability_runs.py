"""One cell of the stability map: the largest stable step of a method, or why there is none."""

import math
from dataclasses import asdict, dataclass, replace

import numpy as np

from ..errors import DtcasadiError
from ..integrators import METHODS, ONE_STEP, Trajectory
from ..integrators.package import Package
from ..integrators.problem import Problem
from ..integrators.sundials import Sundials
from ..model import Model
from ..recentring import chart_limit
from ..scene import Scene
from ..simulate import simulate
from .motions import EnergyMeter, Meter, model_of, pose_error, pose_of, problem_of
from .stability_reference import Reference, shipped

# References that differ by more say nothing about a method's error.
TRUSTED = 1e-4
# Steps an implicit method may take where it is not compiled.
INTERPRETED_STEPS = 100


@dataclass(frozen=True)
class Cell:
    """What a method does on a scene.

    Attributes:
        status: `ok`, `failed`, or `refused`: stopped at a singularity of the chart, or does not
            take such models, and said so.
        reason: a line for people.
        max_stable_step_s: of a method with a fixed step that is `ok` [s].
        error: pose error at the horizon, with that step or at default tolerances, in lengths;
            None where the references do not reach the horizon or disagree.
        kind: why not ok in a word: energy, not_finite, newton, singular, cost, unfit, other.
        steps: steps of the run that the error is of.
    """

    status: str
    reason: str
    max_stable_step_s: float | None = None
    error: float | None = None
    kind: str = ""
    steps: int | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """A run on a scene, until it ended in one way or another."""

    kind: str
    reason: str
    end: np.ndarray | None
    steps: int


class _SpentError(Exception):
    """A solver took more steps than it may."""


def step_grid(largest: float, smallest: float) -> list[float]:
    """Steps 10^(-k/4) s with k >= 0 from the largest down to the smallest [s]."""
    first = max(0, math.ceil(-4 * math.log10(largest) - 1e-9))
    last = math.floor(-4 * math.log10(smallest) + 1e-9)
    return [10 ** (-k / 4) for k in range(first, last + 1)]


def cell_of(name: str, method: str, reference: Reference) -> dict[str, object]:
    """The cell of a scene and a method, as in the JSON file."""
    scene = shipped(name)
    model = model_of(scene)
    fixed = ONE_STEP.get(method)
    try:
        if fixed is None:
            return asdict(_adaptive(scene, model, method, reference))
        return asdict(_largest(scene, model, Package(fixed, fixed=True), reference))
    except DtcasadiError as error:  # a method that does not take such models
        return asdict(Cell("refused", str(error), kind="unfit"))


def _largest(scene: Scene, model: Model, method: Package, reference: Reference) -> Cell:
    """Search the grid from large to small steps."""
    method.prepare(model)
    pieces = scene.pressure.pieces(0.0, scene.t_end)
    shortest = min(piece.t_end - piece.t_start for piece in pieces)
    smallest = scene.measure.smallest_step_s
    if method.method.a_stable and "ode_jacobian" in model.interpreted:
        smallest = max(smallest, scene.t_end / INTERPRETED_STEPS)
    outcome, step_s = None, 0.0
    for step_s in step_grid(shortest, smallest):
        outcome = fixed_run(scene, model, method, step_s, reference.most)
        if outcome.end is not None:
            error = _error(outcome.end, reference)
            text = f"stable with steps of {step_s:.2g} s"
            return Cell("ok", text, step_s, error, steps=outcome.steps)
    assert outcome is not None
    status = "refused" if outcome.kind == "singular" else "failed"
    return Cell(status, f"{outcome.reason} with steps of {step_s:.2g} s", kind=outcome.kind)


def fixed_run(scene: Scene, model: Model, method: Package, step_s: float, most: float) -> Outcome:
    """A run with one step size, ended where its energy passes the bound."""
    problem, meter = problem_of(scene, model, step_s=step_s), EnergyMeter(model)

    def look(t: float, x: np.ndarray, theta: np.ndarray) -> str:
        return "" if sum(meter(x, theta)) <= most else "energy"

    watch = Meter(problem, look)
    failure = method.through(problem, watch)
    if watch.ended:
        return Outcome("energy", f"{_ENERGY} at t = {watch.t:.3g} s", None, watch.steps)
    if failure:
        return _failed(model, watch.x, watch.t, failure, watch.steps)
    return Outcome("", "", _pose(model, watch.x, watch.theta), watch.steps)


_ENERGY = "energy above twice the reference's"
_KINDS = {
    "is not finite": "not_finite",
    "was not finite": "not_finite",
    "no finite rate": "not_finite",
    "Newton": "newton",
    "too small": "cost",
    "TOO_MUCH_WORK": "cost",
}


def _failed(model: Model, x: np.ndarray, t: float, failure: str, steps: int) -> Outcome:
    """A run that stopped by itself, in a few words."""
    singular = chart_limit(model, x)
    if singular:
        return Outcome("singular", f"{singular}, at t = {t:.3g} s", None, steps)
    kind = next((kind for text, kind in _KINDS.items() if text in failure), "other")
    words = {"not_finite": "state not finite", "newton": "Newton iteration does not converge"}
    words |= {"cost": "step too small"}
    return Outcome(kind, f"{words.get(kind, failure)} at t = {t:.3g} s", None, steps)


def _adaptive(scene: Scene, model: Model, method: str, reference: Reference) -> Cell:
    """A solver that sets its steps itself, at the scene's tolerances.

    `auto` is what `simulate` does; others may take as many steps as the smallest step allows.
    """
    found = _simulated(scene, model) if method == "auto" else _solved(scene, model, method)
    outcome = found if isinstance(found, Outcome) else _judged(*found, reference.most)
    if outcome.end is None:
        status = "refused" if outcome.kind == "singular" else "failed"
        return Cell(status, outcome.reason, kind=outcome.kind)
    # Those of SUNDIALS tell output times instead of steps.
    steps = None if isinstance(METHODS[method], Sundials) else outcome.steps
    text = "with steps of its own" if steps is None else f"in {steps} steps of its own"
    return Cell("ok", text, None, _error(outcome.end, reference), steps=steps)


def _simulated(scene: Scene, model: Model) -> tuple[Model, Trajectory]:
    run = simulate(
        model,
        scene.x0(model),
        pressure=scene.pressure,
        t_end=scene.t_end,
        rtol=scene.rtol,
        atol=scene.atol,
    )
    failure = "" if run.success else run.message
    ends = run.x[:, 1:]
    between = lambda nodes: run.at(nodes).x  # noqa: E731
    return run.model, Trajectory(run.t, run.x, ends, run.thetas, between, run.method, failure)


def _solved(scene: Scene, model: Model, method: str) -> tuple[Model, Trajectory] | Outcome:
    METHODS[method].prepare(model)
    allowed, count, reached = scene.t_end / scene.measure.smallest_step_s, 0, 0.0

    def advance(t: float) -> None:
        nonlocal count, reached
        count, reached = count + 1, t
        if count > allowed:
            raise _SpentError

    problem: Problem = replace(problem_of(scene, model), advance=advance)
    try:
        return model, METHODS[method].integrate(problem)
    except _SpentError:
        text = f"more than {allowed:.3g} steps: {reached:.3g} s reached"
        return Outcome("cost", text, None, count)


def _judged(model: Model, found: Trajectory, most: float) -> Outcome:
    """A finished run against the bound on energy."""
    meter, steps = EnergyMeter(model), len(found.t) - 1
    for t, x, theta in zip(found.t, found.x.T, found.thetas.T, strict=True):
        if not sum(meter(x, theta)) <= most:
            return Outcome("energy", f"{_ENERGY} at t = {t:.3g} s", None, steps)
    x, theta = found.x[:, -1], found.thetas[:, -1]
    if found.failure:
        return _failed(model, x, found.t[-1], found.failure, steps)
    return Outcome("", "", _pose(model, x, theta), steps)


def _pose(model: Model, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    return pose_of(model, x[: model.n_q], theta)


def _error(end: np.ndarray, reference: Reference) -> float | None:
    known = reference.end is not None and reference.agreement is not None
    if not known or reference.agreement > TRUSTED:  # type: ignore[operator]
        return None
    return pose_error(end, reference.end)  # type: ignore[arg-type]
