"""Motions as the benchmarks compare them: where the last disc is, how much energy there is."""

import pickle
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from ..bound import Bound
from ..compile import twin
from ..integrators import Problem
from ..model import Model
from ..scene import Scene

if TYPE_CHECKING:
    from ..events import Passed

# Arm of the points whose places tell a pose, in lengths of the robot.
ARM = 0.1
# Beyond this many coordinates the Jacobian takes minutes to compile.
LARGE = 100


def pose_of(model: Model, q: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """The last disc's frame as four points in lengths of the robot, shape (4, 3).

    Its origin, and the ends of its axes a tenth of the robot's length long: a turn by 0.1 rad
    counts as much as a hundredth of the length. The same in every chart and for any number of
    discs.
    """
    R, r = model.poses(q, theta)
    axes = np.array(R)[:, -3:].T
    origin = np.array(r)[:, -1] / model.robot.length
    return origin + ARM * np.vstack([np.zeros(3), axes])


def pose_error(one: np.ndarray, other: np.ndarray) -> float:
    """Largest distance between points of two poses, in lengths."""
    return float(np.max(np.linalg.norm(one - other, axis=-1)))


class Energy(NamedTuple):
    """Kinetic and potential energy [J]."""

    kinetic: float
    potential: float


class EnergyMeter:
    """T and V of a model's states, compiled."""

    def __init__(self, model: Model):
        self._bound = model.once("energy_meter", lambda: Bound(twin(_energy_function(model))))

    def __call__(self, x: np.ndarray, theta: np.ndarray) -> Energy:
        """Energies of one state."""
        bound = self._bound
        bound.inputs.x[:], bound.inputs.theta[:] = x, theta
        bound.run()
        return Energy(float(bound.outputs.kinetic[0]), float(bound.outputs.potential[0]))


def _energy_function(model: Model) -> ca.Function:
    x, theta = ca.MX.sym("x", model.n_x), ca.MX.sym("theta", len(model.theta0))
    q, qd = x[: model.n_q], x[model.n_q : 2 * model.n_q]
    values = [model.kinetic_energy(q, qd, theta), model.potential_energy(q, theta)]
    return ca.Function("energies", [x, theta], values, ["x", "theta"], ["kinetic", "potential"])


class Meter:
    """A sink for the steps of a run: keeps the last state, measures, and may end the run.

    Attributes:
        t: time reached [s].
        x: state reached, shape (n_x,).
        theta: parameters it holds with.
        steps: accepted steps.
        ended: why `look` ended the run, or empty.
    """

    def __init__(self, problem: Problem, look: Callable[[float, np.ndarray, np.ndarray], str]):
        """Watch a run.

        Args:
            problem: the run's.
            look: called with t, x, theta of every step; a text ends the run.
        """
        self.t, self.x = problem.pieces[0].t_start, problem.x0.copy()
        self.theta = problem.theta
        self._look = look
        self.ended = ""
        self.size = self.steps = self.rejected = self.evaluations = 0
        self.recentrings: list[tuple[float, tuple[int, ...]]] = []
        self.events: list[Passed] = []

    def add(self, t: np.ndarray, x: np.ndarray, theta: np.ndarray) -> None:
        """Look at every step."""
        for time, state in zip(t, x, strict=True):
            self.t, self.x, self.theta = float(time), state, theta
            self.steps += 1
            self.ended = self._look(self.t, state, theta)
            if self.ended:
                break
        self.x = self.x.copy()

    def replace_last(self, x: np.ndarray, theta: np.ndarray, segments: tuple[int, ...]) -> None:
        """The last state in re-centred coordinates."""
        self.x, self.theta = x, theta
        self.recentrings.append((self.t, segments))


def problem_of(scene: Scene, model: Model, **settings: object) -> Problem:
    """A scene's initial-value problem, with its own tolerances where none are given."""
    given = {"rtol": scene.rtol, "atol": scene.atol, "force": True} | settings
    pieces = scene.pressure.pieces(0.0, scene.t_end)
    return Problem(model, scene.x0(model), model.theta0, pieces, **given)  # type: ignore[arg-type]


@cache
def _models() -> dict[bytes, Model]:
    return {}


def model_of(scene: Scene, **overrides: object) -> Model:
    """The scene's model, one in each process for all scenes with the same robot and options.

    Above `LARGE` coordinates, what needs the Jacobian is left to CasADi's virtual machine.
    """
    key = pickle.dumps((scene.robot, sorted((scene.options | overrides).items())))
    models = _models()
    if key not in models:
        models[key] = model = scene.build(**overrides)
        if model.n_q > LARGE:
            model.interpreted.add("ode_jacobian")
    return models[key]
