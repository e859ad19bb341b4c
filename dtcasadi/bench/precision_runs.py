"""Points of the work-precision chart: each method at each tolerance or step on each model."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import ChartError, DtcasadiError
from ..integrators import METHODS, ONE_STEP
from ..model import Model
from ..scene import Scene
from ..statics import equilibrium
from .balance import energy_defect, momentum_defect
from .motions import model_of, pose_of, problem_of
from .precision_reference import Motion, Reference, distances, reference_of

TOLERANCES = tuple(10 ** (-k / 2) for k in range(4, 23))
STEPS = tuple(10 ** (-k / 2) for k in range(11))
# A run is repeated while it is quick; a method slower than the patience stays at its tolerance.
REPEATS, QUICK_S, PATIENCE_S = 7, 0.02, 0.4
SAMPLES_STATIC = 20


@dataclass(frozen=True)
class Kind:
    """A model of the scene.

    Attributes:
        label: for people.
        chart: its chart.
        velocity_terms: full, paper or none.
        n_discs: number of discs.
        methods: what is run on it.
    """

    label: str
    chart: str
    velocity_terms: str
    n_discs: int
    methods: tuple[str, ...]


@dataclass(frozen=True)
class Point:
    """One run.

    Attributes:
        scene: its scene.
        method: its method; `equilibrium` for the quasi-static motion.
        chart: chart of the model.
        n_discs: number of discs.
        velocity_terms: full, paper, none; `static` without any motion.
        tolerance_or_step: relative tolerance (a hundredth of it absolute), or step [s].
        error: largest pose error along the run against the model's own references, in lengths, up
            to the time to which they agree; of the quasi-static motion, its total error.
        error_end: the same at that time.
        total_error: against the scene's own model, as `error`; with the model's own error.
        wall_s: fastest of several runs [s].
        evaluations: of the state equation or its residual.
        steps: accepted steps.
        energy_defect: share by which the energy balance is off, beyond the trusted time; or None.
        momentum_defect: largest defect of d p/dt = dL/dq + Q over a step there, relative; or None.
        on_frontier: nothing else on the same model is both faster and more accurate.
        on_overall_frontier: the same for the total error, over all models.
    """

    scene: str
    method: str
    chart: str
    n_discs: int
    velocity_terms: str
    tolerance_or_step: float
    error: float
    error_end: float
    total_error: float
    wall_s: float
    evaluations: int
    steps: int
    energy_defect: float | None = None
    momentum_defect: float | None = None
    on_frontier: bool = False
    on_overall_frontier: bool = False


def cut(scene: Scene, kind: Kind) -> Scene:
    """The scene in a number of discs."""
    same = kind.n_discs == scene.robot.n_discs
    return scene if same else scene.rediscretised(kind.n_discs)


def built(scene: Scene, kind: Kind) -> tuple[Scene, Model, Reference] | None:
    """The scene, model and references of a kind; None where its chart cannot hold the start."""
    own = cut(scene, kind)
    try:
        model = model_of(own, chart=kind.chart, velocity_terms=kind.velocity_terms)
        own.x0(model)
    except (ChartError, DtcasadiError):
        return None
    return own, model, reference_of(own, model)


def points_of(
    method: str,
    scene: Scene,
    kind: Kind,
    found: tuple[Scene, Model, Reference],
    truth: Reference,
) -> Iterator[Point]:
    """A method's points on one model, from loose to tight."""
    own, model, reference = found
    METHODS[method].prepare(model)
    fixed = method in ONE_STEP and not ONE_STEP[method].error_order
    for setting in STEPS if fixed else TOLERANCES:
        run = _timed(own, model, method, setting, fixed=fixed)
        if run is None:
            continue
        motion, wall = run
        error, end = reference.errors(motion)
        if np.isfinite(error):
            total = error if reference is truth else truth.errors(motion)[0]
            point = _point(scene, kind, method, setting, (error, end, total), motion, wall)
            yield _with_defects(own, point, motion, reference)
        if wall > PATIENCE_S or error < 1e-12:
            break


def _timed(
    scene: Scene, model: Model, method: str, setting: float, *, fixed: bool
) -> tuple[Motion, float] | None:
    """The motion and the fastest of some runs, or None where it fails."""
    tolerances = {} if fixed else {"rtol": setting, "atol": 1e-2 * setting}
    step = {"step_s": min(setting, scene.t_end)} if fixed else {}
    walls: list[float] = []
    found = None
    while len(walls) < (REPEATS if not walls or min(walls) < QUICK_S else 2):
        problem = problem_of(scene, model, **tolerances, **step)
        start = time.perf_counter()
        found = METHODS[method].integrate(problem)
        walls.append(time.perf_counter() - start)
        if found.failure or walls[0] > PATIENCE_S:
            break
    assert found is not None
    return None if found.failure else (Motion(model, found), min(walls))


def _point(
    scene: Scene,
    kind: Kind,
    method: str,
    setting: float,
    errors: tuple[float, float, float],
    motion: Motion,
    wall: float,
) -> Point:
    error, end, total = errors
    return Point(
        scene=scene.name,
        method=method,
        chart=kind.chart,
        n_discs=kind.n_discs,
        velocity_terms=kind.velocity_terms,
        tolerance_or_step=setting,
        error=error,
        error_end=end,
        total_error=total,
        wall_s=wall,
        evaluations=motion.found.evaluations,
        steps=len(motion.found.t) - 1,
    )


def _with_defects(scene: Scene, point: Point, motion: Motion, reference: Reference) -> Point:
    """The point with the balances of its run, where the references do not reach the horizon."""
    if reference.trusted >= scene.t_end:
        return point
    return replace(
        point,
        energy_defect=energy_defect(scene, motion),
        momentum_defect=momentum_defect(scene, motion),
    )


def quasi_static(scene: Scene, model: Model, truth: Reference) -> Point | None:
    """The motion that is at rest at every instant: one equilibrium after the other."""
    times = np.linspace(0.0, truth.trusted, SAMPLES_STATIC + 1)
    poses, q, theta, count = [], None, model.theta0, 0
    equilibrium(model, scene.pressure(0.0))  # compiles
    start = time.perf_counter()
    for t in times:
        rest = equilibrium(model, scene.pressure(t), guess=q, theta=theta)
        if not rest.success:
            return None
        q, theta, count = rest.q, rest.theta, count + rest.evaluations
        poses.append((q, theta))
    wall = time.perf_counter() - start
    found = np.array([pose_of(model, *each) for each in poses])
    gaps = distances(found, truth.motion.poses(times))
    return Point(
        scene=scene.name,
        method="equilibrium",
        chart=model.charts[0].name,
        n_discs=model.n_discs,
        velocity_terms="static",
        tolerance_or_step=truth.trusted / SAMPLES_STATIC,
        error=float(np.max(gaps)),
        error_end=float(gaps[-1]),
        total_error=float(np.max(gaps)),
        wall_s=wall,
        evaluations=count,
        steps=SAMPLES_STATIC,
    )


def on_frontier(points: Sequence[tuple[float, float]]) -> list[bool]:
    """For pairs (wall, error): whether no other is at most as slow and at most as wrong."""
    marks = []
    for wall, error in points:
        better = (w <= wall and e <= error and (w < wall or e < error) for w, e in points)
        marks.append(not any(better))
    return marks
