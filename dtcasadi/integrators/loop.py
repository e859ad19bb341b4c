"""The loop of fixed and adaptive steps: native C where a compiler is present, else its twin.

PI control of the step (Hairer, Wanner II, section IV.2): h_new = h 0.9 err^(-0.7/k) err_old^(0.4/k)
with k the order of the error estimate plus one and err its root mean square over the tolerances.
"""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import casadi as ca
import numpy as np

from ..bound import Bound
from ..compile import DEFAULT_FLAGS, load_library
from ..events import NO_GUARDS, Guards
from .loop_state import LoopState, Stop
from .loop_twin import twin_loop

_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_double, ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_double)
)
_NO_CALLBACK = _CALLBACK()
# Stretches between two looks of `auto` differ in length; room for most of them is made once.
_LEAST_ROOM = 512


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
        guards: Guards = NO_GUARDS,
        work: "Work | None" = None,
    ) -> tuple[Stop, np.ndarray, np.ndarray]:
        """Advance x in place; at most `state.capacity` steps.

        Args:
            state: settings; time, step and counters are updated.
            command: u at `state.t_command` and its rate du, shape (n_u,) each.
            theta: parameters.
            guard: states that stop the loop, rows (index, `Watched`): when |x[i]| > `state.limit`,
                or when |sin x[i]| or |cos x[i]| < `state.near`; shape (m, 2).
            x: state, shape (n_x,); updated.
            guards: functions whose sign changes stop the loop just behind the change;
                `state.event` is the one that did.
            work: buffers of an earlier call, of this loop and thread.

        Returns:
            Why it stopped, and times (n,) and states (n, n_x) of the accepted steps; with `work`,
            the next call overwrites them.
        """
        work = self.work(len(x)) if work is None else work
        t_out, x_out = work.outputs(state.capacity)
        state.n_guard, state.n_events = len(guard), len(guards.directions)
        if self.library is None:
            step = Bound(self.step)
            why = twin_loop(step, state, command, theta, guard, guards, x, t_out, x_out)
        else:
            why = self._native(state, command, theta, guard, guards, x, work)
        return why, t_out[: state.stored], x_out[: state.stored]

    def work(self, n_x: int) -> "Work":
        """Buffers for many calls of `run` in one thread."""
        sizes = (self.step.sz_arg(), self.step.sz_res(), self.step.sz_iw(), self.step.sz_w())
        pointers = [np.zeros(n, dtype=np.uintp) for n in sizes[:2]]
        return Work(n_x, (*pointers, np.zeros(sizes[2], dtype=np.int64), np.zeros(sizes[3])))

    def _native(
        self,
        state: LoopState,
        command: tuple[np.ndarray, np.ndarray],
        theta: np.ndarray,
        guard: np.ndarray,
        guards: Guards,
        x: np.ndarray,
        work: "Work",
    ) -> Stop:
        n, raised = len(guards.directions), []

        def values_of(t: float, at: Any, values: Any) -> int:
            try:
                now = np.ctypeslib.as_array(at, (len(x),)).copy()
                np.ctypeslib.as_array(values, (n,))[:] = guards.values(t, now)
            except Exception as error:  # C cannot pass it on
                raised.append(error)
            return len(raised)

        callback = _CALLBACK(values_of) if n else _NO_CALLBACK
        before = [*command, theta, np.ascontiguousarray(guard, dtype=np.int64)]
        events = [guards.directions, np.zeros(3 * n)]
        assert self.library is not None
        code = self.library.dtc_integrate(
            ctypes.byref(state),
            *map(_pointer, before),
            callback,
            *map(_pointer, events),
            _pointer(x),
            *work.pointers,
        )
        if raised:
            raise raised[0]
        return Stop(code)


class Work:
    """Buffers of a loop's calls in one thread: outputs, and what the generated step works in."""

    def __init__(self, n_x: int, scratch: tuple[np.ndarray, ...]):
        self._n_x, self._scratch, self._capacity = n_x, scratch, 0

    def outputs(self, capacity: int) -> tuple[np.ndarray, np.ndarray]:
        """Room for the times and states of so many steps."""
        if capacity > self._capacity:
            self._capacity = capacity = max(capacity, _LEAST_ROOM)
            self._t, self._x = np.empty(capacity), np.empty((capacity, self._n_x))
            self.pointers = [_pointer(array) for array in (self._t, self._x, *self._scratch)]
        return self._t, self._x


def build_loop(
    step: ca.Function, fallback: Callable[[], ca.Function], flags: Sequence[str] = DEFAULT_FLAGS
) -> Loop:
    """Compile the loop around a step; without a compiler, its twin around another, built then."""
    source = (files("dtcasadi") / "native" / "adaptive.c").read_text(encoding="utf-8")
    n_x, n_u = step.size1_in("x"), step.size1_in("u")
    library = load_library({"STEP": step}, source, {"N": n_x, "NU": n_u}, flags)
    return Loop(fallback() if library is None else step, library)


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    # A fifth of the time that `array.ctypes.data` takes, thirteen times a call.
    return ctypes.c_void_p(array.__array_interface__["data"][0])
