"""What every filter estimates, x and blocks of theta, and its process noise: checked, laid out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dtcasadi import checks
from dtcasadi.waist import Discrete

from .base import Estimate, ProcessNoise, refusal, symmetric


class Layout(NamedTuple):
    """z = (x; the estimated entries of theta).

    Attributes:
        names: one name for each entry, shape (n_z,).
        n_x: number of states.
        free: entries of theta that are estimated.
    """

    names: tuple[str, ...]
    n_x: int
    free: tuple[int, ...]

    @property
    def n_z(self) -> int:
        """Number of estimated numbers."""
        return len(self.names)


def layout_of(discrete: Discrete, augment: Sequence[str]) -> Layout:
    """The layout with some blocks of theta besides x.

    Raises:
        EstimationError: unknown or repeated names.
    """
    known = [name for name in discrete.theta_blocks if name != "frames"]
    if isinstance(augment, str) or len(set(augment)) != len(tuple(augment)):
        raise refusal("augment", "a list of different names", checks.shown(augment))
    for name in augment:
        if name not in known:
            raise refusal("augment", f"names out of {', '.join(known) or 'none'}", repr(name))
    blocks = [(name, discrete.theta_blocks[name]) for name in augment]
    theta_names = [f"{name}[{k + 1}]" for name, b in blocks for k in range(b.stop - b.start)]
    free = [k for _, block in blocks for k in range(block.start, block.stop)]
    names = (*discrete.state_names, *theta_names)
    return Layout(names, len(discrete.state_names), tuple(free))


def start_of(
    discrete: Discrete, layout: Layout, x0: Any, P0: Any, theta: np.ndarray | None
) -> Estimate:
    """The estimate at the beginning; theta: the model's own by default.

    Raises:
        EstimationError: a wrong shape, or not a covariance.
    """
    theta = discrete.theta0 if theta is None else theta
    return Estimate(
        x=checks.array("x0", x0, (layout.n_x,), error=refusal),
        P=widened("P0", P0, layout),
        theta=checks.array("theta", theta, discrete.theta0.shape, error=refusal),
    )


def noise_of(
    discrete: Discrete, layout: Layout, augment: Sequence[str], Q_w: Any
) -> tuple[np.ndarray, ProcessNoise | None]:
    """The share of the process noise that does not depend on the state, and the rest.

    Args:
        discrete: the model.
        layout: what is estimated.
        augment: names of the estimated blocks.
        Q_w: `ProcessNoise`, or the covariance in a step or its diagonal, of x or of all of z.

    Returns:
        Q, shape (n_z, n_z), and the physical noise if Q_w is one.

    Raises:
        EstimationError: it cannot be used.
    """
    if not isinstance(Q_w, ProcessNoise):
        return widened("Q_w", Q_w, layout), None
    if (Q_w.force or Q_w.moment) and "wrench" not in discrete.theta_blocks:
        expected = "a model built with wrenches=(...) for noise of forces on discs"
        raise refusal("Q_w", expected, "one without")
    for name in Q_w.walk:
        if name not in augment:
            raise refusal("Q_w.walk", "blocks named in augment", repr(name))
    parts = [_spread("Q_w.state", Q_w.state, layout.n_x)]
    for name in augment:
        block = discrete.theta_blocks[name]
        walk, size = Q_w.walk.get(name, 0.0), block.stop - block.start
        parts.append(_spread(f"Q_w.walk[{name!r}]", walk, size))
    return np.diag(np.concatenate(parts) ** 2) * discrete.step_s, Q_w


def pushed_by(discrete: Discrete, noise: ProcessNoise | None) -> tuple[np.ndarray, tuple[int, ...]]:
    """Deviation, held over a step, of each entry of theta that noise acts through, and these."""
    if noise is None or not (noise.force or noise.moment):
        return np.zeros(0), ()
    block = discrete.theta_blocks["wrench"]
    pair = np.repeat([noise.force, noise.moment], 3) / np.sqrt(discrete.step_s)
    every = np.tile(pair, (block.stop - block.start) // 6)
    entries = np.arange(block.start, block.stop)[every > 0]
    return every[every > 0], tuple(entries.tolist())


def widened(name: str, value: Any, layout: Layout) -> np.ndarray:
    """A covariance of all of z, from one of x or of all.

    Raises:
        EstimationError: a wrong shape, or not a covariance.
    """
    if isinstance(value, ProcessNoise):
        raise refusal(name, "a matrix or its diagonal", "a ProcessNoise")
    n = layout.n_z if np.shape(value)[:1] == (layout.n_z,) else layout.n_x
    P = np.zeros((layout.n_z, layout.n_z))
    P[:n, :n] = symmetric(name, value, n, definite=False)
    return P


def _spread(name: str, value: Any, n: int) -> np.ndarray:
    """One number for all, or one for each."""
    if np.ndim(value) == 0:
        return np.full(n, checks.number(name, value, nonnegative=True, error=refusal))
    return checks.array(name, value, (n,), error=refusal)
