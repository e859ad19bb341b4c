"""What every filter is built on and gives back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dtcasadi import checks
from dtcasadi.errors import EstimationError


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a filter knows at one instant. Nothing else is carried from step to step.

    Attributes:
        x: states, shape (n_x,).
        P: covariance of [x; the estimated entries of theta], shape (n_z, n_z).
        theta: all parameters, the estimated ones at their estimates, shape (n_theta,).
        nis: e^T S^-1 e of the last update, over its finite readings; NaN before the first.
        used: finite readings in the last update.
        believed: False where the last update was beyond the gate and changed nothing.
        skipped: readings so far that were not finite numbers.
        gated: updates so far that were beyond the gate.
        recentred: how often the coordinates were re-centred so far.
        failed: predictions and updates so far that could not be taken.
        failure: why the last step could not be taken (x, P and theta are those before it), or ''.
    """

    x: np.ndarray
    P: np.ndarray
    theta: np.ndarray
    nis: float = float("nan")
    used: int = 0
    believed: bool = True
    skipped: int = 0
    gated: int = 0
    recentred: int = 0
    failed: int = 0
    failure: str = ""

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations of [x; the estimated entries of theta], shape (n_z,)."""
        return np.sqrt(np.diag(self.P))

    def failing(self, failure: str, **values: Any) -> Estimate:
        """The same, with the news of one more failure."""
        return self.replaced(failure=failure, failed=self.failed + 1, **values)

    def replaced(self, **values: Any) -> Estimate:
        """The same with other values."""
        # `dataclasses.replace` takes longer than some filters' updates.
        return type(self)(**{**vars(self), **values})


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    r"""White noise on the motion in physical terms, each an intensity (root of a spectral density).

    .. math:: Q = F_w \frac{\Sigma_w}{h} F_w^T + h \, \mathrm{diag}(walk^2)

    With h the step and F_w the step's derivative for the theta block `wrench`: noise of intensity
    s, held over a step, has variance s^2 / h.

    Attributes:
        force: on each disc of the block `wrench` [N/sqrt(Hz)].
        moment: on the same [N m/sqrt(Hz)].
        walk: estimated block of theta -> how far it wanders, one number or one for each entry
            [unit/sqrt(s)].
        state: of the states themselves, one number or one for each state [unit/sqrt(s)].
    """

    force: float = 0.0
    moment: float = 0.0
    walk: Mapping[str, Any] = field(default_factory=dict)
    state: Any = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("force", "moment"):
            value = checks.number(name, getattr(self, name), nonnegative=True, error=refusal)
            object.__setattr__(self, name, value)


def refusal(name: str, expected: str, got: object) -> EstimationError:
    """An error about an argument of a filter."""
    return EstimationError(f"{name}: expected {expected}, got {got}")


def names_of(sensor: str | Sequence[str]) -> tuple[str, ...]:
    """The sensors of an update: a name, or several read at the same instant."""
    return (sensor,) if isinstance(sensor, str) else tuple(sensor)


def chance(gate: float | None) -> float | None:
    """The chance that a good measurement is refused, checked.

    Raises:
        EstimationError: not a chance.
    """
    if gate is None:
        return None
    value = checks.number("gate", gate, error=refusal)
    if not 0 < value < 1:
        raise refusal("gate", "a chance between 0 and 1", gate)
    return value


def symmetric(name: str, value: Any, n: int, *, definite: bool) -> np.ndarray:
    """A covariance, shape (n, n), from a matrix or its diagonal.

    Raises:
        EstimationError: a wrong shape, or not symmetric positive (semi)definite.
    """
    if np.ndim(value) == 1:
        value = np.diag(checks.array(name, value, (n,), error=refusal))
    matrix = checks.array(name, value, (n, n), error=refusal)
    scale = float(np.max(np.abs(matrix), initial=0.0))
    # Round-off of a product of a few matrices; eigenvalues of zero may come out negative.
    if np.max(np.abs(matrix - matrix.T), initial=0.0) > 1e-9 * scale:
        raise refusal(name, "a symmetric matrix", "one that is not")
    matrix = (matrix + matrix.T) / 2
    least = float(np.min(np.linalg.eigvalsh(matrix))) if n else 1.0
    if least < -1e-12 * scale or (definite and least <= 0):
        kind = "positive definite" if definite else "positive semidefinite"
        raise refusal(name, f"a {kind} matrix", f"an eigenvalue of {least:.3g}")
    return matrix
