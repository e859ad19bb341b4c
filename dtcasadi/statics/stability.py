"""Stability of small motion about rest: M qdd + D qd + K dq = 0.

Follower loads make K unsymmetric, so stability is read from the eigenvalues of the second-order
system, lambda^2 M + lambda D + K (Tisseur, Meerbergen, SIAM Review 43 (2001) 235), not from the
sign of K. A growing real eigenvalue is divergence (buckling, a static loss of stability); a
growing complex pair is flutter.

Eigenvalues have errors that no fixed threshold tells from slow growth: those of a floppy mode are
square roots of round-off. So a mode v counts as growing only where K would have to change by more
than `SIGNIFICANT` of |v|^T |K| |v|, the size of the terms that make up its stiffness.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

# Change of K that decides between growth, rest and decay, of the stiffness in that mode.
SIGNIFICANT = 1e-10
# Where K and D count as symmetric, and D as zero, of their largest entry.
_SYMMETRIC = 1e-10
# Of the fastest eigenvalue: a slower one may be that of a mode without stiffness.
_SLOW = 1e-9
# Errors of an eigenvalue in itself: more need a better solver.
_SPREAD = 1e6
_ROUND_OFF = 1e-14  # of the largest entry of K: a few hundred operations


@dataclass(frozen=True, eq=False)
class Stability:
    """What small motion about an equilibrium does.

    Attributes:
        M, D, K: the linearized system, shape (n_q, n_q) each.
        kind: `stable`: all modes decay, or oscillate where there is no damping; `neutral`: none
            grows, and some have no stiffness; `divergence`; `flutter`. Of several ways to grow,
            the fastest.
        divergent: number of real growing modes.
        fluttering: number of complex pairs that grow.
        loose: whether some mode has no stiffness.
    """

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    kind: str
    divergent: int
    fluttering: int
    loose: bool

    @property
    def stable(self) -> bool:
        """Whether no mode grows."""
        return self.divergent + self.fluttering == 0

    @property
    def growing(self) -> int:
        """Number of eigenvalues that grow, of a complex pair both."""
        return self.divergent + 2 * self.fluttering

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """Roots of det(lambda^2 M + lambda D + K), fastest growing first, shape (2 n_q,) [1/s]."""
        values = scipy.linalg.eigvals(_state_matrix(self.M, self.D, self.K), check_finite=False)
        return values[np.lexsort((values.imag, -values.real))]

    def growth(self, rank: int) -> float:
        """The rank-th largest measure of growth (from 0): a continuous function of M, D, K.

        The real part of an eigenvalue lambda; of a conservative system -omega^2, which tells what
        gives way from what is about to where damping hides it.
        """
        if _is_symmetric(self.K) and _only_takes_energy(self.D):
            return float(-self.squared_frequencies[rank])
        return float(self.eigenvalues[rank].real)

    @property
    def growing_shape(self) -> np.ndarray:
        """Shape of the fastest growing real mode, its largest entry positive, shape (n_q,)."""
        values = self.eigenvalues
        rate = np.max(values.real[np.abs(values.imag) <= 1e-9 * np.abs(values)], initial=0.0)
        shape = _null(rate**2 * self.M + rate * self.D + self.K)[:, 0]
        return shape * np.sign(shape[np.argmax(np.abs(shape))])

    @cached_property
    def _undamped(self) -> tuple[np.ndarray, np.ndarray]:
        """Squares of the frequencies, ascending, and shapes v with K v = omega^2 M v."""
        if _is_symmetric(self.K):
            return _vibrations(self.M, self.K)
        values, shapes = scipy.linalg.eig(self.K, self.M)
        order = np.lexsort((values.imag, values.real))
        shapes = shapes[:, order]
        weights = np.einsum("ij,ik,kj->j", shapes.conj(), self.M, shapes).real
        return values[order], shapes / np.sqrt(weights)

    @property
    def squared_frequencies(self) -> np.ndarray:
        """Eigenvalues omega^2 of K v = omega^2 M v, ascending, shape (n_q,) [1/s^2].

        Negative for a direction that gives way; complex where a follower load makes K unsymmetric
        enough for flutter without damping.
        """
        return self._undamped[0]

    @property
    def frequencies(self) -> np.ndarray:
        """Undamped angular frequencies, ascending, shape (n_q,) [rad/s]; 0 for what gives way."""
        return np.sqrt(np.maximum(np.real(self.squared_frequencies), 0.0))

    @property
    def mode_shapes(self) -> np.ndarray:
        """Columns v with v^* M v = 1 in the order of `frequencies`, shape (n_q, n_q) [rad]."""
        return self._undamped[1]

    @cached_property
    def floppy(self) -> np.ndarray:
        """Directions without stiffness, columns v with v^* M v = 1, shape (n_q, n)."""
        values, shapes = self._undamped
        found = shapes[:, np.abs(values) <= _least(self.K, shapes)]
        return np.real(found)  # the eigenvalue zero is real, so its shape is


def stability(M: np.ndarray, D: np.ndarray, K: np.ndarray) -> Stability:
    """Find out whether small motion about rest grows.

    Args:
        M: mass matrix, symmetric positive definite, shape (n_q, n_q).
        D: damping matrix.
        K: stiffness matrix, of any symmetry.
    """
    if _is_symmetric(K) and _only_takes_energy(D):
        real, pairs, neutral = _conservative(M, K)
    elif _largest(D) <= _SYMMETRIC * np.sqrt(_largest(K) * _largest(M)):
        real, pairs, neutral = _undamped_follower(M, K)
    else:
        real, pairs, neutral = _general(M, D, K)
    if real or pairs:
        kind = "divergence" if max(real, default=0.0) >= max(pairs, default=0.0) else "flutter"
    else:
        kind = "neutral" if neutral else "stable"
    return Stability(M, D, K, kind, len(real), len(pairs), neutral)


def _conservative(M: np.ndarray, K: np.ndarray) -> tuple[list[float], list[float], bool]:
    """Rates of growth of real modes and of pairs, and whether a mode has no stiffness.

    With symmetric K and a damping that only takes energy, the sign of omega^2 decides (theorem of
    Kelvin, Tait and Chetaev).
    """
    values, shapes = _vibrations(M, K)
    least = _least(K, shapes)
    growing = values[values < -least]
    return list(np.sqrt(-growing)), [], bool(np.any(np.abs(values) <= least))


def _vibrations(M: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues omega^2 of symmetric K, ascending, and shapes with v^T M v = 1.

    The solver's error is round-off of the largest omega^2, which in a slender robot that hardly
    shears is 1e16 times the least. The small ones are then taken from the inverse problem
    M v = (K + shift M) v / (omega^2 + shift), whose error is round-off of the least.
    """
    K = (K + K.T) / 2
    values, shapes = scipy.linalg.eigh(K, M, check_finite=False)
    error = len(values) * np.finfo(float).eps * np.abs(values).max()
    if np.abs(values).min() > _SPREAD * error:
        return values, shapes
    shift = 2 * (np.abs(values[0]) + error)
    try:
        inverse, turned = scipy.linalg.eigh(M, K + shift * M, check_finite=False)
    except np.linalg.LinAlgError:  # stiffness and inertia both vanish along some direction
        return values, shapes
    small = (values + shift) ** 2 < np.abs(values).max() * shift
    inverse, turned = inverse[::-1][small], turned[:, ::-1][:, small]
    values[small] = 1 / inverse - shift
    shapes[:, small] = turned / np.sqrt(inverse)
    return values, shapes


def _undamped_follower(M: np.ndarray, K: np.ndarray) -> tuple[list[float], list[float], bool]:
    """The same without damping: lambda^2 = -omega^2, which grows unless omega^2 is positive."""
    values, shapes = scipy.linalg.eig(K, M, check_finite=False)
    weights = np.einsum("ij,ik,kj->j", shapes.conj(), M, shapes).real
    least = _least(K, shapes) / weights
    rates = np.sqrt(-values).real
    pairs = values.imag > least
    real = (values.real < -least) & (np.abs(values.imag) <= least)
    return list(rates[real]), list(rates[pairs]), bool(np.any(np.abs(values) <= least))


def _general(M: np.ndarray, D: np.ndarray, K: np.ndarray) -> tuple[list[float], list[float], bool]:
    """The same from the eigenvalues of the state matrix, each doubtful one with its shape."""
    values = np.linalg.eigvals(_state_matrix(M, D, K))
    sizes = np.abs(values)
    doubtful = (values.real > 0) | (sizes <= _SLOW * sizes.max())
    real: list[float] = []
    pairs: list[float] = []
    neutral = False
    for value in values[doubtful & (values.imag >= 0)]:
        shape = _null(value**2 * M + value * D + K)
        inertia, damping = (np.vdot(shape, matrix @ shape) for matrix in (M, D))
        # How far K has to move to bring the eigenvalue to the imaginary axis, along this shape.
        change = abs((value**2 + value.imag**2) * inertia + value.real * damping)
        least = _least(K, shape)[0]
        if value.real > 0 and change > least:
            (pairs if value.imag > 0 else real).append(float(value.real))
        elif abs(np.vdot(shape, K @ shape)) <= least:
            neutral = True
    return real, pairs, neutral


def _null(matrix: np.ndarray) -> np.ndarray:
    """The direction that a matrix shrinks most, shape (n, 1)."""
    return np.linalg.svd(matrix)[2][-1:].conj().T


def _least(K: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Below this a shape has no stiffness: a share of |v|^T |K| |v|, and round-off of K."""
    size = np.abs(shapes)
    terms = np.einsum("ij,ik,kj->j", size, np.abs(K), size)
    return SIGNIFICANT * terms + _ROUND_OFF * _largest(K) * np.sum(size**2, axis=0)


def _state_matrix(M: np.ndarray, D: np.ndarray, K: np.ndarray) -> np.ndarray:
    """The matrix of d/dt (dq, qd)."""
    n = len(M)
    state = np.zeros((2 * n, 2 * n))
    state[:n, n:] = np.eye(n)
    state[n:] = np.linalg.solve(M, np.hstack([-K, -D]))
    return state


def _is_symmetric(matrix: np.ndarray) -> bool:
    return _largest(matrix - matrix.T) <= _SYMMETRIC * _largest(matrix)


def _largest(matrix: np.ndarray) -> float:
    return float(np.abs(matrix).max())


def _only_takes_energy(D: np.ndarray) -> bool:
    if not _is_symmetric(D):
        return False
    rates = np.linalg.eigvalsh(D)
    return bool(rates[0] >= -_SYMMETRIC * rates[-1])
