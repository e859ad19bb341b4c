"""Run a model in time."""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from . import checks
from .commands import CommandLike, command_pieces, sampled
from .constraints.examine import on_constraints
from .contact.report import touched
from .contact.start import free_start, rigid
from .contact.stepping import TIME_STEPPING
from .errors import ChartError, SimulationError
from .events import Event, checked
from .health import conditions, energy_balance, gauss_nodes, imbalance, samples_of
from .integrators import METHODS, ONE_STEP, SYMPLECTIC, Method, Package, Problem, Trajectory
from .model import Model
from .ratings import warn_above_rating
from .recentring import chart_limit, regular
from .result import Run
from .scene import Scene

# A balance further off than this share of the energy turned over is no result.
_IMBALANCE_MAX = 0.1
# A progress bar appears on a terminal when the run takes longer than this [s].
_PATIENCE_S = 1.0
# Energies below this share of weight times length are not worth balancing.
_LEAST = 1e-9
# Of rigid contact, where no step is given [s].
_STEP_S = 1e-3


def simulate(
    subject: Scene | Model,
    x0: Sequence[float] | np.ndarray | None = None,
    *,
    pressure: CommandLike | None = None,
    u: CommandLike | None = None,
    t_end: float | None = None,
    theta: np.ndarray | None = None,
    method: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step_s: float | None = None,
    fixed: bool | None = None,
    force: bool = False,
    events: Event | Sequence[Event] = (),
) -> Run:
    """Integrate the state equation from t = 0 to t_end.

    Args:
        subject: a scene, whose own settings hold where an argument is left out, or a model.
        x0: initial state [q; qd; actuator states], shape (n_x,).
        pressure: command of actuators that take a pressure [Pa]: a number for all chambers, one
            per chamber, a `Profile` (its breakpoints are step boundaries), or a function of t. The
            dead time of a `Delay` without lags holds it back.
        u: command of any actuator (valve openings), in the same forms.
        t_end: duration [s].
        theta: parameters, shape (n_theta,); default: the robot's own.
        method: a name of `dtcasadi.integrators.METHODS`. `auto` picks by measured stiffness; where
            only the chart stops it and the physics allow (physical damping, full velocity terms),
            it runs again in chart cardan: `run.model` is that model, and `run.choice` says so.
        rtol: relative tolerance of the local error; default 1e-6.
        atol: absolute tolerance; default 1e-8.
        step_s: step of a method without error control, first step of the others [s].
        fixed: take steps of step_s throughout, whatever error control the method has; for this
            package's one-step methods.
        force: take a step beyond the linear stability limit at the start, which is else refused.
        events: guard functions whose zeros are located; a terminal one ends the run.

    Returns:
        The run. A numerical failure is a run with `success` False, the states up to the last good
        one and a sentence.

    Raises:
        SimulationError: an argument cannot be used; the text says what was expected.
        ConstraintError: constraints that cannot be met together.

    Warns:
        PressureWarning: a chamber went beyond its rated pressure.
    """
    scene = subject if isinstance(subject, Scene) else None
    model = scene.build() if scene else subject
    if not isinstance(model, Model):
        hint = "; dtc.load_scene takes names and paths" if isinstance(subject, str) else ""
        raise SimulationError(f"expected a Scene or a Model, got {checks.shown(subject)}{hint}")
    if x0 is None:
        if scene is None:
            raise SimulationError("x0: expected the initial state of the model, got None")
        x0 = scene.x0(model)
    if pressure is not None and u is not None:
        raise SimulationError("expected either pressure or u, got both")
    if pressure is not None and model.actuator.command != "pressure":
        text = f"u, as this actuator's command is the {model.actuator.command} of its valves"
        raise _error("pressure", text, checks.shown(pressure))
    given = pressure if u is None else u
    if given is None:
        given = scene.pressure if scene else 0.0
    defaults = (scene.rtol, scene.atol, scene.t_end) if scene else (1e-6, 1e-8, None)
    rtol, atol, t_end = (
        default if value is None else value
        for value, default in zip((rtol, atol, t_end), defaults, strict=True)
    )
    name = method if method is not None else scene.method if scene else "auto"
    if not isinstance(name, str) or name not in METHODS:
        raise _error("method", f"one of {', '.join(METHODS)}", repr(name))
    step_s = scene.step_s if step_s is None and scene else step_s
    fixed = (scene is not None and scene.fixed) if fixed is None else fixed
    t_end = checks.number("t_end", t_end, positive=True, error=_error)
    if rigid(model):
        name, step_s = _stepping(name, step_s)
    if fixed and name not in ONE_STEP:
        raise _error("method", f"one of {', '.join(ONE_STEP)} for fixed steps", repr(name))
    theta = _theta(model, theta)
    x0, held = on_constraints(model, checks.array("x0", x0, (model.n_x,), error=_error), theta)
    if held and name in SYMPLECTIC:
        raise _error("method", "one that keeps constraints, such as rodas4 or sdirk2", repr(name))
    x0, freed = free_start(model, x0, theta)
    held = "; ".join(filter(None, (held, freed)))
    problem = Problem(
        model=model,
        x0=x0,
        theta=theta,
        pieces=command_pieces(
            given,
            model.n_u,
            t_end,
            name=model.actuator.command,
            delay=model.actuator.dead_time,
            before=_before(scene, model),
        ),
        rtol=checks.number("rtol", rtol, positive=True, error=_error),
        atol=checks.number("atol", atol, positive=True, error=_error),
        step_s=None
        if step_s is None
        else checks.number("step_s", step_s, positive=True, error=_error),
        force=force,
        events=checked(events),
    )
    run = _run(problem, Package(ONE_STEP[name], fixed=True) if fixed else METHODS[name])
    if held:
        run = replace(run, message=f"{run.message}; {held}")
    warn_above_rating(model.robot, run.pressure)
    return run


def _stepping(name: str, step_s: float | None) -> tuple[str, float | None]:
    """Method and step where there is rigid contact."""
    if name not in ("auto", TIME_STEPPING):
        raise _error(
            "method", f"{TIME_STEPPING} or auto, as the scene has rigid contact", repr(name)
        )
    return TIME_STEPPING, _STEP_S if step_s is None else step_s


def _before(scene: Scene | None, model: Model) -> np.ndarray | None:
    """The command before the start where the scene says what the chambers hold."""
    if scene is None or scene.initial_pressure is None:
        return None
    return model.actuator.rest_command(scene.initial_pressure)


def _run(problem: Problem, method: Method) -> Run:
    """Integrate; where `auto` stops at a singularity of the chart alone, in another chart."""
    run = _integrated(problem, method)
    singular = chart_limit(problem.model, run.x[:, -1])
    if run.success or method.name != "auto" or not singular:
        return run
    try:
        model, x0, theta = regular(problem.model, problem.x0, problem.theta)
    except ChartError:
        return run
    again = _integrated(replace(problem, model=model, x0=x0, theta=theta), method)
    why = f"chart cardan from the start, the same physics ({singular})"
    return replace(again, choice=f"{why}; {again.choice}")


def _integrated(problem: Problem, method: Method) -> Run:
    """Integrate and gather the run's health."""
    model, t_end = problem.model, problem.pieces[-1].t_end
    method.prepare(model)  # compiling is not integrating
    bar = tqdm(
        total=t_end,
        desc=method.name,
        delay=_PATIENCE_S,
        leave=False,
        disable=not sys.stderr.isatty(),
        bar_format="{desc} {bar} {n:.2f} of {total:.2f} s simulated",
    )
    with bar:
        start = time.perf_counter()
        trajectory = method.integrate(replace(problem, advance=lambda t: bar.update(t - bar.n)))
        wall_time = time.perf_counter() - start
    t, n = trajectory.t, model.n_u
    at = samples_of(t)
    nodes = sampled(problem.pieces, gauss_nodes(t), n)
    ends = t[:-1] + (1 - 1e-9) * np.diff(t)
    hit = touched(model, trajectory, sampled(problem.pieces, ends, n)) if rigid(model) else None
    energy = energy_balance(model, trajectory, nodes, at, hit)
    failure = trajectory.failure or _imbalance(model, trajectory, energy)
    steps = len(t) - 1

    def dense(times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        states, thetas = trajectory.at(times)
        return states, sampled(problem.pieces, times, n), thetas

    end = f"event {trajectory.ended!r} ended the run at" if trajectory.ended else "reached"
    return Run(
        model=model,
        t=t,
        x=trajectory.x,
        u=sampled(problem.pieces, t, n),
        thetas=trajectory.thetas,
        success=not failure,
        message=failure or f"{end} t = {t[-1]:g} s in {steps} steps of {trajectory.method}",
        method=trajectory.method,
        choice=trajectory.note,
        energy=energy,
        condition=conditions(model, trajectory.x[: model.n_q, at], trajectory.thetas[:, at]),
        recentrings=trajectory.recentrings,
        events=trajectory.events,
        steps=steps,
        step_sizes=np.diff(t),
        rejected=trajectory.rejected,
        evaluations=trajectory.evaluations,
        wall_time=wall_time,
        dense=dense,
        touched=hit,
    )


def _imbalance(model: Model, trajectory: Trajectory, energy: dict[str, np.ndarray]) -> str:
    """A sentence when finite states do not even balance their energy, or nothing."""
    if model.options.velocity_terms != "full" or len(trajectory.t) < 2:
        return ""
    smallest = _LEAST * model.robot.weight * model.robot.length
    if np.max(np.abs(energy["residual"])) <= smallest:
        return ""
    if trajectory.method == TIME_STEPPING:  # it loses energy by itself, as implicit Euler does
        energy = {**energy, "residual": np.maximum(energy["residual"], 0)}
    share = float(imbalance(energy))
    if share <= _IMBALANCE_MAX:
        return ""
    return (
        f"{trajectory.method}: the energy balance is off by {share:.0%} of the energy turned over; "
        "the motion is not a solution: try smaller steps or tighter tolerances"
    )


def _theta(model: Model, theta: np.ndarray | None) -> np.ndarray:
    if theta is None:
        return model.theta0
    return checks.array("theta", theta, model.theta0.shape, error=_error)


def _error(field: str, expected: str, got: object) -> SimulationError:
    return SimulationError(f"{field}: expected {expected}, got {got}")
