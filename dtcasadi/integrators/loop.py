"""The loop of fixed and adaptive steps: native C where a compiler is present, else its twin.

PI control of the step (Hairer, Wanner II, section IV.2): h_new = h 0.9 err^(-0.7/k) err_old^(0.4/k)
with k the order of the error estimate plus one and err its root mean square over the tolerances.
"""

import ctypes
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import casadi as ca
import numpy as np

from ..bound import Bound
from ..compile import load_library
from ..events import NO_GUARDS, Guards
from .loop_state import LoopState, Stop
from .loop_twin import twin_loop

_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_double, ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_double)
)


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

        Returns:
            Why it stopped, and times (n,) and states (n, n_x) of the accepted steps.
        """
        t_out = np.empty(state.capacity)
        x_out = np.empty((state.capacity, len(x)))
        state.n_guard, state.n_events = len(guard), len(guards.directions)
        if self.library is None:
            step = Bound(self.step)
            why = twin_loop(step, state, command, theta, guard, guards, x, t_out, x_out)
        else:
            why = self._native(state, command, theta, guard, guards, x, t_out, x_out)
        return why, t_out[: state.stored], x_out[: state.stored]

    def _native(
        self,
        state: LoopState,
        command: tuple[np.ndarray, np.ndarray],
        theta: np.ndarray,
        guard: np.ndarray,
        guards: Guards,
        x: np.ndarray,
        t_out: np.ndarray,
        x_out: np.ndarray,
    ) -> Stop:
        sizes = (self.step.sz_arg(), self.step.sz_res(), self.step.sz_iw(), self.step.sz_w())
        pointers = [np.zeros(n, dtype=np.uintp) for n in sizes[:2]]
        work = [np.zeros(sizes[2], dtype=np.int64), np.zeros(sizes[3])]
        n, raised = len(guards.directions), []

        def values_of(t: float, at: Any, values: Any) -> int:
            try:
                now = np.ctypeslib.as_array(at, (len(x),)).copy()
                np.ctypeslib.as_array(values, (n,))[:] = guards.values(t, now)
            except Exception as error:  # C cannot pass it on
                raised.append(error)
            return len(raised)

        callback = _CALLBACK(values_of) if n else _CALLBACK()
        before = [*command, theta, np.ascontiguousarray(guard, dtype=np.int64)]
        after = [guards.directions, np.zeros(3 * n), x, t_out, x_out, *pointers, *work]
        assert self.library is not None
        code = self.library.dtc_integrate(
            ctypes.byref(state), *map(_pointer, before), callback, *map(_pointer, after)
        )
        if raised:
            raise raised[0]
        return Stop(code)


def build_loop(step: ca.Function, fallback: ca.Function) -> Loop:
    """Compile the loop around a step; without a compiler, its twin around `fallback`."""
    source = (files("dtcasadi") / "native" / "adaptive.c").read_text(encoding="utf-8")
    n_x, n_u = step.size1_in("x"), step.size1_in("u")
    library = load_library({"STEP": step}, source, {"N": n_x, "NU": n_u})
    return Loop(fallback if library is None else step, library)


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    # A fifth of the time that `array.ctypes.data` takes, thirteen times a call.
    return ctypes.c_void_p(array.__array_interface__["data"][0])
