"""What the stability map compares with: the energy a scene's motion has, and where it ends."""

from dataclasses import dataclass

import numpy as np

from ..integrators import METHODS, Problem
from ..integrators.package import Package
from ..integrators.steppers import ONE_STEP
from ..model import Model
from ..scene import Scene, load_scene
from .motions import EnergyMeter, Meter, model_of, pose_error, pose_of, problem_of

FOLDER = "stability/"
# A run's energy above the reference's lowest potential energy may be so many times the reference's.
ALLOWED = 2.0
# Linearly implicit of order 4, explicit of order 5, SciPy's explicit one of order 8 and Radau IIA.
LINEAR, EXPLICIT, EIGHTH, RADAU = (
    *(("rodas4", 1e-10), ("tsit5", 1e-11)),
    *(("DOP853", 1e-11), ("Radau", 1e-9)),
)
# Where the explicit one would take more, Radau IIA takes its place.
MOST_STEPS = 500_000


@dataclass(frozen=True, eq=False)
class Reference:
    """A scene's reference motion.

    Attributes:
        floor: lowest potential energy on the way [J].
        top: largest sum of kinetic and potential energy on the way [J].
        end: pose at the horizon as in `motions.pose_of`, or None where no method reaches it.
        agreement: pose error between the two references at the horizon, or None.
        reason: why the horizon was not reached, or empty.
    """

    floor: float
    top: float
    end: np.ndarray | None
    agreement: float | None
    reason: str = ""

    @property
    def most(self) -> float:
        """Bound on kinetic plus potential energy: twice the height above the floor [J]."""
        return self.floor + ALLOWED * (self.top - self.floor)


def shipped(name: str) -> Scene:
    """A scene of the map by its short name."""
    return load_scene(FOLDER + name.removeprefix(FOLDER))


def reference_of(name: str) -> Reference:
    """The reference of a scene; its bound from another scene where the measure says so.

    The bound of a motion that ends before the horizon is that of `measure.bound_of`.
    """
    scene = shipped(name)
    model = model_of(scene)
    floor, top, first, reason = _first(scene, model)
    if reason and scene.measure.bound_of:
        other = shipped(scene.measure.bound_of)
        floor, top, *_ = _first(other, model_of(other))
    second = _second(scene, model) if first is not None else None
    agreement = None if first is None or second is None else pose_error(first, second)
    return Reference(floor, top, first, agreement, reason)


def _first(scene: Scene, model: Model) -> tuple[float, float, np.ndarray | None, str]:
    """Lowest V, largest T + V, the end and why it was not reached."""
    meter = EnergyMeter(model)
    extremes = [np.inf, -np.inf]

    def look(t: float, x: np.ndarray, theta: np.ndarray) -> str:
        energy = meter(x, theta)
        extremes[0] = min(extremes[0], energy.potential)
        extremes[1] = max(extremes[1], energy.kinetic + energy.potential)
        return ""

    method, rtol = EXPLICIT if "ode_jacobian" in model.interpreted else LINEAR
    problem = problem_of(scene, model, rtol=rtol, atol=1e-2 * rtol)
    look(0.0, problem.x0, problem.theta)
    watch, failure = _through(method, problem, look)
    return extremes[0], extremes[1], None if failure else _pose(model, watch), failure


def _second(scene: Scene, model: Model) -> np.ndarray | None:
    """The end by the second reference."""
    if "ode_jacobian" in model.interpreted:
        return _by_scipy(scene, model, *EIGHTH)
    method, rtol = EXPLICIT
    problem = problem_of(scene, model, rtol=rtol, atol=1e-2 * rtol)
    count = 0

    def look(t: float, x: np.ndarray, theta: np.ndarray) -> str:
        nonlocal count
        count += 1
        ahead = count > 1000 and count / t * scene.t_end > MOST_STEPS
        return "too many steps" if ahead else ""

    watch, failure = _through(method, problem, look)
    if not failure and not watch.ended:
        return _pose(model, watch)
    return _by_scipy(scene, model, *RADAU)


def _by_scipy(scene: Scene, model: Model, method: str, rtol: float) -> np.ndarray | None:
    METHODS[method].prepare(model)
    found = METHODS[method].integrate(problem_of(scene, model, rtol=rtol, atol=1e-2 * rtol))
    if found.failure:
        return None
    return pose_of(model, found.x[: model.n_q, -1], found.thetas[:, -1])


def _through(method: str, problem: Problem, look) -> tuple[Meter, str]:  # noqa: ANN001
    package, watch = Package(ONE_STEP[method]), Meter(problem, look)
    package.prepare(problem.model)
    return watch, package.through(problem, watch)


def _pose(model: Model, watch: Meter) -> np.ndarray:
    return pose_of(model, watch.x[: model.n_q], watch.theta)
