"""Boundary checks: each returns the cleaned value or raises naming field, expectation and gift."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from .errors import ModelError, RobotError

Raiser = Callable[[str, str, object], Exception]

# Magnitudes of the numbers a robot is described with. Products of a few of them (mass * radius^2,
# third moments of an outline) neither overflow nor vanish, so no later check has to think of it.
SMALLEST, LARGEST = 1e-30, 1e30


def shown(value: object) -> str:
    """A short one-line text of a value for an error message."""
    try:
        text = " ".join(repr(value.tolist() if isinstance(value, np.ndarray) else value).split())
    except (ValueError, RecursionError):  # an integer of thousands of digits, nesting without end
        return f"a value too large to show ({type(value).__name__})"
    return text if len(text) <= 80 else text[:77] + "..."


def number(
    field: str,
    value: object,
    *,
    positive: bool = False,
    nonnegative: bool = False,
    error: Raiser = RobotError,
) -> float:
    """A finite float of sane magnitude; positive or non-negative where asked."""
    kind = "positive " if positive else "non-negative " if nonnegative else ""
    expected = f"a finite {kind}number"
    unfit = isinstance(value, bool | np.bool_ | str | bytes) or value is None
    if unfit or (isinstance(value, np.ndarray) and value.ndim):
        raise error(field, expected, shown(value))
    try:
        result = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise error(field, expected, shown(value)) from None
    if not math.isfinite(result) or (positive and result <= 0) or (nonnegative and result < 0):
        raise error(field, expected, shown(value))
    if abs(result) > LARGEST or (positive and result < SMALLEST):
        bounds = f"from {SMALLEST:g} to {LARGEST:g}" if positive else f"up to {LARGEST:g}"
        raise error(field, f"{expected} {bounds}", shown(value))
    return result


def array(
    field: str, value: object, shape: tuple[int | None, ...], *, error: Raiser = RobotError
) -> np.ndarray:
    """A finite, read-only float array (a copy) of the shape (None: any length)."""
    wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
    expected = f"finite numbers of shape {wanted}"
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "fiu" or _holds_bool(value):
            raise ValueError
        result = np.array(raw, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise error(field, expected, shown(value)) from None
    fits = result.ndim == len(shape) and all(
        w is None or w == n for w, n in zip(shape, result.shape, strict=True)
    )
    if not fits:
        raise error(field, expected, f"shape {result.shape}")
    if not np.all(np.isfinite(result)):
        raise error(field, expected, shown(value))
    if np.any(np.abs(result) > LARGEST):
        raise error(field, f"{expected} up to {LARGEST:g}", shown(value))
    result.flags.writeable = False
    return result


def row(
    field: str, value: object, n: int, *, nonnegative: bool = False, error: Raiser = RobotError
) -> np.ndarray:
    """A float array of shape (n,); a single number stands for all."""
    if np.ndim(value) == 0:  # type: ignore[arg-type]
        value = [number(field, value, nonnegative=nonnegative, error=error)] * n
    result = array(field, value, (n,), error=error)
    if nonnegative and np.any(result < 0):
        raise error(field, "non-negative numbers", shown(value))
    return result


def limits(
    field: str, value: object, n: int | None = None, *, error: Raiser = RobotError
) -> tuple[np.ndarray, np.ndarray]:
    """Float arrays (lower, upper), shape (n,), from a pair of them or of numbers; infinite: none.

    Without n each keeps the shape that it has.
    """
    expected = "a pair (lower, upper), each one number or one for each entry"
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str) or len(value) != 2:
        raise error(field, expected, shown(value))
    try:
        sides = [np.asarray(side) for side in value]
        if any(side.dtype.kind not in "fiu" or side.ndim > 1 for side in sides):
            raise ValueError
        if _holds_bool(value):
            raise ValueError
        lower, upper = (np.asarray(side, dtype=float) for side in sides)
        if n is not None:
            lower, upper = np.broadcast_to(lower, n), np.broadcast_to(upper, n)
        ordered = np.all(lower <= upper)
    except (ValueError, OverflowError):
        raise error(field, expected, shown(value)) from None
    if not ordered:
        raise error(field, "lower bounds up to the upper ones", shown(value))
    return lower, upper


def neighbours(field: str, value: object, *, error: Raiser = RobotError) -> tuple[int, int]:
    """Numbers (i, i + 1) of two neighbouring discs."""
    if not isinstance(value, Sequence) or len(value) != 2:
        raise error(field, "two neighbouring disc numbers", shown(value))
    first, second = (index(field, disc, 1, 10**6, error=error) for disc in value)
    if second != first + 1:
        raise error(field, "neighbours (i, i + 1)", (first, second))
    return first, second


def _holds_bool(value: object) -> bool:
    """Whether a nested list holds a truth value, which NumPy turns into 0 or 1 beside numbers."""
    if isinstance(value, list | tuple):
        return any(_holds_bool(entry) for entry in value)
    return isinstance(value, bool | np.bool_)


def unit(field: str, value: object, *, error: Raiser = RobotError) -> np.ndarray:
    """A unit vector, shape (3,), from any finite vector that is not zero."""
    vector = array(field, value, (3,), error=error)
    length = float(np.linalg.norm(vector))
    if length < 1e-12:
        raise error(field, "a direction (3 numbers, not all zero)", shown(value))
    result = vector / length
    result.flags.writeable = False
    return result


def rotation(field: str, value: object, *, error: Raiser = RobotError) -> np.ndarray:
    """A rotation matrix, shape (3, 3), orthonormal to 1e-9 with determinant +1."""
    matrix = array(field, value, (3, 3), error=error)
    off = float(np.max(np.abs(matrix.T @ matrix - np.eye(3))))
    if off > 1e-9 or np.linalg.det(matrix) < 0:
        raise error(field, "a rotation matrix (R^T R = 1, det R = 1)", shown(value))
    return matrix


def truth(field: str, value: object, *, error: Raiser = RobotError) -> bool:
    """A truth value."""
    if not isinstance(value, bool | np.bool_):
        raise error(field, "True or False", shown(value))
    return bool(value)


def choice(field: str, value: object, valid: Sequence[str]) -> None:
    """Raise ModelError where the value is none of the valid words."""
    if value not in valid:
        raise ModelError(f"{field}: expected one of {', '.join(valid)}, got {value!r}")


def index(field: str, value: object, low: int, high: int, *, error: Raiser = RobotError) -> int:
    """An integer from low to high, both included."""
    expected = f"an integer from {low} to {high}"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise error(field, expected, shown(value))
    if not low <= value <= high:
        raise error(field, expected, shown(value))
    return int(value)


def tensor(
    field: str, value: object, *, definite: bool = True, error: Raiser = RobotError
) -> np.ndarray:
    """An inertia tensor, shape (3, 3), symmetric to the last digit.

    Positive definite, or without `definite` semidefinite (a point, a rod), and each principal
    moment at most the sum of the other two (Goldstein, Classical Mechanics, section 5.3).
    """
    tensor = array(field, value, (3, 3), error=error)
    scale = float(np.max(np.abs(tensor)))
    if np.max(np.abs(tensor - tensor.T)) > 1e-9 * scale:
        raise error(field, "a symmetric tensor", shown(tensor))
    moments = np.linalg.eigvalsh(tensor)
    # 1e-9 lets a flat body (I_1 + I_2 = I_3 exactly) pass after round-off.
    least = moments[0] > 0 if definite else moments[0] >= -1e-9 * scale
    if not least or moments[2] - moments[1] - moments[0] > 1e-9 * scale:
        kind = "positive" if definite else "non-negative"
        expected = f"{kind} principal moments, each at most the sum of the other two"
        raise error(field, expected, shown(moments))
    # The round-off allowed above must not make M unsymmetric.
    return array(field, (tensor + tensor.T) / 2, (3, 3), error=error)
