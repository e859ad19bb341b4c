"""How to search, checked before anything is built."""

from __future__ import annotations

from dataclasses import dataclass

from .. import checks
from ..errors import IdentificationError

LOSSES = ("squares", "huber")
BEGIN = ("data", "simulation")


@dataclass(frozen=True)
class Settings:
    """Settings of an identification.

    Attributes:
        loss: `squares`, or `huber`, which outliers cannot pull (iteratively reweighted).
        threshold: of Huber's loss, in standard deviations; 1.345 has 95 % of the efficiency of
            least squares where there are no outliers (Huber, Robust Statistics, section 4.3).
        nodes: shooting nodes of each experiment, at most one for each step.
        begin: `data`: the nodes start near the readings, so that wrong parameters cannot carry the
            motion away; `simulation`: on the motion of the starting values.
        level: probability that an interval holds the truth.
        max_iterations: most steps of Gauss-Newton.

    Raises:
        IdentificationError: a field that is not usable.
    """

    loss: str = "squares"
    threshold: float = 1.345
    nodes: int = 20
    begin: str = "data"
    level: float = 0.95
    max_iterations: int = 50

    def __post_init__(self) -> None:
        """Check every field."""
        for name, words in (("loss", LOSSES), ("begin", BEGIN)):
            if getattr(self, name) not in words:
                raise refusal(name, f"one of {', '.join(words)}", checks.shown(getattr(self, name)))
        for name in ("threshold", "level"):
            value = checks.number(name, getattr(self, name), positive=True, error=refusal)
            object.__setattr__(self, name, value)
        if self.level >= 1:
            raise refusal("level", "a probability below 1", self.level)
        for name in ("nodes", "max_iterations"):
            checks.index(name, getattr(self, name), 1, 10**5, error=refusal)


def refusal(field: str, expected: str, got: object) -> IdentificationError:
    """The error of a field."""
    return IdentificationError(f"{field}: expected {expected}, got {got}")
