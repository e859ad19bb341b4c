"""A scene as a control experiment: the controller's problem, and the robot as it really is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dtcasadi import equilibrium
from dtcasadi.actuation import settled
from dtcasadi.bound import Bound
from dtcasadi.control import Control, KeepOut
from dtcasadi.discrete import DiscreteModel
from dtcasadi.errors import ControlError
from dtcasadi.integrators import linearly_implicit
from dtcasadi.model import Model
from dtcasadi.profile import Profile
from dtcasadi.scene import Scene
from dtcasadi.statics import Equilibrium
from dtcasadi.truth import truth_scene

from .closed_loop import Plant
from .problem import Effort, HalfSpace, Limits, Problem, Soft, Sphere, Tracking
from .stages import Stages, picked_of, stages

# The robot moves by a method of fourth order, and not by the one that the controller steps with.
_METHOD = "rodas4"


@dataclass(frozen=True, eq=False)
class Experiment:
    """What a scene makes of a closed loop.

    Attributes:
        scene: the scene, its start where its own model rests.
        stages: the problem on the controller's model.
        plant: the robot as it really is, at rest where the reference begins.
        length: of the robot's threads [m].
        robot: the plant's own discrete model.
    """

    scene: Scene
    stages: Stages
    plant: Plant
    length: float
    robot: DiscreteModel


def control_of(scene: Scene) -> Control:
    """The scene's table `[control]`.

    Raises:
        ControlError: it has none.
    """
    if scene.control is None:
        raise ControlError(f"{scene.name}: expected a scene with [control], got one without")
    return scene.control


def loaded_disc(scene: Scene) -> tuple[int, ...]:
    """The disc that an external force of the scene acts on."""
    number = scene.estimation.disc if scene.estimation else None
    return (number or scene.robot.n_discs,)


def model_of(scene: Scene, *, method: str | None = None) -> DiscreteModel:
    """The controller's model: the scene's, in its steps, with its sensors and a load to estimate.

    Args:
        scene: the scene.
        method: of integration; default: the scene's.
    """
    choice = control_of(scene)
    model = scene.build(wrenches=loaded_disc(scene))
    method = method or choice.method
    exact = not linearly_implicit(method)
    return model.discrete(choice.step_s, method=method, exact=exact, sensors=scene.sensors)


def robot_of(scene: Scene) -> DiscreteModel:
    """The robot as it really is, in short steps."""
    true = truth_scene(scene)
    model = true.build(wrenches=loaded_disc(true))
    step = control_of(scene).plant_step_s
    return model.discrete(step, method=_METHOD, exact=False, sensors=true.sensors)


def experiment(
    scene: Scene,
    *,
    discrete: DiscreteModel | None = None,
    robot: DiscreteModel | None = None,
    horizon: int | None = None,
) -> Experiment:
    """Put a scene's problem on its model, and make the plant.

    Args:
        scene: with `[control]` and sensors.
        discrete: the controller's model; default: `model_of(scene)`.
        robot: the robot as it is; default: `robot_of(scene)`.
        horizon: number of intervals; default: the scene's.

    Raises:
        ControlError: the scene has no `[control]`, or an equilibrium of the plant is not found.
    """
    choice = control_of(scene)
    discrete = model_of(scene) if discrete is None else discrete
    fine = robot_of(scene) if robot is None else robot
    model = fine.model
    picked = [
        (name, picked_of(discrete, name, _channels(choice, i), f"control.channels[{i + 1}]"))
        for i, name in enumerate(choice.outputs)
    ]
    wanted, start = _wanted(choice, model, fine, picked)
    terms, first = [], 0
    weights = np.broadcast_to(choice.weight, (wanted.n_u,))
    for name, places in picked:
        own = slice(first, first + len(places))
        values = Profile(wanted.times, wanted.values[:, own], wanted.kind)
        labels = tuple(k + 1 for k in places)
        terms.append(Tracking(name, values, weights[own], labels))
        first += len(places)
    problem = Problem(
        horizon=horizon or choice.horizon,
        tracking=terms,
        effort=Effort(choice.change, choice.level),
        limits=Limits(choice.minimum, choice.maximum, choice.rate),
        soft=tuple(_soft(zone) for zone in choice.keep_out),
        terminal=None if choice.terminal == "none" else choice.terminal,
        blocks=choice.blocks if horizon is None else None,
    )
    plant = Plant(
        discrete=fine,
        x0=start,
        u0=choice.reference(0.0),
        changes=_loads(scene),
        delay_s=choice.delay_s,
        seed=scene.estimation.seed if scene.estimation else None,
    )
    length = float(sum(thread.length for thread in scene.robot.threads))
    return Experiment(rested(scene, discrete.model), stages(discrete, problem), plant, length, fine)


def rested(scene: Scene, model: Model) -> Scene:
    """The scene with its start where its own model rests, not the true robot: what filters know."""
    pressure = control_of(scene).reference(0.0)
    rest = equilibrium(model, pressure)
    straight = rest.success and np.array_equal(rest.theta, model.theta0)
    if not straight:
        return scene
    charts = tuple(chart.name for chart in model.charts)
    still = np.zeros(model.n_q)
    start: dict[str, Any] = {"q0": rest.q, "qd0": still, "initial_pressure": pressure}
    return replace(scene, initial_chart=charts, **start)


def spans(profile: Profile, t_end: float, *, least: float = 1.0) -> tuple[list, list]:
    """Spans of time in which a reference rests, and in which it moves slowly.

    Args:
        profile: the reference.
        t_end: end of the last span [s].
        least: shortest span that counts; a quicker move is a step [s].

    Returns:
        (from, to) of the third quarter of each rest, before what comes next is felt, and of each
        move [s].
    """
    rests, moves = [], []
    for piece in profile.pieces(0.0, t_end):
        span = piece.t_end - piece.t_start
        long = span >= least
        if long and not np.any(piece.slope):
            rests.append((piece.t_start + 0.5 * span, piece.t_start + 0.75 * span))
        elif long:
            moves.append((piece.t_start, piece.t_end))
    return rests, moves


def _loads(scene: Scene) -> Callable[[float], Mapping[str, Any]]:
    """The external force on the true robot against time."""
    choice = scene.estimation
    if choice is None or not np.any(choice.contact_force):
        return lambda t: {}
    return lambda t: {"wrench": [*choice.contact(t), 0.0, 0.0, 0.0]}


def _wanted(
    choice: Control, model: Model, fine: DiscreteModel, picked: list[tuple[str, list[int]]]
) -> tuple[Profile, np.ndarray]:
    """The outputs where the true robot rests at the reference's pressures; and its first state."""
    read = {name: Bound(fine.sensors[name].output) for name, _ in picked}
    last: Equilibrium | None = None
    rows: list[np.ndarray] = []
    states: list[tuple[np.ndarray, np.ndarray]] = []
    known: dict[tuple, np.ndarray] = {}
    for pressure in choice.reference.values:
        key = tuple(pressure)
        if key not in known:
            rest = equilibrium(model, pressure, guess=last)
            if not rest.success:
                raise ControlError(
                    f"control.reference: expected pressures at which the robot rests, "
                    f"got {key}: {rest.message}"
                )
            last = rest
            actuator = settled(model, rest.q, pressure)
            x, theta = np.concatenate([rest.q, np.zeros(model.n_q), actuator]), fine.theta0.copy()
            theta[: len(rest.theta)] = rest.theta
            states.append((x, theta))
            y = {name: np.atleast_1d(out(x, pressure, theta)) for name, out in read.items()}
            known[key] = np.concatenate([y[name][places] for name, places in picked])
        rows.append(known[key])
    if not np.array_equal(states[0][1], fine.theta0):
        raise ControlError(
            "control.reference: expected a first pose near the straight one, got one re-centred"
        )
    return Profile(choice.reference.times, np.array(rows), choice.reference.kind), states[0][0]


def _channels(choice: Control, i: int) -> tuple[str, ...] | None:
    return None if choice.channels is None else tuple(choice.channels[i] or ()) or None


def _soft(zone: KeepOut) -> Soft:
    prices = {"linear": zone.linear, "quadratic": zone.quadratic}
    if zone.centre is None:
        return HalfSpace(zone.output, zone.normal, zone.offset, **prices)
    return Sphere(zone.output, zone.centre, zone.radius, **prices)
