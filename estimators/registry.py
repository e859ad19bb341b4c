"""The estimators by name, each made from a scene: what `dtcasadi estimate --estimator` offers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dtcasadi.actuators import Direct, Hysteresis
from dtcasadi.discrete import DiscreteModel
from dtcasadi.errors import EstimationError
from dtcasadi.scene import Scene
from dtcasadi.sensors import PressureSensor

from .ekf import EKF
from .mhe import MHE
from .operating import operating_points
from .runner import Filter, Track, track
from .scenario import discrete_of, knowledge, settings
from .smoother import smoothed
from .spv import SPV
from .ukf import UKF

# Share of the range of pressures that leads from one branch of hysteresis half way to the other;
# and how many deviations of the gauge's noise at least.
_WIDTH, _NOISES = 0.1, 4


@dataclass(frozen=True)
class Choice:
    """An estimator.

    Attributes:
        title: its name for people.
        build: the filter for a scene, on the scene's model or on one made from it.
        run: filter, log, t_end -> what it made of the log; others than `track` may look at the
            whole log.
    """

    title: str
    build: Callable[[Scene, DiscreteModel], Filter]
    run: Callable[..., Track] = track


def _ekf(scene: Scene, discrete: DiscreteModel) -> EKF:
    """See `EKF`."""
    return EKF(discrete, **vars(knowledge(scene, discrete)), caution=settings(scene).caution)


def _spv(scene: Scene, discrete: DiscreteModel) -> SPV:
    """See `SPV`; of a scene with hysteresis, on the model without it and with two branches."""
    amplitude, actuator = 0.0, discrete.model.actuator
    if actuator.command != "pressure":
        raise EstimationError(
            f"spv: expected a scene whose command is the pressure, got {actuator.command}"
        )
    if isinstance(actuator, Hysteresis):
        amplitude = float(np.max(actuator.amplitude))
        discrete = discrete_of(scene, actuator=actuator.source)
        if not isinstance(actuator.source, Direct):
            kind = type(actuator.source).__name__.lower()
            raise EstimationError(f"spv: expected hysteresis of direct pressure, got of {kind}")
    known, values = knowledge(scene, discrete), scene.pressure.values
    low, high = values.min(axis=0), values.max(axis=0)
    gauges = [
        sensor
        for sensor in scene.sensors
        if isinstance(sensor, PressureSensor) and len(sensor.channels) == scene.pressure.n_u
    ]
    width = _WIDTH
    if gauges and np.any(high > low):
        width = max(width, _NOISES * float(np.max(gauges[0].noise) / np.max(high - low)))
    return SPV(
        discrete,
        operating_points(discrete.model, low, high, amplitude=amplitude),
        x0=known.x0,
        Q_w=known.Q_w,
        augment=known.augment,
        gauge=gauges[0].name if gauges else None,
        width=width,
        gate=known.gate,
    )


def _ukf(scene: Scene, discrete: DiscreteModel) -> UKF:
    """See `UKF`."""
    return UKF(discrete, **vars(knowledge(scene, discrete)), caution=settings(scene).caution)


def _mhe(scene: Scene, discrete: DiscreteModel) -> MHE:
    """See `MHE`."""
    choice, known = settings(scene), vars(knowledge(scene, discrete))
    return MHE(discrete, **known, caution=choice.caution, bounds=choice.bounds)


# Of the extended Kalman filter, as it is what goes back over its run.
SMOOTHER = "smoother"
ESTIMATORS = {
    "ekf": Choice("extended Kalman filter", _ekf),
    "ukf": Choice("unscented Kalman filter", _ukf),
    "mhe": Choice("moving horizon estimator", _mhe),
    SMOOTHER: Choice("fixed-interval smoother", _ekf, smoothed),
    "spv": Choice("parameter-varying observer", _spv),
}


def chosen(name: str, *, smooth: bool = False) -> dict[str, Choice]:
    """The estimators of a name, or every one for `all`; with the smoother behind, if asked for.

    Raises:
        EstimationError: an unknown name.
    """
    if name == "all":
        return dict(ESTIMATORS)
    if name not in ESTIMATORS:
        raise EstimationError(
            f"estimator: expected one of {', '.join([*ESTIMATORS, 'all'])}, got {name!r}"
        )
    names = [name, SMOOTHER] if smooth else [name]
    return {each: ESTIMATORS[each] for each in names}
