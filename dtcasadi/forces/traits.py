"""What a force's wrenches depend on, found by asking it once."""

from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from .. import checks
from ..errors import ModelError, RobotError
from .protocol import DiscState, Force, Packed, ThreadState, Wrench, numbers_in, packed
from .world import world_wrench


class Traits(NamedTuple):
    """pose: depends on where discs are; rates: on how they move; idle: there is never a wrench."""

    pose: bool
    rates: bool
    idle: bool


def traits(force: Force) -> Traits:
    """What the wrenches depend on, along the disc's axes where the world acts.

    Raises:
        ModelError: the force gives something else than a wrench for each disc it sees.
    """
    if not force.acts():
        return Traits(False, False, True)
    parts = packed(force)
    shapes = tuple(tuple(value.sparsity().compress()) for value in parts.values)
    kind: Any = parts.kind  # a class is hashable, whatever its instances are
    return _traits(kind, parts.static, parts.names, shapes, len(force.touched()))


@lru_cache(maxsize=1024)
def _traits(kind: Any, static: tuple, names: tuple, shapes: tuple, touched: int) -> Traits:
    values = tuple(
        ca.SX.sym(name, ca.Sparsity.compressed(list(shape)))
        for name, shape in zip(names, shapes, strict=True)
    )
    part = Packed(kind, static, names, values)
    if touched == 1:
        place, rates = (ca.SX.sym("R", 3, 3), ca.SX.sym("r", 3)), _vectors("w", "v")
        _checked(part, [DiscState(*place, own_rates=rates)])
        result = ca.vertcat(*world_wrench(*place, *rates, part))
        return _dependence(result, list(place), list(rates))
    discs, poses, moving = [], [], []
    for _ in range(touched - 1):
        R, (r, t, w, v, near, far) = ca.SX.sym("R", 3, 3), _vectors(*"rtwvnf")
        discs.append(DiscState(R, r, (w, v), thread=ThreadState(t, near, far, ca.SX.sym("l"))))
        poses += [R, r, t]
        moving += [w, v, near, far]
    wrenches = _checked(part, discs)
    return _dependence(ca.vertcat(*(p for w in wrenches for p in w[:2])), poses, moving)


def _checked(part: Packed, discs: list[DiscState]) -> list[Wrench]:
    given = part.force().wrenches(*discs)
    wrenches = [given] if isinstance(given, Wrench) else list(given)
    shapes = [
        tuple(ca.SX(p).shape for p in w[:2]) if isinstance(w, Wrench) else type(w).__name__
        for w in wrenches
    ]
    if shapes != [((3, 1), (3, 1))] * len(discs):
        expected = f"{len(discs)} Wrench of moment and force, shape (3, 1) each"
        raise ModelError(f"{part.kind.__name__}.wrenches: expected {expected}, got {shapes}")
    return wrenches


def _vectors(*names: str) -> tuple[ca.SX, ...]:
    return tuple(ca.SX.sym(name, 3) for name in names)


def _dependence(result: ca.SX, poses: list[ca.SX], rates: list[ca.SX]) -> Traits:
    def on(symbols: list[ca.SX]) -> bool:
        return bool(ca.depends_on(result, ca.vertcat(*(ca.vec(s) for s in symbols))))

    return Traits(on(poses), on(rates), result.nnz() == 0 or bool(result.is_zero()))


def check(path: str, force: Force, n_discs: int) -> None:
    """Whether the discs a force names are there and it gives something at all.

    Raises:
        RobotError: naming what is wrong, and where.
    """
    kind = type(force)
    discs = force.touched()
    if len(discs) == 1:
        checks.index(f"{path}.disc", discs[0], 1, n_discs)
    elif discs:
        for disc in discs:
            checks.index(f"{path}.discs", disc, 1, n_discs)
        if list(discs) != sorted(set(discs)):
            raise RobotError(f"{path}.discs", "disc numbers in rising order", discs)
    elif kind.field is Force.field:
        raise RobotError(path, f"{kind.__name__} with a field disc or discs", "none")
    if not kind.acts() and kind.body is Force.body and kind.field is Force.field:
        expected = f"{kind.__name__} with wrenches or energy (or body, or field)"
        raise RobotError(path, expected, "none of them")
    static = packed(force).static
    for name, value in static:
        try:
            hash(value)
        except TypeError:
            expected = "finite numbers, a text or a truth value"
            raise RobotError(f"{path}.{name}", expected, checks.shown(value)) from None
    for name, value in numbers_in(force).items():
        if not np.all(np.isfinite(value)):
            raise RobotError(f"{path}.{name}", "finite numbers", checks.shown(value))
