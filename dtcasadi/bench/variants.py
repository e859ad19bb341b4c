"""Variants of a model timed against each other: rounds in which they take turns."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from .dynamics import operations, overheads, times_of_calls

if TYPE_CHECKING:
    from ..model import Model

ROUNDS = 5


def in_turn(models: Mapping[str, "Model"]) -> tuple[dict[str, float], dict[str, int]]:
    """Least time of a call of each state equation [us], and its operations.

    The least, as what else the machine does can only add to it. Actuators hold 5 Pa in the
    straight pose.
    """
    from ..actuation import settled

    compiled = {kind: model.compiled("ode").function for kind, model in models.items()}
    held = {
        kind: settled(model, np.zeros(model.n_q), np.full(model.n_u, 5.0))
        for kind, model in models.items()
    }
    times: dict[str, list[float]] = {kind: [] for kind in models}
    nothing = []
    for _ in range(ROUNDS):
        nothing += overheads()
        for kind, model in models.items():
            times[kind] += times_of_calls(compiled[kind], model.theta0, held[kind])
    least = {kind: max(min(values) - min(nothing), 0.0) for kind, values in times.items()}
    return least, {kind: operations(model.function("ode")) for kind, model in models.items()}
