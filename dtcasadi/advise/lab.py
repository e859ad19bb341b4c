"""Runs candidates: where material points go, what that takes, and how far off it is."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..bench.dynamics import operations
from ..commands import command_pieces
from ..compile import QUICK_FLAGS
from ..errors import DtcasadiError
from ..integrators import ONE_STEP, Package, Problem
from ..integrators.stability import stability_limit
from ..integrators.steppers import step_in
from ..model import Model
from ..profile import Piece
from ..scene import Scene
from ..statics import Equilibrium, equilibrium
from ..statics.search import search_of
from .aside import out_of_plane
from .candidate import STATICS, Candidate

QUANTITIES = ("tip", "shape", "pressure-response")
# Instants of a run, levels of pressure, and points along the robot that are compared.
INSTANTS, LEVELS, POINTS = 101, 9, 21
# Of the robot's length: motion below it is not told apart from none.
LEAST_RANGE = 0.01
# An adaptive run that stands for the exact motion in time: its relative tolerance over the
# adviser's, the absolute one over that, and bounds. L-stable, as finer cuts are stiffer.
SHARE, ATOL, TIGHTEST, LOOSEST = 5e-3, 1e-2, 1e-9, 1e-4
EXACT = "rodas4"


class Path(NamedTuple):
    """What a candidate did.

    points: (instants, points, 3) [m], at equal material arc length; failure: why it did not, or
    nothing; cost: instructions, or infinity; wall_time: of the run alone [s]; aside: how far each
    segment leaves the plane in which it is at rest [m, at the tip].
    """

    points: np.ndarray
    failure: str
    cost: float
    wall_time: float
    aside: np.ndarray = np.zeros(0)


class Measured(NamedTuple):
    """A candidate against the reference: error over the range of motion; infinity if it failed."""

    candidate: Candidate
    error: float
    cost: float
    wall_time: float
    failure: str


@dataclass(eq=False)
class Lab:
    """A scene to run candidates on; each is run once.

    Attributes:
        scene: the scene.
        quantity: one of `QUANTITIES`.
        tolerance: the adviser's.
        tick: called after each run, for a progress bar.
    """

    scene: Scene
    quantity: str
    tolerance: float
    tick: Callable[[str], object] = lambda text: None
    _models: dict[Candidate, tuple[Scene, Model]] = field(default_factory=dict)
    _paths: dict[tuple[Candidate, float], Path] = field(default_factory=dict)

    @property
    def times(self) -> np.ndarray:
        """Instants that are compared [s]."""
        return np.linspace(0.0, self.scene.t_end, INSTANTS)

    @property
    def length(self) -> float:
        """Of the robot [m]."""
        return float(sum(thread.length for thread in self.scene.robot.threads))

    def model(self, candidate: Candidate) -> tuple[Scene, Model]:
        """A candidate's scene and model."""
        key = candidate.physics
        if key not in self._models:
            scene = key.scene(self.scene)
            # A graph of calls compiles sooner than the few runs here get slower.
            model = scene.build(assembly="graph")
            model.flags = QUICK_FLAGS
            self._models[key] = scene, model
        return self._models[key]

    def step_cost(self, candidate: Candidate) -> int:
        """Instructions of one step of a candidate's method."""
        return step_cost(self.model(candidate)[1], candidate.method)

    @property
    def rtol(self) -> float:
        """Of adaptive runs."""
        return float(np.clip(SHARE * self.tolerance, TIGHTEST, LOOSEST))

    def path(self, candidate: Candidate, tighter: float = 1.0) -> Path:
        """Run a candidate, or remember how it went; `tighter` is a factor of tolerances."""
        key = (candidate, tighter)
        if key not in self._paths:
            try:
                found = self._run(candidate, tighter)
            except DtcasadiError as error:
                text = " ".join(str(error).split())
                found = Path(np.full((1, 1, 3), np.nan), text, np.inf, 0.0)
            self._paths[key] = found
            self.tick(f"{candidate.n_discs} discs, {candidate.method}")
        return self._paths[key]

    def _run(self, candidate: Candidate, tighter: float) -> Path:
        scene, model = self.model(candidate)
        if self.quantity == "pressure-response":
            return self._response(scene, model, candidate)
        if not candidate.dynamic:
            return self._statics(scene, model, candidate)
        return self._motion(scene, model, candidate, self.rtol * tighter)

    def _motion(self, scene: Scene, model: Model, candidate: Candidate, rtol: float) -> Path:
        fixed = candidate.step_s is not None
        formula = ONE_STEP[candidate.method if fixed else EXACT]
        method = Package(formula, fixed=fixed)
        pieces = self._pieces(scene, model)
        start_at = (model, scene.x0(model), model.theta0, pieces, rtol, ATOL * rtol)
        problem = Problem(*start_at, step_s=candidate.step_s)
        method.prepare(model)
        start = time.perf_counter()
        trajectory = method.integrate(problem)
        seconds = time.perf_counter() - start
        if trajectory.failure:
            return Path(np.full((1, 1, 3), np.nan), trajectory.failure, np.inf, seconds)
        x, thetas = trajectory.at(self.times)
        steps = trajectory.evaluations / formula.evaluations
        cost = steps * step_cost(model, formula.name)
        points, aside = self._seen(scene, model, x[: model.n_q], thetas)
        return Path(points, "", cost, seconds, aside)

    def fewest_steps(self, candidate: Candidate) -> int:
        """Of the scene's duration that an explicit method survives at its start, without a run."""
        method = ONE_STEP[candidate.method]
        if method.a_stable:
            return 1
        # One Jacobian is not worth a compilation.
        scene, model = self.model(candidate)
        model.interpreted.add("ode_jacobian")
        problem = Problem(model, scene.x0(model), model.theta0, self._pieces(scene, model), 1, 1)
        limit = stability_limit(problem, method)
        return math.ceil(scene.t_end / limit * (1 + 1e-9)) if limit < np.inf else 1

    def _pieces(self, scene: Scene, model: Model) -> tuple[Piece, ...]:
        held = scene.initial_pressure
        pieces = command_pieces(
            scene.pressure,
            model.n_u,
            scene.t_end,
            name=model.actuator.command,
            delay=model.actuator.dead_time,
            before=None if held is None else model.actuator.rest_command(held),
        )
        return tuple(piece for piece in pieces if isinstance(piece, Piece))

    def _statics(self, scene: Scene, model: Model, candidate: Candidate) -> Path:
        """At rest at every instant, each equilibrium next to the one before."""
        pressures = scene.pressure.sample(self.times)
        return self._rests(scene, model, candidate, pressures)

    def _response(self, scene: Scene, model: Model, candidate: Candidate) -> Path:
        """Equilibria along the line from no pressure to the profile's largest in each chamber."""
        most = scene.pressure.values[np.argmax(np.abs(scene.pressure.values).sum(axis=1))]
        return self._rests(scene, model, candidate, np.outer(most, np.linspace(0.0, 1.0, LEVELS)))

    def _rests(
        self, scene: Scene, model: Model, candidate: Candidate, pressures: np.ndarray
    ) -> Path:
        balance, newton, _ = search_of(model).compiled  # no part of a run
        found: Equilibrium | None = None
        q, thetas, evaluations, start = [], [], 0, time.perf_counter()
        for column in pressures.T:
            if found is None or not np.array_equal(found.pressure, column):
                found = equilibrium(model, column, guess=found)
                evaluations += found.evaluations
            if not found.success:
                failure = f"statics: {found.message}"
                return Path(np.full((1, 1, 3), np.nan), failure, np.inf, 0.0)
            q.append(found.q)
            thetas.append(found.theta)
        seconds = time.perf_counter() - start
        cost = float(evaluations * (operations(balance) + operations(newton)))
        points, aside = self._seen(scene, model, np.array(q).T, np.array(thetas).T)
        return Path(points, "", cost, seconds, aside)

    def _seen(
        self, scene: Scene, model: Model, q: np.ndarray, thetas: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Section centres at equal arc lengths, or the last one alone; and `Path.aside`."""
        n, m = model.n_discs, q.shape[1]
        R, r = (np.array(part) for part in model.poses.map(m)(q, thetas))
        R = R.reshape(3, m, n, 3).transpose(1, 2, 0, 3)
        r = r.reshape(3, m, n).transpose(1, 2, 0)
        centres = np.array([disc.centre_of_mass for disc in scene.robot.discs])
        curve = r + np.einsum("mnij,nj->mni", R, centres)
        aside = out_of_plane(scene.robot, R, r)
        if self.quantity != "shape":
            return curve[:, -1:], aside
        along = np.cumsum([0.0, *(thread.length for thread in scene.robot.threads)])
        at = np.linspace(0.0, along[-1], POINTS)
        k = np.clip(np.searchsorted(along, at, side="right") - 1, 0, n - 2)
        share = ((at - along[k]) / np.diff(along)[k])[:, np.newaxis]
        return (1 - share) * curve[:, k] + share * curve[:, k + 1], aside


def step_cost(model: Model, method: str) -> int:
    """Instructions of one step of a method."""

    def count() -> int:
        return operations(step_in(model, method, native=True))

    return model.once(("step cost", method), count)


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """Largest distance between the same points at the same instants [m]; infinite if unlike."""
    if a.shape != b.shape or not np.all(np.isfinite(a)):
        return np.inf
    return float(np.linalg.norm(a - b, axis=-1).max())


def range_of(points: np.ndarray, length: float) -> float:
    """What errors are relative to: how far a point goes from where it starts, within a length."""
    moved = float(np.linalg.norm(points - points[0], axis=-1).max())
    return float(np.clip(moved, LEAST_RANGE * length, length))


__all__ = ["QUANTITIES", "STATICS", "Lab", "Measured", "Path", "distance", "range_of"]
