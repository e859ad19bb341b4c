"""Checked numbers of actuators: one for all chambers, or a tuple with one for each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from .. import checks
from ..errors import ActuatorError
from .smooth import limited

Each = Any  # a number for all chambers, or a sequence with one for each
_T = TypeVar("_T")


def refusal(field: str, expected: str, got: object) -> ActuatorError:
    """The error of a field `owner.name`."""
    owner, _, name = field.partition(".")
    return ActuatorError(owner, name, expected, got)


def checked(
    owner: str,
    value: Any,
    names: Sequence[str],
    *,
    positive: bool = False,
    nonnegative: bool = False,
    infinite: bool = False,
) -> None:
    """Check and store fields of a frozen value; sequences become tuples, None stays.

    Raises:
        ActuatorError: a number is not finite (unless `infinite`), or not in its range.
    """
    bounds = {"positive": positive, "nonnegative": nonnegative}
    for name in names:
        given = getattr(value, name)
        if given is None or (infinite and isinstance(given, float) and given == np.inf):
            continue
        path = f"{owner}.{name}"
        if isinstance(given, list | tuple | np.ndarray) and np.ndim(given) == 1:
            numbers = tuple(
                checks.number(f"{path}[{k}]", entry, **bounds, error=refusal)
                for k, entry in enumerate(given, 1)
            )
            object.__setattr__(value, name, numbers)
        else:
            number = checks.number(path, given, **bounds, error=refusal)
            object.__setattr__(value, name, number)


def below(field: str, low: Any, high: Any, expected: str) -> None:
    """Whether a field's value `high` is above `low` in every chamber.

    Raises:
        ActuatorError: it is not.
    """
    try:
        right = bool(np.all(np.asarray(low) < np.asarray(high)))
    except ValueError:  # sequences of different lengths
        right = False
    if not right:
        raise refusal(field, expected, checks.shown(high))


def _is_number(value: object) -> bool:
    if isinstance(value, tuple):
        return bool(value) and all(isinstance(entry, float) for entry in value)
    return isinstance(value, float) and limited(value)


def numbers_of(value: Any, prefix: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Every number of an actuator and the values in it, by path, shape (1,) or (n,)."""
    for each in fields(value):
        inner = getattr(value, each.name)
        path = prefix + each.name
        if is_dataclass(inner):
            yield from numbers_of(inner, f"{path}.")
        elif _is_number(inner):
            yield path, np.atleast_1d(np.array(inner))


def check_chambers(value: Any, n: int) -> None:
    """Whether sequences have one number for each chamber.

    Raises:
        ActuatorError: naming the field.
    """
    for path, numbers in numbers_of(value):
        if len(numbers) not in (1, n):
            raise refusal(
                f"actuator.{path}", f"1 or {n} numbers, one for each chamber", len(numbers)
            )


def filled(value: _T, symbols: Mapping[str, ca.SX], prefix: str = "") -> _T:
    """The same with CasADi matrices for tuples, and for the numbers that have a symbol."""
    result = object.__new__(type(value))
    for each in fields(value):  # type: ignore[arg-type]
        inner = getattr(value, each.name)
        path = prefix + each.name
        if path in symbols:
            inner = symbols[path]
        elif is_dataclass(inner):
            inner = filled(inner, symbols, f"{path}.")
        elif isinstance(inner, tuple) and _is_number(inner):
            inner = ca.DM(inner)
        object.__setattr__(result, each.name, inner)
    return result
