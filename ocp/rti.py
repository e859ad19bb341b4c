r"""The real-time iteration as graphs: one Gauss-Newton step on a horizon that moves on.

Preparation rolls the model out from a state under the commands of the last plan, shifted by an
interval and held over blocks, linearizes it and its outputs, and condenses: with z the change of
the commands v of the blocks, in shares of their ranges,

.. math:: x_k \approx \bar x_k + \Phi_k (x_0 - \bar x_0) + S_k z

Feedback puts in the state as estimated and solves the quadratic program in z (Diehl, Bock and
Schloeder, SIAM J. Control Optim. 43(5), 2005). Everything has a fixed size; only the changes of the
program's active set vary, up to a budget. A step from where the preparation began loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from dtcasadi.condensing import condensed, response
from dtcasadi.quadratic import NONE, Rows, solved

from .slopes import inside, ranges
from .stages import Stages

OPTIONS = {"cse": True}
# Squares above this overflow soon; what is not a number fails the comparison.
_HUGE = 1e300
# Share of the mean curvature added to each: a command without effect or price stays as it was.
_FLOOR = 1e-14


class Prepared(NamedTuple):
    """What the feedback phase needs: rollout, linearization, and the condensed problem.

    A (n_x, n_x N), x (n_x, N + 1) the rollout, r (n_r, N) and R (n_r, n_x N) residuals, g (n_g, N)
    and G (n_g, n_x N) limits of states 1 ... N, H (n_v, n_v), J (n_v, n_r N), C (n_v, n_g N),
    S (n_x, n_v), v (n_v,) the commands of the blocks rolled out, failed: steps that failed.
    """

    A: ca.MX
    B: ca.MX
    x: ca.MX
    r: ca.MX
    R: ca.MX
    g: ca.MX
    G: ca.MX
    H: ca.MX
    J: ca.MX
    C: ca.MX
    S: ca.MX
    v: ca.MX
    failed: ca.MX


class Feedback(NamedTuple):
    """Commands (n_u, N), states (n_x, N + 1), the active set, and the program's own report."""

    u: ca.MX
    x: ca.MX
    active: ca.MX
    status: ca.MX
    iterations: ca.MX
    violation: ca.MX


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is asked for: references (n_r, N + 1), target (n_x + n_u,), P of the terminal cost."""

    reference: ca.MX
    target: ca.MX
    P: ca.MX


@dataclass(frozen=True, eq=False)
class Iteration:
    """The real-time iteration of a problem on its model.

    Attributes:
        stages: the problem on its model.
        iterations: most changes of the quadratic program's active set.
    """

    stages: Stages
    iterations: int

    @cached_property
    def first(self) -> np.ndarray:
        """First interval of each block."""
        return np.unique(self.stages.block_of, return_index=True)[1]

    @property
    def n_v(self) -> int:
        """Number of decision variables."""
        return len(self.first) * self.stages.n_u

    @cached_property
    def scale(self) -> np.ndarray:
        """Range of each command, 1 where it has none [Pa]."""
        return ranges(self.stages)

    @cached_property
    def rated(self) -> bool:
        """Whether any command has a rate limit."""
        return bool(np.any(np.isfinite(self.stages.rate)))

    @property
    def n_active(self) -> int:
        """Length of the active set: bounds of v, rate limits between blocks, soft limits."""
        between = (len(self.first) - 1) * self.stages.n_u if self.rated else 0
        return self.n_v + between + len(self.stages.limits) * self.stages.horizon

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Limits of v, the narrowest of each block's intervals, shape (n_blocks, n_u) each."""
        s = self.stages
        return np.maximum.reduceat(s.lower, self.first), np.minimum.reduceat(s.upper, self.first)

    def prepared(
        self, x: ca.MX, theta: ca.MX, plan: ca.MX, wanted: Wanted, *, native: bool
    ) -> Prepared:
        """Roll out from x under a plan (n_u, N), linearize and condense."""
        s = self.stages
        blocks = [int(block) for block in s.block_of]
        lower, upper = (_bounded(side.T) for side in self.bounds())
        v = ca.fmin(ca.fmax(plan[:, [int(k) for k in self.first]], lower), upper)
        v = inside(s, v)
        stage, states, found = self._stage(native), [x], []
        for k, block in enumerate(blocks):
            found.append(stage(states[-1], v[:, block], theta, wanted.reference[:, k + 1]))
            states.append(found[-1][0])
        _, A, B, status, r, R, g, G = (ca.horzcat(*part) for part in zip(*found, strict=True))
        # Derivatives for shares of the ranges.
        B = B * ca.DM(np.tile(self.scale, (s.n_x, s.horizon)))
        by = np.concatenate([np.ones(s.n_x), self.scale])
        P = wanted.P * ca.DM(np.outer(by, by))
        weight = ca.MX(ca.DM(s.weight[1:].T))
        whole = condensed(A, B, R, G, weight, P, blocks, native=native)
        H = whole.H + ca.DM(self._effort())
        H = H + ca.MX.eye(self.n_v) * (_FLOOR * ca.trace(H) / self.n_v + 1 / NONE)
        failed = ca.sum2(1 - (status <= 0))
        rolled = ca.horzcat(*states)
        return Prepared(
            *(A, B, rolled, r, R, g, G, H, whole.J, whole.C, whole.S, ca.vec(v), failed)
        )

    def feedback(
        self,
        p: Prepared,
        dx: ca.MX | None,
        last: ca.MX,
        wanted: Wanted,
        warm: ca.MX,
        *,
        native: bool,
    ) -> Feedback:
        """Solve for a state that differs by dx (None: not at all) from the preparation's.

        Args:
            p: the preparation.
            dx: shape (n_x,).
            last: the command in force, shape (n_u,).
            wanted: as in the preparation.
            warm: active set to start with, shape (n_active,).
            native: whether C kernels may be embedded.
        """
        s, N = self.stages, self.stages.horizon
        r, g, x = p.r, p.g, p.x
        gap = ca.MX.zeros(s.n_x, N)
        if dx is not None:
            free = response(p.A, p.B, gap, dx, ca.MX.zeros(s.n_u, N), native=native)
            x = x + free
            r = r + _by_state(p.R, free, N)
            g = g + _by_state(p.G, free, N)
        gradient = ca.mtimes(p.J, ca.vec(ca.DM(s.weight[1:].T) * r)) if s.channels else 0
        gradient = gradient + self._effort_slope(p.v, last, wanted.target[s.n_x :])
        ahead = ca.vertcat(x[:, N], p.v[self.n_v - s.n_u :]) - wanted.target
        pull = ca.mtimes(wanted.P, ahead)
        gradient = gradient + ca.mtimes(p.S.T, pull[: s.n_x])
        gradient[self.n_v - s.n_u :] += self.scale * pull[s.n_x :]
        lower, upper, rows = self._limits(p, g, last)
        found = solved(
            p.H, gradient, lower, upper, rows, warm, iterations=self.iterations, native=native
        )
        change = ca.reshape(found.z, s.n_u, len(self.first))[:, [int(b) for b in s.block_of]]
        base = ca.reshape(p.v, s.n_u, len(self.first))[:, [int(b) for b in s.block_of]]
        u = self.kept(base + ca.repmat(ca.DM(self.scale), 1, N) * change, last)
        # B is for shares of the ranges; the commands as kept within the limits.
        moved = (u - base) / ca.repmat(ca.DM(self.scale), 1, N)
        none = ca.MX.zeros(s.n_x, 1)
        x = x + response(p.A, p.B, gap, none, moved, native=native)
        return Feedback(u, x, found.active, found.status, found.iterations, found.worst)

    def kept(self, u: ca.MX, last: ca.MX) -> ca.MX:
        """Commands (n_u, N) cut to limits and rate limits one after the other, from `last`.

        A value that is no number becomes a limit.
        """
        s, result = self.stages, []
        for k in range(u.shape[1]):
            lower, upper = (_bounded(side[k]) for side in (s.lower, s.upper))
            rate = _bounded(s.rate[k])
            low, high = ca.fmax(lower, last - rate), ca.fmin(upper, last + rate)
            last = ca.fmin(ca.fmax(u[:, k], low), high)
            result.append(last)
        return ca.horzcat(*result)

    def _stage(self, native: bool) -> ca.Function:
        """x, u, theta, reference -> x_next, F_x, F_u, status, and r, R_x, g, G_x at x_next."""
        s = self.stages
        sizes = (s.n_x, s.n_u, len(s.discrete.theta0), len(s.channels))
        x, u, theta, reference = ports = [ca.MX.sym("at", size) for size in sizes]
        name = "linearize_checked"
        step = s.discrete.native(name) if native else s.discrete.linearize_checked
        # Inlined, so that the derivatives for theta are not computed.
        x_next, F_x, F_u, _, status = step.call([x, u, theta], True, False)
        outputs = (s.native if native else s.linearize)(x_next, theta, reference)
        values = [x_next, F_x, F_u, status, *outputs]
        return ca.Function("stage", ports, [ca.densify(value) for value in values], OPTIONS)

    def _differences(self) -> np.ndarray:
        """Matrix of v_b - v_{b-1}, the first v itself, shape (n_v, n_v)."""
        n = len(self.first)
        return np.kron(np.eye(n) - np.eye(n, k=-1), np.eye(self.stages.n_u))

    def _effort(self) -> np.ndarray:
        """Hessian of half the cost of commands, in shares of their ranges."""
        s, D = self.stages, self._differences()
        level = np.add.reduceat(s.level, self.first).ravel()
        H = D.T @ np.diag(s.change[self.first].ravel()) @ D + np.diag(level)
        scale = np.tile(self.scale, len(self.first))
        return H * np.outer(scale, scale)

    def _effort_slope(self, v: ca.MX, last: ca.MX, hold: ca.MX) -> ca.MX:
        """Its gradient at v."""
        s, D, n = self.stages, self._differences(), len(self.first)
        jumps = ca.mtimes(ca.sparsify(ca.DM(D)), v)
        jumps[: s.n_u] -= last
        slope = ca.mtimes(ca.sparsify(ca.DM(D.T)), ca.DM(s.change[self.first].ravel()) * jumps)
        level = np.add.reduceat(s.level, self.first).ravel()
        slope = slope + ca.DM(level) * (v - ca.repmat(hold, n, 1))
        return ca.DM(np.tile(self.scale, n)) * slope

    def _limits(self, p: Prepared, g: ca.MX, last: ca.MX) -> tuple[ca.MX, ca.MX, Rows]:
        """Bounds of z, and its general rows: rate limits between blocks, soft limits."""
        s, n = self.stages, len(self.first)
        scale = ca.DM(np.tile(self.scale, n))
        lower, upper = (_bounded(side.ravel()) for side in self.bounds())
        rate = _bounded(s.rate[self.first].ravel())
        head = s.n_u
        low = ca.vertcat(ca.fmax(lower[:head], last - rate[:head]), lower[head:])
        high = ca.vertcat(ca.fmin(upper[:head], last + rate[:head]), upper[head:])
        D = ca.sparsify(ca.DM(self._differences()[head:]))
        room = rate[head:]
        between = Rows(
            ca.MX(ca.densify(D.T)),
            (-room - ca.mtimes(D, p.v)) / scale[head:],
            (room - ca.mtimes(D, p.v)) / scale[head:],
            ca.MX.zeros(D.shape[0]) + NONE,
            ca.MX.ones(D.shape[0]),
        )
        linear, quadratic = (
            ca.MX(ca.DM(np.tile(price, s.horizon))) for price in (s.linear / 2, s.quadratic)
        )
        soft = Rows(p.C, ca.MX.zeros(linear.shape) - NONE, -ca.vec(g), linear, quadratic)
        parts = [between] if self.rated and n > 1 else []
        parts += [soft] if s.limits else []
        empty = [ca.MX(self.n_v, 0), *[ca.MX(0, 1)] * 4]
        C, *sides = (
            (list(part) for part in zip(*parts, strict=True)) if parts else ([e] for e in empty)
        )
        rows = Rows(ca.horzcat(*C), *(ca.vertcat(*side) for side in sides))
        return (low - p.v) / scale, (high - p.v) / scale, rows


def _by_state(rows: ca.MX, x: ca.MX, N: int) -> ca.MX:
    """Blocks side by side, shape (m, n N), times states 1 ... N: shape (m, N)."""
    n = x.shape[0]
    parts = [ca.mtimes(rows[:, n * k : n * (k + 1)], x[:, k + 1]) for k in range(N)]
    return ca.horzcat(*parts)


def _bounded(values: np.ndarray) -> ca.DM:
    """Limits with a large number where there is none."""
    return ca.DM(np.clip(values, -NONE, NONE))
