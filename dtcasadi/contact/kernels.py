"""The contact kernels as CasADi Functions: hand-written C, or its NumPy twin as a callback."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from ..linear import Factored, native_function
from .detect import Candidates, detect, gaps_of
from .solver import HALVINGS, NEWTON, ROUNDS, SWEEPS, solve_contacts

Shapes = dict[str, tuple[int, int]]
_DETECT = ("R", "r", "S", "V", "H", "POINT", "TAB", "SHAPE", "PLATE", "FRICTION")
_FOUND = ("GAP", "JAC", "MU", "WHO", "FRAME", "PLACE")
_SOLVE, _SOLVED = ("J", "B", "MU", "WHO", "SHARE"), ("P", "DX", "RES")


class _Twin(ca.Callback):
    """A Function of arrays evaluated in Python, for CasADi's virtual machine."""

    def __init__(
        self,
        name: str,
        inputs: tuple[str, ...],
        outputs: tuple[str, ...],
        sizes: Shapes,
        compute: Callable[..., tuple],
    ):
        ca.Callback.__init__(self)
        self._inputs, self._outputs, self._sizes, self._compute = inputs, outputs, sizes, compute
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._sizes[self._inputs[i]])

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._sizes[self._outputs[i]])

    def eval(self, arguments: list) -> list:
        found = self._compute(*(np.array(value) for value in arguments))
        pairs = zip(found, self._outputs, strict=True)
        return [np.reshape(part, self._sizes[name], order="F") for part, name in pairs]


# CasADi does not keep callbacks alive.
_kept: list[_Twin] = []


def _twin(*arguments: object) -> ca.Function:
    _kept.append(_Twin(*arguments))  # type: ignore[arg-type]
    return _kept[-1]


def detection(found: Candidates, n_q: int, *, native: bool) -> Callable[..., list]:
    """(R, r, S, v, h) -> gap, jacobian, friction, who, frame, place of the nearest contacts."""
    sizes, tables = _tables(found, n_q)
    N, m = found.n_discs, found.size

    def compute(R: np.ndarray, r: np.ndarray, S: np.ndarray, v: np.ndarray, h: np.ndarray, *_):  # noqa: ANN202
        near = detect(found, _discs(R), r.T, S.reshape(N, 6, n_q), v.ravel(), float(h[0, 0]))
        frames = near.frame.reshape(m, 9).T
        return near.gap, near.jacobian, near.friction, near.who, frames, near.place.T

    if native:
        sized = {"N": N, "NV": n_q, "M": m, "C": len(found.points), "GIVEN": 0}
        ports = (*_DETECT, "LIST")
        function = native_function("contact_detect", ports, _FOUND, sizes, **sized)
        tables = [*tables, ca.MX(m, 1)]
    else:
        function = _twin("contact_detect", _DETECT, _FOUND, sizes, compute)
    return lambda *state: function.call([*state, *tables])


def gaps(found: Candidates, *, native: bool) -> Callable[[ca.MX, ca.MX, ca.MX], ca.MX]:
    """(R, r, who) -> gaps of contacts found before, shape (m, 1)."""
    sizes, tables = _tables(found, 1)
    N, m = found.n_discs, found.size
    if native:
        # The rest of detection is compiled away.
        sizes |= dict.fromkeys(("S", "V", "JAC", "MU", "WHO", "FRAME", "PLACE"), (1, 1))
        sized = {"N": N, "NV": 0, "M": m, "C": len(found.points), "GIVEN": 1}
        function = native_function("contact_detect", (*_DETECT, "LIST"), _FOUND, sizes, **sized)
        none = ca.MX(1, 1)
        return lambda R, r, who: function.call([R, r, none, none, none, *tables, who])[0]

    def compute(R: np.ndarray, r: np.ndarray, who: np.ndarray) -> tuple:
        return (gaps_of(found, _discs(R), r.T, who.ravel()),)

    twin = _twin("contact_gaps", ("R", "r", "WHO"), ("GAP",), sizes, compute)
    return lambda R, r, who: twin.call([R, r, who])[0]


def _tables(found: Candidates, n_q: int) -> tuple[Shapes, list[ca.MX]]:
    """Sizes of the ports of detection, and the candidates as constants."""
    N, m, C = found.n_discs, found.size, len(found.points)
    sizes: Shapes = {
        **{"R": (3, 3 * N), "r": (3, N), "S": (6 * N, n_q), "V": (n_q, 1), "H": (1, 1)},
        **{"POINT": (3, C), "TAB": (3, C), "FRICTION": (C, 1), "PLATE": (5, N)},
        **{"SHAPE": (16, len(found.shapes)), "GAP": (m, 1), "JAC": (3 * m, n_q), "MU": (m, 1)},
        **{"WHO": (m, 1), "FRAME": (9, m), "PLACE": (3, m), "LIST": (m, 1)},
    }
    tables = [found.points.T, found.table.T, found.shapes.T, found.plates.T, found.friction]
    return sizes, [ca.MX(ca.DM(np.asarray(table, dtype=float))) for table in tables]


def _discs(R: np.ndarray) -> np.ndarray:
    """Rotations side by side, shape (3, 3 N), as (N, 3, 3)."""
    return R.reshape(3, -1, 3).transpose(1, 0, 2)


def solution(m: int, n_q: int, factored: Factored, *, rows: int = 3) -> Callable[..., list]:
    """(J, b, friction, who, share) -> p, W^-1 (J^T; 0) p, and the defect.

    The operator is G = share J W^-1 (J^T; 0).

    Args:
        m: number of contacts.
        n_q: columns of J.
        factored: W, shape (n, n), n >= n_q.
        rows: 3; or 1, which leaves out what is tangential in J, b and p.
    """
    n = factored.size
    sizes: Shapes = {
        **{"W": (n, n), "LU": (n, n), "PIVOT": (n, 1), "J": (3 * m, n_q), "B": (3 * m, 1)},
        **{"MU": (m, 1), "WHO": (m, 1), "SHARE": (1, 1)},
        **{"P": (3 * m, 1), "DX": (n, 1), "RES": (1, 1)},
    }

    def compute(
        W: np.ndarray,
        J: np.ndarray,
        b: np.ndarray,
        mu: np.ndarray,
        who: np.ndarray,
        share: np.ndarray,
    ) -> tuple:
        if rows == 1:
            along = np.tile([1.0, 0.0, 0.0], m)
            J, b, mu = along[:, np.newaxis] * J, along * b.ravel(), 0 * mu
        X = np.linalg.solve(W, np.vstack([J.T, np.zeros((n - n_q, 3 * m))]))
        G = share[0, 0] * J @ X[:n_q]
        p, defect = solve_contacts(G, b.ravel(), mu.ravel(), who.ravel())
        return p, X @ p, defect

    if factored.native:
        bounds = {"M": m, "NV": n_q, "NW": n, "ROUNDS": ROUNDS, "SWEEPS": SWEEPS, "NEWTON": NEWTON}
        bounds |= {"HALVINGS": HALVINGS, "ROWS": rows}
        ports = ("LU", "PIVOT", *_SOLVE)
        function = native_function("contact_solve", ports, _SOLVED, sizes, **bounds)
        return lambda *system: function.call([*factored.factors, *system])
    twin = _twin("contact_solve", ("W", *_SOLVE), _SOLVED, sizes, compute)
    return lambda *system: twin.call([factored.matrix, *system])
