"""Bounds on estimated numbers, and the quadratic program that keeps a window within them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from dtcasadi import checks
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.quadratic import NONE, Rows, solved
from dtcasadi.waist import Discrete

from .augmented import Layout
from .base import refusal
from .sigma import root_of
from .steps import OPTIONS
from .window import Passed, Solved, backwards

# Rows of the program: the kernel keeps some ten matrices of this size.
MOST = 128
_STATUS = {
    1: "the bounds were not met within the budget of changes of the active set",
    2: "the bounds contradict each other or what is known exactly",
    3: "the covariance of the bounded numbers is not finite",
}


class Limits(NamedTuple):
    """Bounded entries of z, and their bounds, shape (n,) each."""

    entry: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def limits_on(discrete: Discrete, layout: Layout, bounds: Mapping[str, Any]) -> Limits:
    """Bounds by name: of an entry of z, or of all entries of a block of theta.

    Raises:
        EstimationError: an unknown name, or no pair of numbers in order.
    """
    found: dict[int, tuple[float, float]] = {}
    for name, pair in bounds.items():
        block = discrete.theta_blocks.get(name, slice(0, 0))
        labels = {name, *(f"{name}[{k + 1}]" for k in range(block.stop - block.start))}
        entries = [k for k, known in enumerate(layout.names) if known in labels]
        if not entries:
            raise refusal("bounds", f"names out of {', '.join(layout.names)}", repr(name))
        label = f"bounds[{name!r}]"
        sides = checks.limits(label, pair, len(entries), error=refusal)
        found |= dict(zip(entries, zip(*sides, strict=True), strict=True))
    entry = np.array(sorted(k for k, pair in found.items() if np.any(np.isfinite(pair))), dtype=int)
    lower, upper = np.array([found[k] for k in entry]).reshape(-1, 2).T
    return Limits(entry, lower, upper)


class Kept(NamedTuple):
    """A solution within the bounds.

    Attributes:
        d: changes of every step, shape (k + 1, n_z).
        active: bounds that hold.
        worst: largest violation of a bound or of complementarity, in standard deviations.
        failure: why there is none, or ''.
    """

    d: np.ndarray
    active: int = 0
    worst: float = 0.0
    failure: str = ""


class Bounded:
    r"""Keeps the solution of a window within bounds.

    Only where the solution without bounds leaves them: with M the joint covariance, given all
    readings, of the bounded numbers a of all steps, and M = L L^T, the nearest a = a_0 + L s within
    the bounds solves

    .. math:: \min \tfrac12 |s|^2,\quad lo \le a_0 + L s \le up

    with the controller's kernel (`dtcasadi.quadratic`), whose multipliers then push on the window.
    There are as many rows as bounded numbers times steps, however many states there are: condensing
    onto start and process noise would take some 700 variables of a 30-state robot in 20 steps.
    """

    def __init__(self, limits: Limits, steps: int):
        """Build the program for a number of steps.

        Raises:
            EstimationError: more rows than the kernel takes.
        """
        self.limits, self._m = limits, len(limits.entry) * steps
        if self._m > MOST:
            expected = f"at most {MOST} bounds over all {steps} steps of the window"
            raise refusal("bounds", expected, f"{len(limits.entry)} at each step")
        self._program = _program(self._m) if self._m else None

    def kept(self, passed: Passed, free: Solved, z: np.ndarray) -> Kept:
        """The solution within the bounds.

        Args:
            passed: the filter's pass.
            free: the solution without bounds.
            z: reference points, shape (k + 1, n_z).
        """
        entry, lower, upper = self.limits
        if self._program is None:
            return Kept(free.d)
        value = (z + free.d)[:, entry]
        if np.all(lower <= value) and np.all(value <= upper):
            return Kept(free.d)
        steps, m = len(z), value.size
        units = np.zeros((*z.shape, m))
        step, which = np.divmod(np.arange(m), len(entry))
        units[step, entry[which], np.arange(m)] = 1.0
        M = backwards(passed, units).d[:, entry].reshape(m, m)
        sigma = np.sqrt(np.maximum(np.diag(M), 0.0))
        moves = sigma > 0
        outside = np.maximum(lower - value, value - upper).ravel()
        if np.any(outside[~moves] > 0):
            return Kept(free.d, failure=_STATUS[2])
        by = np.where(moves, sigma, 1.0)
        root = root_of((M + M.T) / np.outer(by, by) / 2)
        low, high = (
            np.where(moves, np.clip((np.tile(side, steps) - value.ravel()) / by, -NONE, NONE), far)
            for side, far in ((lower, -NONE), (upper, NONE))
        )
        rows = np.zeros((self._m, self._m))
        rows[: root.shape[1], :m] = root.T
        none = np.full(self._m - m, NONE)
        multipliers, active, status, worst = self._program(
            rows, np.r_[low, -none], np.r_[high, none]
        )
        if status[0] != 0:
            return Kept(free.d, failure=_STATUS[int(status[0])])
        nu = multipliers[:m]
        forces = np.zeros(z.shape)
        forces[step, entry[which]] = -nu / by
        d = free.d + backwards(passed, forces).d
        after = (z + d)[:, entry]
        outside = np.maximum(lower - after, after - upper).ravel() / by
        # Complementarity: a multiplier of its own sign, or the distance to its bound, is zero.
        room = np.where(nu > 0, np.tile(upper, steps), np.tile(lower, steps)) - after.ravel()
        loose = np.minimum(np.abs(nu), np.abs(room) / by)
        off = max(*(float(np.max(part[moves])) for part in (outside, loose)), float(worst[0]))
        return Kept(d, int(np.sum(active[:m] != 0)), off)


def _program(m: int) -> Bound:
    """C, lower, upper -> multipliers, active, status, worst."""
    plain, native = (_least(m, native=native) for native in (False, True))
    return Bound(twin(plain, source=native), matrices={"C"})


def _least(m: int, *, native: bool) -> ca.Function:
    C, lower, upper = (
        ca.MX.sym(n, *s) for n, s in (("C", (m, m)), ("lower", (m, 1)), ("upper", (m, 1)))
    )
    rows = Rows(C, lower, upper, ca.MX.zeros(m) + NONE, ca.MX.ones(m))
    none = ca.MX.zeros(m) + NONE
    found = solved(
        ca.MX(ca.densify(ca.DM.eye(m))), ca.MX.zeros(m), -none, none, rows, ca.MX.zeros(2 * m),
        iterations=4 * m + 20, native=native,
    )  # fmt: skip
    outputs = [found.multipliers[m:], found.active[m:], found.status, found.worst]
    names = ["multipliers", "active", "status", "worst"]
    values = [ca.densify(value) for value in outputs]
    return ca.Function(
        "bounded", [C, lower, upper], values, ["C", "lower", "upper"], names, OPTIONS
    )
