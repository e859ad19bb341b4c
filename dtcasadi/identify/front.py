"""`dtc.identify`: from a scene, or a discrete model, and logs to parameters."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import checks
from ..discrete import DiscreteModel
from ..errors import IdentificationError
from ..logs import Log, read_log
from ..scene import Scene
from ..waist import Discrete
from .data import Data, Experiment, gridded
from .parameters import expanded
from .problem import Problem, build, node_steps, wanted_of
from .result import Identified
from .settings import Settings, refusal
from .solve import solve
from .suspicions import check_units, with_command_notes, with_step_error

if TYPE_CHECKING:
    from ..model import Model

LONGEST_STEP = 0.02  # [s], where the scene has no step of its own
# What is known of the first state of an unknown start: within a radian of the scene's, and slow.
ANGLE, RATE = 1.0, 3.0  # [rad], [rad/s]
# How far the model may be off when nodes follow the data.
ANGLE_OFF, RATE_OFF = 0.1, 1.0
_MOST_LEFT_OUT = 0.9
_PRESSURES = 0.3  # of the largest command: both for pressures that chambers hold

LogLike = Log | Experiment | str | os.PathLike
Logs = LogLike | Sequence[LogLike]


def identify(
    scene: Scene | Discrete,
    logs: Logs,
    free: Sequence[str] | str,
    *,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
    step_s: float | None = None,
    method: str = "sdirk2",
    initial: str | float | Sequence[float] = "unknown",
    validate: float | Logs | None = None,
    settings: Settings | None = None,
    progress: Callable[[int, float], None] | None = None,
    **options: Any,
) -> Identified:
    r"""Parameters of a robot from recorded motions, with confidence intervals.

    .. math:: \\min_{\\theta, x_0} \\sum_k \\| L^{-1} (h(x_k, u_k, \\theta) - y_k) \\|^2, \\quad
        x_{k+1} = f(x_k, u_k, \\theta), \\quad R_v = L L^T

    by multiple shooting and Gauss-Newton (Bock 1983), with exact derivatives. The first state of
    each log is fitted too.

    Args:
        scene: a scene with sensors, or a discrete model whose theta has the free blocks.
        logs: a log, a path, an `Experiment`, or several: all serve the same parameters.
        free: paths as of `build(parameters=...)`: `springs.stiffness` is one number for all
            springs (where they differ, a factor on them), `springs[*].stiffness` one for each,
            `actuator.supply.conductance`; `chip.bias[*]` of a sensor with biases.
        start: other starting values, by name.
        bounds: (lower, upper) by name; stiffnesses, masses and the like are positive anyway.
        priors: (mean, standard deviation) by name.
        step_s: step of the model [s]; default: the logs' spacing, or a fraction of it, at most the
            scene's `[estimation]` step or 20 ms.
        method: a one-step method's name.
        initial: first state of each log: `unknown`, `known` (the scene's), or its standard
            deviations about the scene's, one number or (n_x,).
        validate: logs to predict, or the share of each log at its end to leave out and predict.
        settings: loss, nodes, level ...: see `Settings`.
        progress: called with iteration and cost.
        options: of `dtcasadi.build` that replace the scene's.

    Returns:
        Values, covariance, intervals, what the data cannot tell apart, residual tests, validation.

    Raises:
        IdentificationError: a setting or name that is not usable.
        LogError: a log that is not usable, or does not fit the scene.
    """
    began = time.perf_counter()
    given = _experiments(logs)
    names = [free] if isinstance(free, str) else list(free)
    others = _experiments(validate) if validate is not None and not _is_share(validate) else []
    share = _share(validate) if _is_share(validate) else 0.0
    spread: Any = 1.0
    if isinstance(scene, Scene):
        everyone = [*given, *others]
        robot, names = discrete_of(scene, everyone, names, step_s, method, options)
        everyone = [_of_scene(scene, robot, each, initial) for each in everyone]
        given, others = everyone[: len(given)], everyone[len(given) :]
        spread = _scales(scene, robot, ANGLE_OFF, RATE_OFF)
        discrete: Discrete = robot
    else:
        if options or step_s is not None:
            raise refusal("scene", "a scene, for options of its model", "a discrete model")
        discrete = scene
    settings = settings or Settings()
    known = {"start": start, "bounds": bounds, "priors": priors}
    problem = build(discrete, given, names, **known, settings=settings, spread=spread)
    problem, later = _shortened(problem, share) if share else (problem, ())
    check_units(problem)
    if isinstance(scene, Scene):
        problem = with_command_notes(problem, scene.pressure.values)
    problem = replace(problem, build_s=time.perf_counter() - began)
    held_out = [gridded(each, wanted_of(discrete, problem.sensors)) for each in others]
    return with_step_error(solve(problem, held_out=held_out, later=later, progress=progress))


def discrete_of(
    scene: Scene,
    given: Sequence[Experiment],
    free: Sequence[str],
    step_s: float | None,
    method: str,
    options: Mapping[str, Any],
) -> tuple[DiscreteModel, list[str]]:
    """The scene's model in steps with the paths free in theta, and the names of its blocks.

    Raises:
        IdentificationError: the scene has no sensors, or a path is no path.
    """
    if not scene.sensors:
        raise IdentificationError(
            f"{scene.name}: expected a scene with [[sensors]], got one without"
        )
    biases = {f"{sensor.name}.bias" for sensor in scene.sensors if sensor.n_bias}
    names: list[str] = []
    paths: list[str] = []
    for path in free:
        if isinstance(path, str) and path.removesuffix("[*]") in biases:
            names.append(path)
            continue
        each = expanded(path, scene.robot)
        paths += each
        names += [path] if isinstance(path, str) and path.endswith("[*]") else list(each)
    model = scene.build(**{**options, "parameters": tuple(paths)})
    step = chosen_step(scene, [each.log for each in given]) if step_s is None else step_s
    return model.discrete(step, method=method, sensors=scene.sensors), names


def chosen_step(scene: Scene, logs: Sequence[Log]) -> float:
    """The spacing of the logs' rows, or the largest fraction of it that is short enough."""
    apart = [np.diff(np.unique(log.t)) for log in logs]
    spacing = min((float(np.median(each)) for each in apart if len(each)), default=0.0)
    if not spacing > 0:
        raise IdentificationError("step_s: expected logs with rows at different times")
    longest = scene.estimation.step_s if scene.estimation else LONGEST_STEP
    # Times are written with few digits: the step gets no more of them than they are worth.
    return float(f"{spacing / np.ceil(spacing / longest - 1e-6):.9g}")


def _of_scene(scene: Scene, discrete: DiscreteModel, given: Experiment, initial: Any) -> Experiment:
    """The experiment with the scene's start and command where it has none of its own."""
    model = discrete.model
    sigma = given.sigma
    if sigma is None:
        if isinstance(initial, str):
            if initial not in ("unknown", "known"):
                raise refusal("initial", "unknown, known or standard deviations", repr(initial))
            unknown = _scales(scene, discrete, ANGLE, RATE)
            sigma = 0.0 if initial == "known" else unknown
        else:
            sigma = initial
    x0 = scene.x0(model) if given.x0 is None else given.x0
    return replace(given, x0=x0, sigma=sigma, command=given.command or scene.pressure)


def _scales(scene: Scene, discrete: DiscreteModel, angle: float, rate: float) -> np.ndarray:
    """Deviations of coordinates, rates and actuator states, shape (n_x,)."""
    model: Model = discrete.model
    n = model.n_q
    swing = float(np.max(np.abs(scene.pressure.values), initial=0.0))
    held = _PRESSURES * swing if model.actuator.command == "pressure" and swing else 1.0
    if scene.initial_pressure is not None:
        held = max(held, float(np.max(np.abs(scene.initial_pressure))))
    return np.concatenate([np.full(n, angle), np.full(n, rate), np.full(model.n_x - 2 * n, held)])


def _experiments(logs: Any) -> list[Experiment]:
    """One or several logs, read where they are files."""
    several = isinstance(logs, Sequence) and not isinstance(logs, str)
    found = []
    for each in logs if several else [logs]:
        if isinstance(each, str | os.PathLike):
            each = read_log(each)
        found.append(each if isinstance(each, Experiment) else Experiment(each))
    if not found:
        raise refusal("logs", "at least one", "none")
    return found


def _is_share(value: Any) -> bool:
    return isinstance(value, int | float)


def _share(value: Any) -> float:
    share = checks.number("validate", value, positive=True, error=refusal)
    if share > _MOST_LEFT_OUT:
        raise refusal("validate", f"logs, or a share up to {_MOST_LEFT_OUT}", share)
    return share


def _shortened(problem: Problem, share: float) -> tuple[Problem, tuple[Data, ...]]:
    """The problem without the last share of each experiment, and the experiments in full."""
    whole = problem.data
    parts = tuple(each.first(max(round((1 - share) * each.n), 1)) for each in whole)
    steps = tuple(node_steps(each.n, problem.settings.nodes) for each in parts)
    return replace(problem, data=parts, nodes=steps), whole
