"""The search for an equilibrium: native C where a compiler is present, else its twin here.

Newton's method on residual(q, s) = 0 with the exact stiffness K, under one linear constraint
normal . dq + weight ds = 0 (weight alone: s stays). Two ways to come from afar:

`SETTLE` goes where the forces push. The step solves (K + shift M) dq = -residual, pseudo-transient
continuation (Kelley, Keyes, SIAM J. Numer. Anal. 35 (1998) 508): linearly implicit Euler on
M dq/dt = -residual, and Newton's method for shift -> 0. The shift grows until dq goes along the
forces; dq is cut to `reach` and where the forces turn against it. Forces need no potential.
`NEAREST` is Newton's method that backtracks until the residual falls: stable or not.

K carries `GROUND` of the largest stiffness on its diagonal in each step, so directions without
stiffness (floppy modes) get no step instead of an infinite one.
"""

import ctypes
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from importlib.resources import files
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..bound import Bound
from ..compile import load_library
from ..contact.detect import candidates_of
from ..errors import StaticsError
from ..kernels.recentring import absorbed
from ..model import Model
from ..recentring import LIMIT, chart_limit, off_centre
from .balance import balance, newton
from .loads import LoadPath

# Imbalance over the loads that are there, before the last Newton step.
RTOL = 1e-10
# Imbalance over the largest stiffness: round-off of the forces, a pose error of this many radians.
FLOOR = 1e-13
# Softer than this, of the largest stiffness, is taken for floppy; it slows Newton's method there.
GROUND = 1e-11
# Longest step in one coordinate [rad].
REACH = 0.5


class Why(IntEnum):
    """Why a search returned."""

    FOUND = 0
    MOST = 1
    STUCK = 2
    NOT_FINITE = 3
    SINGULAR = 4


class Mode(IntEnum):
    """How to come from afar."""

    NEAREST = 0
    SETTLE = 1


_DOUBLES = (
    *("rtol", "floor", "reach", "limit", "s", "weight"),
    *("shift", "ground", "residual", "load"),
)
_INTEGERS = ("mode", "most", "n_centres", "iterations", "evaluations", "recentrings")


class SearchState(ctypes.Structure):
    """Settings and counters, the same memory as `dtc_search` in C."""

    _fields_ = [(name, ctypes.c_double) for name in _DOUBLES] + [
        (name, ctypes.c_longlong) for name in _INTEGERS
    ]


class Found(NamedTuple):
    """Where a search ended; everything belongs to q, s and theta, which re-centring may change."""

    why: Why
    q: np.ndarray
    theta: np.ndarray
    s: float
    residual: float
    load: float
    K: np.ndarray
    M: np.ndarray
    D: np.ndarray
    slope: np.ndarray
    iterations: int
    evaluations: int
    recentrings: int


_INPUTS = ("pressure", "tau", "d_pressure", "d_tau", "d_theta", "normal")
_OUTPUTS = ("q", "theta", "F", "K", "M", "D", "slope")


@dataclass(frozen=True, eq=False)
class Search:
    """The search of one model.

    Attributes:
        model: the model.
        compiled: `balance`, `newton` and `absorbed`, of the library.
        library: the compiled search, or None.
    """

    model: Model
    compiled: tuple[ca.Function, ...]
    library: ctypes.CDLL | None

    def run(
        self,
        path: LoadPath,
        q: np.ndarray,
        s: float = 0.0,
        *,
        mode: Mode = Mode.SETTLE,
        normal: np.ndarray | None = None,
        weight: float = 1.0,
        most: int = 200,
        reach: float = REACH,
    ) -> Found:
        """Search from (q, s); without a `normal` s stays and charts re-centre on the way."""
        n = self.model.n_q
        state = SearchState(
            rtol=RTOL,
            floor=FLOOR,
            reach=reach,
            limit=LIMIT,
            s=s,
            weight=weight,
            mode=mode,
            most=most,
            n_centres=len(self.model.centres) if normal is None else 0,
        )
        values = {name: getattr(path, name) for name in (*_INPUTS[:5], "theta")}
        values |= {"q": q, "normal": np.zeros(n) if normal is None else normal}
        search = self._twin if self.library is None else self._native
        why, out = search(state, values)
        if why is Why.FOUND and chart_limit(self.model, out["q"]):
            why = Why.SINGULAR  # rates and stability mean nothing there
        return Found(
            why=why,
            q=out["q"],
            theta=out["theta"],
            s=state.s,
            residual=state.residual,
            load=state.load,
            K=out["K"],
            M=out["M"],
            D=out["D"],
            slope=out["slope"],
            iterations=state.iterations,
            evaluations=state.evaluations,
            recentrings=state.recentrings,
        )

    @cached_property
    def function(self) -> ca.Function:
        """`balance` as CasADi's virtual machine runs it, for the twin."""
        return balance(self.model.graphs[1])

    @cached_property
    def _layout(self) -> tuple[dict[str, tuple[int, int]], int, tuple[int, ...], np.ndarray]:
        """Places of the buffers in one array, its size; sz_arg, sz_res, sz_iw, centres."""
        n, n_u, n_theta = self.model.n_q, self.model.n_u, len(self.model.theta0)
        sizes = {"pressure": n_u, "d_pressure": n_u, "theta": n_theta, "d_theta": n_theta}
        sizes |= {"K": n * n, "M": n * n, "D": n * n}
        sizes["work"] = max(f.sz_w() for f in self.compiled)
        places, at = {}, 0
        for name in (*_INPUTS, *_OUTPUTS, "work"):
            size = sizes.get(name, n)
            places[name] = (at, at + size)
            at += size
        counts = tuple(
            max(getattr(f, name)() for f in self.compiled) for name in ("sz_arg", "sz_res", "sz_iw")
        )
        centres = [(place.q.start, place.frames.start) for place in self.model.centres]
        return places, at, counts, np.array(centres, dtype=np.int64).ravel()

    def _native(self, state: SearchState, values: dict) -> tuple[Why, dict]:
        places, size, counts, centres = self._layout
        block, words = np.zeros(size), np.zeros(sum(counts) + 1, dtype=np.int64)
        view = {name: block[a:b] for name, (a, b) in places.items()}
        for name, value in values.items():
            view[name][:] = value
        start, word = block.ctypes.data, words.ctypes.data
        doubles = [start + 8 * places[name][0] for name in (*_INPUTS, *_OUTPUTS)]
        offsets = (0, counts[0], counts[0] + counts[1])
        pointers = [*doubles, centres.ctypes.data, *(word + 8 * k for k in offsets)]
        pointers.append(start + 8 * places["work"][0])
        assert self.library is not None
        search = self.library.dtc_find
        code = search(ctypes.byref(state), *map(ctypes.c_void_p, pointers))
        return Why(code), self._shaped(view)

    def _shaped(self, view: dict) -> dict:
        n = self.model.n_q
        for name in ("K", "M", "D"):
            view[name] = view[name].reshape(n, n, order="F")
        return view

    def _twin(self, state: SearchState, values: dict) -> tuple[Why, dict]:
        twin = _Twin(self.model, Bound(self.function, matrices=("K", "M", "D")), state, values)
        why = twin.search()
        out = twin.bound.outputs
        matrices = {name: getattr(out, name).copy() for name in ("K", "M", "D", "slope")}
        return why, {"q": twin.q, "theta": twin.theta, **matrices}


class _Twin:
    """`native/find.c` function by function."""

    def __init__(self, model: Model, bound: Bound, state: SearchState, values: dict):
        self.model, self.bound, self.s, self.normal = model, bound, state, values["normal"]
        self.q, self.theta = np.array(values["q"]), np.array(values["theta"])
        for name in _INPUTS[:5]:
            getattr(bound.inputs, name)[:] = values[name]

    def evaluate(self, q: np.ndarray, at: float) -> None:
        ports, out = self.bound.inputs, self.bound.outputs
        ports.q[:], ports.s[:], ports.theta[:] = q, at, self.theta
        self.bound.run()
        self.F = out.residual.copy()
        self.s.load, self.s.residual = out.load[0], np.max(np.abs(self.F))
        self.s.evaluations += 1

    def newton(self) -> tuple[np.ndarray, float]:
        out = self.bound.outputs
        ground = self.s.ground * np.eye(len(self.F))
        top = np.column_stack([out.K + self.s.shift * out.M + ground, out.slope])
        matrix = np.vstack([top, np.append(self.normal, self.s.weight)])
        try:
            solution = np.linalg.solve(matrix, np.append(-self.F, 0.0))
        except np.linalg.LinAlgError:
            solution = np.full(len(self.F) + 1, np.nan)
        return solution[:-1], float(solution[-1])

    def direction(self, ratio: float) -> tuple[np.ndarray, float, float]:
        s = self.s
        for _ in range(60):
            dq, ds = self.newton()
            work = float(-self.F @ dq)
            if np.isfinite(ds) and np.max(np.abs(dq)) < 1e3 * s.reach:
                if s.mode == Mode.NEAREST or work > 0.01 * np.sqrt((self.F @ self.F) * (dq @ dq)):
                    return dq, ds, work
            s.shift = max(4 * s.shift, 1e-3 * ratio)
        return dq, ds, np.nan

    def advance(self, dq: np.ndarray, ds: float, work: float) -> bool:
        s, size = self.s, self.F @ self.F
        t = min(1.0, s.reach / np.max(np.abs(dq)))
        for _ in range(30):
            step = self.q + t * dq
            self.evaluate(step, s.s + t * ds)
            factor = 0.5
            if s.mode == Mode.SETTLE:
                after = float(-self.F @ dq)
                good = after >= -0.5 * work
                if np.isfinite(after) and not good:
                    factor = max(0.1, work / (work - after))
            else:
                good = bool(self.F @ self.F <= (1 - 1e-4 * t) * size)
            if good:
                self.q, s.s = step, s.s + t * ds
                return True
            t *= factor
        return False

    def polish(self) -> None:
        s, before = self.s, self.s.residual
        dq, ds = self.newton()
        if not (np.max(np.abs(dq)) < 1e-3 and np.isfinite(ds)):
            return
        for sign in (1, -1):
            self.q, s.s = self.q + sign * dq, s.s + sign * ds
            self.evaluate(self.q, s.s)
            if s.residual <= 2 * before:
                return

    def recentre(self) -> bool:
        x = np.concatenate([self.q, np.zeros(self.model.n_x - self.model.n_q)])
        off = off_centre(self.model, x) if self.s.n_centres else ()
        if off:
            x, self.theta, _ = self.model.recentre(x, self.theta)
            self.q = x[: self.model.n_q]
            self.s.recentrings += len(off)
        return bool(off)

    def search(self) -> Why:
        s, out = self.s, self.bound.outputs
        with np.errstate(all="ignore"):
            self.evaluate(self.q, s.s)
            while True:
                stiffness, inertia = np.max(np.abs(out.K)), np.max(np.abs(np.diag(out.M)))
                ratio = stiffness / inertia if stiffness > 0 and inertia > 0 else 1.0
                if not (np.isfinite(s.residual) and np.isfinite(stiffness)):
                    return Why.NOT_FINITE
                s.ground = GROUND * stiffness
                if s.residual <= s.rtol * s.load + s.floor * stiffness:
                    s.shift = 0.0
                    self.polish()
                    return Why.FOUND
                if s.iterations >= s.most:
                    return Why.MOST
                dq, ds, work = self.direction(ratio)
                if np.isnan(work) or not self.advance(dq, ds, work):
                    return Why.STUCK
                s.shift *= 0.1
                if self.recentre():
                    self.evaluate(self.q, s.s)
                s.iterations += 1


def search_of(model: Model) -> Search:
    """The search of a model, compiled on first use and kept with it.

    Raises:
        StaticsError: the robot has constraints, whose multipliers it knows nothing of.
    """
    if model.robot.constraints:
        got = len(model.robot.constraints)
        raise StaticsError(f"model: expected a robot without constraints, got {got}")
    if candidates_of(model.robot) is not None:
        raise StaticsError(
            "model: expected compliant contact, got rigid obstacles or plates; give the obstacles "
            "a penetration"
        )

    def build() -> Search:
        native = model.graphs[0]
        functions = {"BALANCE": balance(native), "NEWTON": newton(native), "ABSORB": absorbed()}
        source = (files("dtcasadi") / "native" / "find.c").read_text(encoding="utf-8")
        constants = {"N": model.n_q, "GROUND": GROUND}
        library = load_library(functions, source, constants, model.flags)
        return Search(model, tuple(functions.values()), library)

    return model.once("search", build)


def virtual_search(model: Model) -> Search:
    """The search of a model in CasADi's virtual machine: nothing to compile, slower to run.

    Of a model that is asked a few questions only; must come before its first equilibrium.
    """
    return model.once("search", lambda: Search(model, (), None))
