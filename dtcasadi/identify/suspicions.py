"""Faults that logs and settings may have though every number is finite: units, too long a step."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..bound import Bound
from ..discrete import DiscreteModel
from ..errors import LogError
from ..integrators import ONE_STEP
from ..integrators.steppers import step_function
from ..measuring import plants_of
from .problem import Problem
from .result import Identified
from .shooting import shoot, simulated

# What mistaken units multiply readings by, and how near that factor must be.
_FACTORS = {
    1e3: "a thousand times",
    1e-3: "a thousandth of",
    1e2: "a hundred times",
    1e-2: "a hundredth of",
    180 / math.pi: "180/pi times",
    math.pi / 180: "pi/180 of",
}
_NEAR = 1.5
_CLEAR = 10.0  # model readings smaller than so many standard deviations tell nothing
# Commands so many times the scene's are told.
_UNUSUAL = 50.0
# Standard deviations by which the error of the steps may move a value before that is told.
MOVED = 1.0
_MOST_STEPS = 1000


def check_units(problem: Problem) -> None:
    """Compare the size of each sensor's readings with what the model reads at the start.

    Raises:
        LogError: they differ by a factor that only another unit explains.
    """
    point = simulated(problem, np.zeros(problem.n_p))
    shots = None if point is None else shoot(problem, point)
    if shots is None:
        return
    sigma = np.sqrt(np.diag(problem.R_v))
    for data, stages in zip(problem.data, shots, strict=True):
        h = np.vstack([stage.h for stage in stages])
        kinds = [
            (name.partition(".")[0], unit)
            for name, unit in zip(problem.names, problem.units, strict=True)
        ]
        for name, unit in dict.fromkeys(kinds):
            mine = [k for k, kind in enumerate(kinds) if kind == (name, unit)]
            there = np.isfinite(data.y[:, mine])
            if not there.any():
                continue
            model = float(np.sqrt(np.mean(h[:, mine][there] ** 2)))
            given = float(np.sqrt(np.mean(data.y[:, mine][there] ** 2)))
            if min(model, given) == 0 or model < _CLEAR * float(np.min(sigma[mine])):
                continue
            for factor, words in _FACTORS.items():
                if abs(math.log(given / model / factor)) < math.log(_NEAR):
                    raise LogError(
                        f"{data.source}: {name}: expected readings of about {model:.3g} {unit}, as "
                        f"the model's at the start, got {words} that ({given:.3g} {unit}): is the "
                        "unit in the header right?"
                    )


def with_command_notes(problem: Problem, usual: np.ndarray) -> Problem:
    """The problem with a note on commands of another size than usual: is it their unit?

    Args:
        problem: its data have commands, shape (n + 1, n_u).
        usual: commands of the scene, shape (n_u, m), or nothing.
    """
    size = float(np.max(np.abs(usual), initial=0.0))
    noted = []
    for data in problem.data:
        given = float(np.max(np.abs(data.u), initial=0.0))
        if size and given and not 1 / _UNUSUAL < given / size < _UNUSUAL:
            note = (
                f"commands go up to {given:.3g}, those of the scene to {size:.3g}: is the unit in "
                "the header right?"
            )
            data = replace(data, notes=(*data.notes, note))
        noted.append(data)
    return replace(problem, data=tuple(noted))


def with_step_error(found: Identified) -> Identified:
    """The result with the error of the model's steps, by a run with steps half as long.

    The error is that of the readings, in standard deviations of their noise, root mean square over
    the worst channel of the first log. All of it together, the root of the sum of squares, is the
    most by which it can move a value in standard deviations of that value.
    """
    problem = found.problem
    robot = problem.discrete
    if not isinstance(robot, DiscreteModel) or not found.fits or not found.success:
        return found
    whole, half = (_readings(found, robot, parts) for parts in (1, 2))
    if whole is None or half is None:
        return found
    # Halving the step leaves a quarter of the error of a second-order method: 4/3 of the change.
    off = 4 / 3 * (whole - half) / np.sqrt(np.diag(problem.R_v))
    read = np.isfinite(problem.data[0].y[: len(off)]) & np.isfinite(off)
    squares = np.sum(np.where(read, off, 0.0) ** 2, axis=0)
    sizes = np.sqrt(squares / np.maximum(np.sum(read, axis=0), 1))
    worst = int(np.argmax(sizes))
    error, moved = float(sizes[worst]), math.sqrt(float(np.sum(squares)))
    notes = found.notes
    if moved > MOVED:
        notes = (
            *notes,
            f"steps of {robot.step_s:g} s by {robot.method} are off by {error:.2g} times the noise "
            f"of {problem.names[worst]}, which may move values by up to {moved:.2g} of their "
            "standard deviations: a shorter step, or radau5, keeps that out",
        )
    return replace(found, step_error=error, notes=notes)


def _readings(found: Identified, robot: DiscreteModel, parts: int) -> np.ndarray | None:
    """What is read along one run of the first log with each step cut in parts."""
    problem, data, model = found.problem, found.problem.data[0], robot.model
    own = len(model.theta0)
    step = Bound(step_function(ONE_STEP[robot.method], plants_of(model)[1]))
    x, theta, h = found.x0[0], found.theta, robot.step_s / parts
    still = np.zeros(model.n_u)
    rows = []
    for k in range(min(data.n, _MOST_STEPS) + 1):
        x, theta, _ = robot.recentre(x, theta)
        rows.append(np.atleast_1d(problem.read(x, data.u[k], theta)[0]))
        for _ in range(parts):
            x = step(x, data.u[k], still, [h], theta[:own])[0]
        if not np.all(np.isfinite(x)):
            return None
    return np.array(rows)
