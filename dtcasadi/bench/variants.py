"""Variants of a model timed against each other: rounds in which they take turns."""

import statistics
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from .dynamics import operations, time_per_call

if TYPE_CHECKING:
    from ..model import Model

ROUNDS = 5


def in_turn(models: Mapping[str, "Model"]) -> tuple[dict[str, float], dict[str, int]]:
    """Median time of a call of each state equation [us], and its operations.

    Actuators hold 5 Pa in the straight pose.
    """
    from ..actuation import settled

    compiled = {kind: model.compiled("ode").function for kind, model in models.items()}
    held = {
        kind: settled(model, np.zeros(model.n_q), np.full(model.n_u, 5.0))
        for kind, model in models.items()
    }
    rounds: dict[str, list[float]] = {kind: [] for kind in models}
    for _ in range(ROUNDS):
        for kind, model in models.items():
            rounds[kind].append(time_per_call(compiled[kind], model.theta0, held[kind])[0])
    times = {kind: statistics.median(values) for kind, values in rounds.items()}
    return times, {kind: operations(model.function("ode")) for kind, model in models.items()}
