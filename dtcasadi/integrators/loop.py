"""The loop of fixed and adaptive steps: native C where a compiler is present, else its twin here.

PI control of the step (Hairer, Wanner II, section IV.2): h_new = h 0.9 err^(-0.7/k) err_old^(0.4/k)
with k the order of the error estimate plus one and err its root mean square over the tolerances.
"""

import ctypes
from dataclasses import dataclass
from enum import IntEnum
from importlib.resources import files
from typing import Any

import casadi as ca
import numpy as np

from ..bound import Bound
from ..compile import load_library


class Stop(IntEnum):
    """Why a call of the loop returned."""

    AT_END = 0
    FULL = 1
    GUARD = 2
    TOO_SMALL = 3
    NOT_FINITE = 4
    NEWTON = 5


_DOUBLES = (
    *("t", "h", "previous", "t_end", "rtol", "atol", "h_max", "order", "slack_max", "limit"),
    "t_command",
)
_INTEGERS = ("adaptive", "capacity", "n_guard", "stored", "accepted", "rejected", "broken")


class LoopState(ctypes.Structure):
    """The loop's settings and counters, the same memory as `dtc_loop` in C."""

    _fields_ = [(name, ctypes.c_double) for name in _DOUBLES] + [
        (name, ctypes.c_longlong) for name in _INTEGERS
    ]


@dataclass(frozen=True, eq=False)
class Loop:
    """A step ready to be repeated; call `run` until it returns something else than `FULL`.

    Attributes:
        step: x, u, du, h, theta -> x_next, error, slack.
        library: the compiled loop, or None for the twin.
    """

    step: ca.Function
    library: ctypes.CDLL | None

    def run(
        self,
        state: LoopState,
        command: tuple[np.ndarray, np.ndarray],
        theta: np.ndarray,
        guard: np.ndarray,
        x: np.ndarray,
    ) -> tuple[Stop, np.ndarray, np.ndarray]:
        """Advance x in place; at most `state.capacity` steps.

        Args:
            state: settings; time, step and counters are updated.
            command: u at `state.t_command` and its rate du, shape (n_u,) each.
            theta: parameters.
            guard: indices of states that stop the loop when |x[i]| > `state.limit`.
            x: state, shape (n_x,); updated.

        Returns:
            Why it stopped, and times (n,) and states (n, n_x) of the accepted steps.
        """
        t_out = np.empty(state.capacity)
        x_out = np.empty((state.capacity, len(x)))
        if self.library is None:
            why = _twin(Bound(self.step), state, command, theta, guard, x, t_out, x_out)
        else:
            why = self._native(state, command, theta, guard, x, t_out, x_out)
        return why, t_out[: state.stored], x_out[: state.stored]

    def _native(
        self,
        state: LoopState,
        command: tuple[np.ndarray, np.ndarray],
        theta: np.ndarray,
        guard: np.ndarray,
        x: np.ndarray,
        t_out: np.ndarray,
        x_out: np.ndarray,
    ) -> Stop:
        sizes = (self.step.sz_arg(), self.step.sz_res(), self.step.sz_iw(), self.step.sz_w())
        pointers = [np.zeros(n, dtype=np.uintp) for n in sizes[:2]]
        work = [np.zeros(sizes[2], dtype=np.int64), np.zeros(sizes[3])]
        arrays = [*command, theta, guard.astype(np.int64), x, t_out, x_out, *pointers, *work]
        assert self.library is not None
        code = self.library.dtc_integrate(ctypes.byref(state), *(_pointer(a) for a in arrays))
        return Stop(code)


def build_loop(step: ca.Function, fallback: ca.Function) -> Loop:
    """Compile the loop around a step; without a compiler, its twin around `fallback`."""
    source = (files("dtcasadi") / "native" / "adaptive.c").read_text(encoding="utf-8")
    n_x, n_u = step.size1_in("x"), step.size1_in("u")
    library = load_library({"STEP": step}, source, {"N": n_x, "NU": n_u})
    return Loop(fallback if library is None else step, library)


def _pointer(array: np.ndarray) -> Any:
    return ctypes.c_void_p(array.ctypes.data)


def _twin(
    step: Bound,
    s: LoopState,
    command: tuple[np.ndarray, np.ndarray],
    theta: np.ndarray,
    guard: np.ndarray,
    x: np.ndarray,
    t_out: np.ndarray,
    x_out: np.ndarray,
) -> Stop:
    """`native/adaptive.c` line by line."""
    s.stored, after_reject, why = 0, False, Stop.TOO_SMALL
    u, du = command
    while s.t < s.t_end:
        h = min(s.h, s.h_max)
        if s.stored == s.capacity:
            return Stop.FULL
        last = s.t + 1.0000001 * h >= s.t_end
        h = s.t_end - s.t if last else h
        if not last and h < 1e-14 * (abs(s.t) + abs(s.t_end)):
            return why
        x_next, error, slack = step(x, u + du * (s.t - s.t_command), du, h, theta)
        scale = s.atol + s.rtol * np.maximum(np.abs(x), np.abs(x_next))
        with np.errstate(all="ignore"):
            size, total = float(np.sqrt(np.mean((error / scale) ** 2))), float(np.sum(x_next))
        if not np.isfinite(total) or not np.isfinite(size) or not slack[0] <= s.slack_max:
            finite = np.isfinite(total) and np.isfinite(size)
            why = Stop.NEWTON if finite else Stop.NOT_FINITE
            if not s.adaptive:
                return why
            s.h, s.rejected, s.broken, after_reject = 0.25 * h, s.rejected + 1, s.broken + 1, True
            continue
        if s.adaptive and size > 1:
            s.h, s.rejected = h * max(0.9 * size ** (-1 / s.order), 0.2), s.rejected + 1
            after_reject, why = True, Stop.TOO_SMALL
            continue
        if s.adaptive:
            factor = 0.9 * max(size, 1e-10) ** (-0.7 / s.order) * s.previous ** (0.4 / s.order)
            factor = min(max(factor, 0.2), 1.0 if after_reject else 5.0)
            if not last or h * factor < s.h:
                s.h = h * factor
            s.previous = max(size, 1e-4)
        after_reject = False
        s.t = s.t_end if last else s.t + h
        x[:] = x_out[s.stored] = x_next
        t_out[s.stored] = s.t
        s.stored, s.accepted = s.stored + 1, s.accepted + 1
        if len(guard) and np.max(np.abs(x[guard])) > s.limit:
            return Stop.GUARD
    return Stop.AT_END
