"""The estimators by name, each made from a scene: what `dtcasadi estimate --estimator` offers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dtcasadi.discrete import DiscreteModel
from dtcasadi.errors import EstimationError
from dtcasadi.scene import Scene

from .ekf import EKF
from .runner import Filter, Track, track
from .scenario import knowledge


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
    known = knowledge(scene, discrete)
    return EKF(
        discrete,
        x0=known.x0,
        P0=known.P0,
        Q_w=known.Q_w,
        augment=known.augment,
        gate=known.gate,
    )


ESTIMATORS = {
    "ekf": Choice("extended Kalman filter", _ekf),
}


def chosen(name: str) -> dict[str, Choice]:
    """The estimators of a name, or every one for `all`.

    Raises:
        EstimationError: an unknown name.
    """
    if name == "all":
        return dict(ESTIMATORS)
    if name not in ESTIMATORS:
        raise EstimationError(
            f"estimator: expected one of {', '.join([*ESTIMATORS, 'all'])}, got {name!r}"
        )
    return {name: ESTIMATORS[name]}
