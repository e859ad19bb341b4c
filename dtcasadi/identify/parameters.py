"""What is identified: numbers of theta on a scale on which they are about one, with bounds.

    log:     v = v0 exp(z)              positive numbers: stiffnesses, masses, lengths ...
    linear:  v = v0 + scale z           those that may change sign

A path that names several numbers is one parameter: they keep their ratios. `springs[*].stiffness`
or `chip.bias[*]` frees each by itself.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import checks
from ..errors import IdentificationError
from .units import is_positive, unit_of

MOST = 200
_PAIR = 2


@dataclass(frozen=True, eq=False)
class Parameter:
    """One number to identify, v; its entries of theta are base * v.

    Attributes:
        name: its path.
        entries: places in theta.
        base: ones, or the scene's numbers where these differ and v is a factor on them.
        value0: v at the start.
        unit: of v; `x start` for a factor.
        log: whether it is scaled by its logarithm.
        scale: of a linear one.
        lower: bound of v.
        upper: bound of v.
        prior: mean and standard deviation of v known before, or None.
    """

    name: str
    entries: tuple[int, ...]
    base: np.ndarray
    value0: float
    unit: str
    log: bool
    scale: float
    lower: float = -math.inf
    upper: float = math.inf
    prior: tuple[float, float] | None = None

    def value(self, z: float) -> float:
        """Its v at z."""
        return self.value0 * math.exp(z) if self.log else self.value0 + self.scale * z

    def slope(self, z: float) -> float:
        """dv/dz."""
        return self.value(z) if self.log else self.scale

    def place(self, value: float) -> float:
        """The z of a value; infinite where a logarithm has none."""
        if not self.log:
            return (value - self.value0) / self.scale
        return -math.inf if value <= 0 else math.log(value / self.value0)


def expanded(path: str, robot: Any) -> tuple[str, ...]:
    """The paths of `build(parameters=...)` behind one of `--free`: `[*]` becomes each number."""
    if not isinstance(path, str):
        raise IdentificationError(f"free: expected paths, got {checks.shown(path)}")
    match = re.fullmatch(r"(\w+)\[\*\]\.(\w+)", path)
    if not match:
        return (path.removesuffix("[*]"),)
    part, field = match.groups()
    count = len(getattr(robot, part, ()))
    if not count:
        raise IdentificationError(f"free: {path}: the robot has no {part}")
    return tuple(f"{part}[{k}].{field}" for k in range(1, count + 1))


def parameters_of(
    theta0: np.ndarray,
    blocks: Mapping[str, slice],
    free: Sequence[str],
    *,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
) -> tuple[Parameter, ...]:
    """Parameters from blocks of theta.

    Args:
        theta0: numbers at the start, shape (n_theta,).
        blocks: name of each block -> its slice.
        free: names of blocks; `name[*]`: each number of it by itself.
        start: other values to start at, by name.
        bounds: (lower, upper) of values by name; None or infinite: none.
        priors: (mean, standard deviation) of values by name.

    Raises:
        IdentificationError: an unknown name, or a bound or prior that cannot be.
    """
    found: list[Parameter] = []
    for name in free:
        block = name.removesuffix("[*]")
        if block not in blocks:
            known = ", ".join(blocks) or "none: the model has no free numbers"
            raise IdentificationError(f"free: expected one of {known}, got {name!r}")
        where = range(blocks[block].start, blocks[block].stop)
        if name.endswith("[*]") and len(where) > 1:
            parts: list[tuple[str, tuple[int, ...]]]
            parts = [(f"{block}[{k}]", (i,)) for k, i in enumerate(where, 1)]
        else:
            parts = [(block, tuple(where))]
        found += [_parameter(part, entries, theta0) for part, entries in parts]
    names = [parameter.name for parameter in found]
    if not found or len(set(names)) != len(names):
        got = ", ".join(names) or "none"
        raise IdentificationError(f"free: expected different parameters, got {got}")
    if len(found) > MOST:
        raise IdentificationError(f"free: expected at most {MOST} parameters, got {len(found)}")
    for key, given in (("start", start), ("bounds", bounds), ("priors", priors)):
        for name in given or {}:
            if name not in names:
                raise IdentificationError(
                    f"{key}: expected one of {', '.join(names)}, got {name!r}"
                )
    pieces = (start or {}, bounds or {}, priors or {})
    return tuple(_limited(p, *(piece.get(p.name) for piece in pieces)) for p in found)


def theta_of(
    parameters: Sequence[Parameter], theta0: np.ndarray, z: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Theta at z, and its derivative for z, shape (n_theta, n_p)."""
    theta, S = np.array(theta0), np.zeros((len(theta0), len(parameters)))
    for k, parameter in enumerate(parameters):
        entries = list(parameter.entries)
        theta[entries] = parameter.base * parameter.value(float(z[k]))
        S[entries, k] = parameter.base * parameter.slope(float(z[k]))
    return theta, S


def _parameter(name: str, entries: tuple[int, ...], theta0: np.ndarray) -> Parameter:
    """On the scale of its kind, without bounds."""
    start = np.array(theta0[list(entries)])
    common = bool(np.all(start == start[0]))
    value0 = float(start[0]) if common else 1.0
    log = is_positive(name) and value0 > 0 and bool(np.all(start >= 0))
    lower = 0.0 if is_positive(name) else -math.inf
    unit = unit_of(name) if common else "x start"
    base = np.ones(len(entries)) if common else start
    return Parameter(name, entries, base, value0, unit, log, abs(value0) or 1.0, lower)


def _limited(parameter: Parameter, start: Any, bounds: Any, prior: Any) -> Parameter:
    """With its start, bounds and prior."""
    name = parameter.name
    if start is not None:
        value = checks.number("value", start, error=_refusal("start", name))
        if parameter.log and value <= 0:
            raise _refusal("start", name)("value", "a positive number", value)
        parameter = replace(parameter, value0=value, scale=abs(value) or parameter.scale)
    lower, upper = parameter.lower, parameter.upper
    if bounds is not None:
        low, high = _pair(bounds, _refusal("bounds", name))
        lower = lower if low is None else max(float(low), lower)
        upper = upper if high is None else float(high)
        if not lower < upper:
            raise _refusal("bounds", name)("range", "lower below upper", f"{lower:g}:{upper:g}")
        if not lower <= parameter.value0 <= upper:
            expected = f"a range with the start, {parameter.value0:g}, in it"
            raise _refusal("bounds", name)("range", expected, f"{lower:g}:{upper:g}")
    known = None
    if prior is not None:
        refuse = _refusal("priors", name)
        mean, sigma = _pair(prior, refuse)
        known = (
            checks.number("mean", mean, error=refuse),
            checks.number("sigma", sigma, positive=True, error=refuse),
        )
    scale = parameter.scale
    if parameter.value0 == 0:
        width = upper - lower
        scale = known[1] if known else width if math.isfinite(width) else scale
    return replace(parameter, lower=lower, upper=upper, prior=known, scale=scale)


def _pair(value: Any, refuse: checks.Raiser) -> tuple[Any, Any]:
    if not isinstance(value, Sequence | np.ndarray) or len(value) != _PAIR:
        raise refuse("pair", "two numbers", checks.shown(value))
    for number in value:
        if number is not None and not (isinstance(number, float) and math.isinf(number)):
            checks.number("pair", number, error=refuse)
    return value[0], value[1]


def _refusal(key: str, name: str) -> checks.Raiser:
    def refuse(field: str, expected: str, got: object) -> IdentificationError:
        return IdentificationError(f"{key}: {name}: expected {expected}, got {got}")

    return refuse
