"""What a step of a controller tells, and a plan simulated again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.compile import twin

from .nlp import Instance
from .plans import Cost, limited
from .stages import Stages
from .status import Action, ControlStatus
from .target import Target


@dataclass(frozen=True, eq=False)
class StepInfo:
    """What a step found.

    Attributes:
        status: how it went.
        action: what the command is.
        plan: commands of the horizon, shape (N, n_u) [Pa].
        states: predicted states, shape (N + 1, n_x), of the linearized model; zero without a plan.
        iterations: changes of the quadratic program's active set.
        violation: largest violation of its rows that is left.
        saturated: whether each command is at its limit or at its rate limit, shape (n_u,).
        instance: what held in the step; not finite where something was missing.
        target: where the controller is to come to rest; None where the cost knows none.
        reason: what was wrong with the arguments, or ''.
    """

    status: ControlStatus
    action: Action
    plan: np.ndarray
    states: np.ndarray
    iterations: int
    violation: float
    saturated: np.ndarray
    instance: Instance
    target: Target | None
    reason: str = ""

    @property
    def text(self) -> str:
        """One line for people."""
        reason = f" ({self.reason})" if self.reason else ""
        return f"{self.status.sentence}{reason}; {self.action.sentence}"


@dataclass(frozen=True, eq=False)
class Check:
    """A plan simulated again by the model's own step.

    Attributes:
        states: shape (N + 1, n_x).
        gap: largest difference from the predicted states, relative to 1 + |state|.
        excess: how far the plan is from one within limits and rate limits [Pa].
        violation: largest violation of each soft limit, in its unit, shape (n_g,).
        cost: J of the problem over the simulated states, slacks included; inf where they fail.
        good: whether every step converged to finite states; those after one that does not repeat
            the last good one.
    """

    states: np.ndarray
    gap: float
    excess: float
    violation: np.ndarray
    cost: float
    good: bool


class Checker:
    """Simulates plans again; the Functions are built once."""

    def __init__(self, stages: Stages):
        """Compile them."""
        self._stages = stages
        step, source = stages.discrete.step, stages.discrete.native("step")
        self._step = Bound(twin(step, source=source))
        outputs = twin(stages.linearize, source=stages.native)
        self._outputs = Bound(outputs, matrices={"R_x", "G_x"})
        self._cost = Cost(stages)

    def __call__(self, info: StepInfo) -> Check:
        """The plan of a step, from the state it was made for."""
        s, given = self._stages, info.instance
        rows, good = [given.x0], bool(np.all(np.isfinite(given.x0)))
        for u in info.plan:
            x, status = self._step(rows[-1], u, given.theta)
            good &= bool(status[0] == 0 and np.all(np.isfinite(x)))
            rows.append(x if good else rows[-1])
        states = np.array(rows)
        g = [self._outputs(x, given.theta, given.references[0]).g for x in states[1:]]
        gap = np.abs(states - info.states) / (1 + np.abs(states))
        return Check(
            states,
            float(np.max(gap)),
            float(np.max(np.abs(info.plan - limited(s, info.plan, given.u_now)))),
            np.max(g, axis=0, initial=0.0),
            self._cost(given, states, info.plan) if good else float("inf"),
            good,
        )
