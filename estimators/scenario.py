"""A scene as an experiment: the model that filters use, and what they know at the start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dtcasadi.discrete import DiscreteModel
from dtcasadi.errors import EstimationError
from dtcasadi.estimation import Estimation
from dtcasadi.integrators import linearly_implicit
from dtcasadi.scene import Scene

from .base import ProcessNoise


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What a scene tells every filter.

    Attributes:
        x0: states at the start, shape (n_x,).
        P0: variances of x0 and the estimated entries of theta, shape (n_z,).
        Q_w: process noise.
        augment: estimated blocks of theta: the contact force, biases of sensors that have some.
        gate: chance that a good measurement is refused; None: no gate.
    """

    x0: np.ndarray
    P0: np.ndarray
    Q_w: ProcessNoise
    augment: tuple[str, ...]
    gate: float | None


def settings(scene: Scene) -> Estimation:
    """The scene's table `[estimation]`.

    Raises:
        EstimationError: it has none, or no sensors.
    """
    if scene.estimation is None or not scene.sensors:
        missing = "[estimation]" if scene.estimation is None else "[[sensors]]"
        raise EstimationError(f"{scene.name}: expected a scene with {missing}, got one without")
    return scene.estimation


def contact_disc(scene: Scene) -> tuple[int, ...]:
    """The disc of the contact force."""
    return (settings(scene).disc or scene.robot.n_discs,)


def discrete_of(scene: Scene, **overrides: Any) -> DiscreteModel:
    """The scene's model with its sensors, in the filter's steps, a contact force on one disc.

    Args:
        scene: the scene.
        overrides: options of `dtcasadi.build` in place of the scene's.
    """
    choice = settings(scene)
    model = scene.build(wrenches=contact_disc(scene), **overrides)
    exact = not linearly_implicit(choice.method)
    return model.discrete(choice.step_s, method=choice.method, exact=exact, sensors=scene.sensors)


def knowledge(scene: Scene, discrete: DiscreteModel) -> Knowledge:
    """What a filter with the scene's model, or one made from it, knows."""
    choice, model = settings(scene), discrete.model
    x0 = scene.x0(model)
    n, n_z = model.n_q, model.n_x - 2 * model.n_q
    x0[:n] += choice.offset
    biases = tuple(name for name in discrete.theta_blocks if name.endswith(".bias"))
    sigma = [choice.angle_sigma] * n + [choice.rate_sigma] * n + [choice.pressure_sigma] * n_z
    sigma += [*choice.force_sigma, *choice.moment_sigma]
    walk: dict[str, Any] = {"wrench": [*choice.force_walk, *choice.moment_walk]}
    for name in biases:
        sigma += [0.1] * 6
        walk[name] = 1e-4
    state = np.concatenate([np.zeros(n), np.full(n, choice.rate_noise), np.zeros(n_z)])
    noise = ProcessNoise(force=choice.force_noise, walk=walk, state=state)
    return Knowledge(x0, np.array(sigma) ** 2, noise, ("wrench", *biases), choice.gate)
