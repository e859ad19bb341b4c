"""What sensors say of a known motion: logs with the noise, periods and drop-outs they state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .bound import Bound
from .discrete import DiscreteModel
from .logs import Log

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .scene import Scene


def recorded(
    discrete: DiscreteModel,
    t: np.ndarray,
    x: np.ndarray,
    u: np.ndarray,
    theta: np.ndarray,
    *,
    seed: int,
    source: str,
) -> Log:
    """A log of a motion at the instants of a model's steps.

    Rows are in the order of time; a sensor's latency is the reader's to observe.

    Args:
        discrete: the model with its sensors.
        t: times, one step apart, shape (n,) [s].
        x: states, shape (n, n_x).
        u: commands, shape (n, n_u).
        theta: parameters, shape (n, n_theta).
        seed: of the noise.
        source: what errors call the log.
    """
    rng = np.random.default_rng(seed)
    channels: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    unit = "Pa" if discrete.model.actuator.command == "pressure" else ""
    for k in range(u.shape[1]):
        channels[f"command{k + 1}"], units[f"command{k + 1}"] = u[:, k], unit
    for name, sensor in discrete.sensors.items():
        output = Bound(sensor.output)
        y = np.array([np.atleast_1d(output(*row)) for row in zip(x, u, theta, strict=True)])
        y = y + rng.multivariate_normal(np.zeros(sensor.n_y), sensor.R_v, len(y))
        every = round((sensor.period_s or discrete.step_s) / discrete.step_s) or 1
        silent = (np.arange(len(y)) % every != 0) | (rng.random(len(y)) < sensor.dropout)
        y[silent] = np.nan
        for k, (channel, unit) in enumerate(sensor.channels):
            channels[f"{name}.{channel}"], units[f"{name}.{channel}"] = y[:, k], unit
    return Log(t, channels, units, source)


def experiment(
    scene: Scene,
    step_s: float,
    *,
    t_end: float | None = None,
    values: Mapping[str, float] | None = None,
    factors: Mapping[str, float] | None = None,
    seed: int = 0,
    **options: object,
) -> Log:
    """What a scene's sensors would record: its motion by an adaptive integrator, to 1e-9.

    With other values of some parameters it is a robot to identify, whose truth is known.

    Args:
        scene: with sensors.
        step_s: time between rows [s].
        t_end: duration [s]; default: the scene's.
        values: other values of parameters, by path; one number for all that a path names.
        factors: on the scene's numbers, by path.
        seed: of the noise.
        options: of `dtcasadi.build` that replace the scene's.

    Raises:
        SimulationError: the motion does not reach its end.
    """
    paths = (*(values or {}), *(factors or {}))
    model = scene.build(**{**options, "parameters": paths})
    discrete = model.discrete(step_s, sensors=scene.sensors)
    changed = {"values": values, "factors": factors}
    return experiment_of(scene, discrete, t_end=t_end, **changed, seed=seed)


def experiment_of(
    scene: Scene,
    discrete: DiscreteModel,
    *,
    t_end: float | None = None,
    values: Mapping[str, float] | None = None,
    factors: Mapping[str, float] | None = None,
    seed: int = 0,
) -> Log:
    """`experiment` with a model of the scene that has the paths free."""
    from .errors import SimulationError
    from .simulate import simulate

    model, step_s = discrete.model, discrete.step_s
    theta = model.theta0.copy()
    for path, value in (values or {}).items():
        theta[model.theta_blocks[path]] = value
    for path, factor in (factors or {}).items():
        theta[model.theta_blocks[path]] *= factor
    n = round((scene.t_end if t_end is None else t_end) / step_s)
    t = np.array([float(f"{k * step_s:.12g}") for k in range(n + 1)])
    run = simulate(
        model,
        scene.x0(model),
        pressure=scene.pressure,
        t_end=float(t[-1]),
        theta=theta,
        rtol=1e-9,
        atol=1e-10,
    )
    if not run.success:
        raise SimulationError(f"{scene.name}: {run.message}")
    at = run.at(t)
    biases = np.zeros((n + 1, len(discrete.theta0) - len(model.theta0)))
    thetas = np.hstack([at.thetas.T, biases])
    return recorded(discrete, t, at.x.T, at.u.T, thetas, seed=seed, source=scene.name)
