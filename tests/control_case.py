"""A control problem with all that a solver needs to be called on it."""

from typing import NamedTuple

import numpy as np

from ocp import Instance, Rollout, Stages, TargetCalculator, TerminalCost


class Case(NamedTuple):
    """An instance of a problem, and a plan to start from: the command in force, held."""

    stages: Stages
    instance: Instance
    plan: tuple[np.ndarray, np.ndarray]


def case(stages: Stages, x0: np.ndarray, u_now: np.ndarray) -> Case:
    """The problem at a state, its target found from there."""
    theta = stages.discrete.theta0
    references = stages.references(0.0)
    target = TargetCalculator(stages)(references[-1], theta, x0, u_now)
    P = TerminalCost(stages)(target, theta)
    instance = Instance(x0, u_now, theta, references, target.x, target.u, P)
    u = np.tile(u_now, (stages.horizon, 1))
    return Case(stages, instance, (Rollout(stages)(x0, u, theta), u))
