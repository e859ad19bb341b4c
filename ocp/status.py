"""What a controller says of a step: how it went, and what it did instead where it did not go."""

from enum import IntEnum


class ControlStatus(IntEnum):
    """How a step of a controller went; the numbers are those of the exported C."""

    SOLVED = 0
    BUDGET = 1
    NO_ESTIMATE = 2
    NO_REFERENCE = 3
    MODEL_FAILED = 4
    SOLVER_FAILED = 5

    @property
    def sentence(self) -> str:
        """What it means."""
        return _SENTENCES[self]

    @property
    def good(self) -> bool:
        """Whether the command is that of this step's own plan."""
        return self <= ControlStatus.BUDGET


class Action(IntEnum):
    """What the command of a step is; the numbers are those of the exported C."""

    PLAN = 0
    LAST_PLAN = 1
    HOLD = 2
    RAMP = 3

    @property
    def sentence(self) -> str:
        """What it means."""
        return _ACTIONS[self]


_SENTENCES = {
    ControlStatus.SOLVED: "the plan is solved",
    ControlStatus.BUDGET: "the plan keeps to the limits of the commands, but its solution stopped "
    "at the budget of iterations",
    ControlStatus.NO_ESTIMATE: "the estimate is missing or not finite",
    ControlStatus.NO_REFERENCE: "the reference, the target or its cost is missing or not finite",
    ControlStatus.MODEL_FAILED: "the model's prediction is not finite or did not converge",
    ControlStatus.SOLVER_FAILED: "the quadratic program has no solution within the limits",
}
_ACTIONS = {
    Action.PLAN: "the command is the plan's",
    Action.LAST_PLAN: "the last plan goes on",
    Action.HOLD: "the last command is held",
    Action.RAMP: "the command goes to the safe pressure",
}
