"""A scene as an experiment: its truth, what its sensors say of it, and the filter to find it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.discrete import DiscreteModel
from dtcasadi.errors import EstimationError
from dtcasadi.estimation import Estimation
from dtcasadi.logs import Log
from dtcasadi.model import Model
from dtcasadi.scene import Scene

from .base import ProcessNoise
from .ekf import EKF


@dataclass(frozen=True, eq=False)
class Truth:
    """What really happened, at every step.

    Attributes:
        model: the model that moved.
        t: times [s], shape (n,).
        x: states, shape (n, n_x).
        theta: parameters, shape (n, n_theta).
        u: commands, shape (n, n_u).
        force: contact force in the root frame, shape (n, 3) [N].
    """

    model: Model
    t: np.ndarray
    x: np.ndarray
    theta: np.ndarray
    u: np.ndarray
    force: np.ndarray


def settings(scene: Scene) -> Estimation:
    """The scene's table `[estimation]`.

    Raises:
        EstimationError: it has none, or no sensors.
    """
    if scene.estimation is None or not scene.sensors:
        missing = "[estimation]" if scene.estimation is None else "[[sensors]]"
        raise EstimationError(f"{scene.name}: expected a scene with {missing}, got one without")
    return scene.estimation


def discrete_of(scene: Scene) -> DiscreteModel:
    """The scene's model with its sensors, in the filter's steps, a contact force on one disc."""
    choice = settings(scene)
    model = scene.build(wrenches=contact_disc(scene))
    return model.discrete(choice.step_s, method=choice.method, sensors=scene.sensors)


def ekf_of(scene: Scene, discrete: DiscreteModel, **options: Any) -> EKF:
    """The filter for the scene: x, the contact force, and the biases of sensors that have some."""
    choice = settings(scene)
    model = scene.build()
    x0 = scene.x0(model)
    n, n_z = model.n_q, model.n_x - 2 * model.n_q
    x0[:n] += choice.offset
    biases = [name for name in discrete.theta_blocks if name.endswith(".bias")]
    sigma = [choice.angle_sigma] * n + [choice.rate_sigma] * n + [choice.pressure_sigma] * n_z
    sigma += [*choice.force_sigma, 0.0, 0.0, 0.0]
    walk: dict[str, Any] = {"wrench": [*choice.force_walk, 0.0, 0.0, 0.0]}
    for name in biases:
        sigma += [0.1] * 6
        walk[name] = 1e-4
    state = np.concatenate([np.zeros(n), np.full(n, choice.rate_noise), np.zeros(n_z)])
    noise = ProcessNoise(force=choice.force_noise, walk=walk, state=state)
    given = {"gate": choice.gate, **options}
    P0 = np.array(sigma) ** 2
    return EKF(discrete, x0=x0, P0=P0, Q_w=noise, augment=("wrench", *biases), **given)


def moved(scene: Scene, discrete: DiscreteModel, t_end: float | None = None) -> Truth:
    """The scene's motion under its pressure and contact force, step by step.

    Raises:
        EstimationError: a step that is not finite.
    """
    choice, model = settings(scene), scene.build(wrenches=contact_disc(scene))
    step = discrete.compiled("step")
    n = round((scene.t_end if t_end is None else t_end) / choice.step_s)
    x, theta = scene.x0(model), discrete.theta0.copy()
    block = discrete.theta_blocks["wrench"]
    rows: list[tuple] = []
    for k in range(n + 1):
        t = k * choice.step_s
        theta = theta.copy()
        theta[block.start : block.start + 3] = choice.contact(t + 0.5 * choice.step_s)
        u = scene.pressure(t)
        rows.append((t, x, theta, u, theta[block.start : block.start + 3]))
        # The truth is the discrete model itself: its stages need not be solved to the last digit.
        x, _ = step(x, u, theta)
        if not np.all(np.isfinite(x)):
            raise EstimationError(f"{scene.name}: the step at {t:.6g} s is not finite")
        x, theta, _ = discrete.recentre(x, theta)
    return Truth(model, *(np.array(part) for part in zip(*rows, strict=True)))


def contact_disc(scene: Scene) -> tuple[int, ...]:
    """The disc of the contact force."""
    return (settings(scene).disc or scene.robot.n_discs,)


def recorded(scene: Scene, discrete: DiscreteModel, truth: Truth, seed: int | None = None) -> Log:
    """What the sensors say of a truth: noise, periods and drop-outs as the scene has them.

    Rows are in the order of time; a sensor's latency is the runner's to observe.
    """
    rng = np.random.default_rng(settings(scene).seed if seed is None else seed)
    channels: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    unit = "Pa" if truth.model.actuator.command == "pressure" else ""
    for k in range(truth.u.shape[1]):
        channels[f"command{k + 1}"], units[f"command{k + 1}"] = truth.u[:, k], unit
    for name, sensor in discrete.sensors.items():
        output = Bound(sensor.output)
        rows = zip(truth.x, truth.u, truth.theta, strict=True)
        y = np.array([np.atleast_1d(output(*row)) for row in rows])
        y = y + rng.multivariate_normal(np.zeros(sensor.n_y), sensor.R_v, len(y))
        every = round((sensor.period_s or discrete.step_s) / discrete.step_s) or 1
        silent = (np.arange(len(y)) % every != 0) | (rng.random(len(y)) < sensor.dropout)
        y[silent] = np.nan
        for k, (channel, unit) in enumerate(sensor.channels):
            channels[f"{name}.{channel}"], units[f"{name}.{channel}"] = y[:, k], unit
    return Log(truth.t, channels, units, scene.name)
