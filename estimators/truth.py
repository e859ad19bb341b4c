"""What a scene's robot really does, and what its sensors say of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dtcasadi import recording
from dtcasadi.discrete import DiscreteModel
from dtcasadi.errors import EstimationError
from dtcasadi.logs import Log
from dtcasadi.scene import Scene
from dtcasadi.truth import truth_scene

from .scenario import contact_disc, settings

# Of fourth order and L-stable, and not what filters step with: its error is far below theirs.
_METHOD = "rodas4"


@dataclass(frozen=True, eq=False)
class Truth:
    """What really happened, at every step.

    Attributes:
        discrete: the robot that moved, with its sensors.
        t: times [s], shape (n,).
        x: states, shape (n, n_x).
        theta: parameters, shape (n, n_theta).
        u: commands, shape (n, n_u).
        force: contact force in the root frame, shape (n, 3) [N].
    """

    discrete: DiscreteModel
    t: np.ndarray
    x: np.ndarray
    theta: np.ndarray
    u: np.ndarray
    force: np.ndarray


def moved(scene: Scene, t_end: float | None = None) -> Truth:
    """The scene's motion under its pressure and contact force, step by step.

    Raises:
        EstimationError: a step that is not finite.
    """
    choice, true = settings(scene), truth_scene(scene)
    model = true.build(wrenches=contact_disc(true))
    discrete = model.discrete(choice.step_s, method=_METHOD, exact=False, sensors=true.sensors)
    step = discrete.compiled("step")
    n = round((scene.t_end if t_end is None else t_end) / choice.step_s)
    x, theta = true.x0(model), discrete.theta0.copy()
    block = discrete.theta_blocks["wrench"]
    rows: list[tuple] = []
    for k in range(n + 1):
        t = k * choice.step_s
        theta = theta.copy()
        theta[block.start : block.start + 3] = choice.contact(t + 0.5 * choice.step_s)
        u = scene.pressure(t)
        rows.append((t, x, theta, u, theta[block.start : block.start + 3]))
        x, status = step(x, u, theta)
        if status[0] != 0:
            raise EstimationError(f"{scene.name}: the step at {t:.6g} s is not finite")
        x, theta, _ = discrete.recentre(x, theta)
    return Truth(discrete, *(np.array(part) for part in zip(*rows, strict=True)))


def recorded(scene: Scene, truth: Truth, seed: int | None = None) -> Log:
    """What the sensors say of a truth: noise, periods and drop-outs as the scene has them.

    Rows are in the order of time; a sensor's latency is the runner's to observe.
    """
    chosen = settings(scene).seed if seed is None else seed
    motion = (truth.t, truth.x, truth.u, truth.theta)
    return recording.recorded(truth.discrete, *motion, seed=chosen, source=scene.name)
