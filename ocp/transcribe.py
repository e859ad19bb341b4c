r"""A problem as a nonlinear program: multiple or single shooting, or direct collocation.

Variables of stage k are its state z_k = (x_k; u_{k-1}; s_k) and its controls (u_k; s_{k+1}; stages
of collocation);
the state of stage 0 is held to the measured one, and an interval inside a
block of intervals has no command of its own. Constraints of stage k are the gap z_{k+1} = F(z_k),
then what holds within the stage: the order that solvers of optimal control problems ask for.

Single shooting keeps the commands and slacks alone: a small dense program, for solvers of such.
Multiple shooting calls the model's step (Bock and Plitt, IFAC Proceedings 17(2), 1984); collocation
puts the states of an interval at the points of Radau or Legendre and asks the state equation to
hold there (Biegler, Nonlinear Programming, chapter 10).

States are scaled by how far a full command moves them in a step, commands by their limits, the cost
by its largest weight; solutions come back in SI units.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import casadi as ca
import numpy as np

from dtcasadi import checks

from .calls import Functions, collocation, scales
from .nlp import Nlp, Structure
from .problem import refusal
from .stages import Stages

Scheme = Literal["shooting", "single", "radau", "legendre"]
SCHEMES = ("shooting", "single", "radau", "legendre")


def transcribe(
    stages: Stages, scheme: Scheme = "shooting", *, degree: int = 3, exact: bool = False
) -> Nlp:
    """Make the program.

    Args:
        stages: the problem on its model.
        scheme: `shooting` (multiple) or `single` with the model's step, or collocation of its state
            equation at the points `radau` or `legendre`.
        degree: number of collocation points in an interval.
        exact: exact second derivatives; otherwise those of Gauss-Newton, which are positive
            semidefinite and cost a fraction.

    Raises:
        ControlError: an unknown scheme, or a degree out of 1 ... 9.
    """
    if scheme not in SCHEMES:
        raise refusal("scheme", f"one of {', '.join(SCHEMES)}", checks.shown(scheme))
    checks.index("degree", degree, 1, 9, error=refusal)
    return _Program(stages, scheme, degree, exact).nlp()


@dataclass(eq=False)
class _Program:
    """The program while it is being put together."""

    stages: Stages
    scheme: str
    degree: int
    exact: bool
    w: list[ca.MX] = field(default_factory=list)
    lower: list[ca.MX] = field(default_factory=list)
    upper: list[ca.MX] = field(default_factory=list)
    guess: list[ca.MX] = field(default_factory=list)
    g: list[ca.MX] = field(default_factory=list)
    lbg: list[np.ndarray] = field(default_factory=list)
    ubg: list[np.ndarray] = field(default_factory=list)

    def __post_init__(self) -> None:
        s = self.stages
        n, m, N = s.n_x, s.n_u, s.horizon
        self.x0, self.u_now = ca.MX.sym("x0", n), ca.MX.sym("u_now", m)
        self.theta = ca.MX.sym("theta", len(s.discrete.theta0))
        self.references = ca.MX.sym("references", len(s.channels) * (N + 1))
        self.target_x, self.target_u = ca.MX.sym("target_x", n), ca.MX.sym("target_u", m)
        self.P = ca.MX.sym("P", (n + m) ** 2)
        self.u_scale, self.x_scale, self.cost_scale = scales(s)
        # The plan to start from, of the Function `joined`.
        self.plan_x, self.plan_u = ca.MX.sym("plan_x", n, N + 1), ca.MX.sym("plan_u", m, N)
        self.plan_v = ca.horzcat(self.plan_u[:, 0], self.plan_u)
        self.plan_slack = ca.MX.sym("plan_slack", len(s.limits), N)
        self.functions = Functions(s, self.scheme, exact=self.exact)

    def nlp(self) -> Nlp:
        """Put it together."""
        s, N = self.stages, self.stages.horizon
        single = self.scheme == "single"
        x, v = self.x0, self.u_now
        if not single:
            z = self._state(0, with_slack=False)
            x, v = z[0] * self.x_scale, z[1] * self.u_scale
        slack: ca.MX | None = None
        xs, us, slacks = [x], [], []
        cost: ca.MX = ca.MX(0)
        sizes: dict[str, list[int]] = {"nx": [s.n_x + s.n_u], "nu": [], "ng": []}
        free = np.diff(s.block_of, prepend=-1) > 0
        for k in range(N):
            start = len(self.w)
            u = self._command(k) if free[k] else v
            following = self._slack(k)
            x_end, within = self._interval(k, x, u)
            sizes["nu"].append(sum(part.shape[0] for part in self.w[start:]))
            if not single:
                z = self._gap(k, x_end, u, following)
                sizes["nx"].append(sum(part.shape[0] for part in z))
            sizes["ng"].append(self._within(k, x, v, u, slack, within, free=bool(free[k])))
            cost += self._cost(k, x, v, u, following)
            x, v, slack = x_end, u, following
            if not single:
                x, v = z[0] * self.x_scale, z[1] * self.u_scale
                slack = z[2] if following is not None else None
            xs.append(x)
            us.append(u)
            slacks.append(following if following is not None else ca.MX(0, 1))
        sizes["nu"].append(0)
        sizes["ng"].append(self._soft(x, slack))
        cost += self._end(x, v)
        return self._made(cost, sizes, [ca.horzcat(*part) for part in (xs, us, slacks)])

    def _made(self, cost: ca.MX, sizes: dict[str, list[int]], plan: list[ca.MX]) -> Nlp:
        w = ca.vertcat(*self.w)
        p = ca.vertcat(
            self.x0,
            self.u_now,
            self.theta,
            self.references,
            self.target_x,
            self.target_u,
            self.P,
        )
        bounds = [ca.vertcat(*self.lower), ca.vertcat(*self.upper)]
        structure = Structure(**{key: tuple(value) for key, value in sizes.items()})
        given = [self.plan_x, self.plan_u, self.plan_slack]
        names = ["x", "u", "slack"]
        return Nlp(
            stages=self.stages,
            parts={
                "x": w,
                "p": p,
                "f": cost / self.cost_scale,
                "g": ca.vertcat(ca.MX(0, 1), *self.g),
            },
            structure=None if self.scheme == "single" else structure,
            lbg=np.concatenate([np.zeros(0), *self.lbg]),
            ubg=np.concatenate([np.zeros(0), *self.ubg]),
            bounds=ca.Function("bounds", [self.u_now], bounds, ["u_now"], ["lbw", "ubw"]),
            joined=ca.Function("joined", given, [ca.vertcat(*self.guess)], names, ["w"]),
            split=ca.Function("split", [w, p], plan, ["w", "p"], names),
            scale=self.cost_scale,
            scheme=self.scheme,
        )

    def _gap(self, k: int, x_end: ca.MX, u: ca.MX, following: ca.MX | None) -> list[ca.MX]:
        """The state of the next stage, held to where this one ends."""
        z = self._state(k + 1, with_slack=following is not None)
        ends = [x_end / self.x_scale, u / self.u_scale]
        ends += [following] if following is not None else []
        self._constrain(ca.vertcat(*z) - ca.vertcat(*ends), 0.0, 0.0)
        return z

    def _variable(self, name: str, n: int, lower: ca.MX, upper: ca.MX, guess: ca.MX) -> ca.MX:
        """A decision variable with its bounds and guess."""
        symbol = ca.MX.sym(name, n)
        self.w.append(symbol)
        self.lower.append(lower)
        self.upper.append(upper)
        self.guess.append(guess)
        return symbol

    def _constrain(self, g: ca.MX, lower: float | np.ndarray, upper: float | np.ndarray) -> int:
        n = g.shape[0]
        self.g.append(g)
        self.lbg.append(np.broadcast_to(np.asarray(lower, dtype=float), (n,)))
        self.ubg.append(np.broadcast_to(np.asarray(upper, dtype=float), (n,)))
        return n

    def _command(self, k: int) -> ca.MX:
        """u_k of a new block, within the limits of all its intervals."""
        s = self.stages
        same = s.block_of == s.block_of[k]
        lower, upper = s.lower[same].max(axis=0), s.upper[same].min(axis=0)
        lower, upper = ca.MX(ca.DM(lower)), ca.MX(ca.DM(upper))
        if k == 0:  # the command in force is known: its rate limit is a bound
            v, rate = self.u_now, ca.DM(s.rate[0])
            near = ca.fmin(ca.fmax(v, lower), upper)
            lower = ca.fmin(ca.fmax(lower, v - rate), near)
            upper = ca.fmax(ca.fmin(upper, v + rate), near)
        scale = self.u_scale
        symbol = self._variable(
            f"u{k}", s.n_u, lower / scale, upper / scale, self.plan_u[:, k] / scale
        )
        return symbol * scale

    def _slack(self, k: int) -> ca.MX | None:
        """s_{k+1}, chosen at stage k."""
        n = len(self.stages.limits)
        if not n:
            return None
        most = ca.MX(ca.DM([np.inf] * n))
        return self._variable(f"s{k + 1}", n, ca.MX(n, 1), most, self.plan_slack[:, k])

    def _state(self, k: int, *, with_slack: bool) -> list[ca.MX]:
        """(x_k; u_{k-1}; s_k), scaled."""
        s = self.stages
        guesses = [
            ("x", s.n_x, self.plan_x[:, k] / self.x_scale),
            ("v", s.n_u, self.plan_v[:, k] / self.u_scale),
        ]
        if with_slack:
            guesses.append(("z", len(s.limits), self.plan_slack[:, k - 1]))
        found = []
        for name, n, guess in guesses:
            infinite = ca.MX(ca.DM([np.inf] * n))
            found.append(self._variable(f"{name}{k}", n, -infinite, infinite, guess))
        return found

    def _interval(self, k: int, x: ca.MX, u: ca.MX) -> tuple[ca.MX, list[ca.MX]]:
        """The state at the end of an interval, and what collocation asks within it."""
        call = self.functions.motion
        if self.scheme in ("shooting", "single"):
            return call(x, u, self.theta), []
        n, h = self.stages.n_x, self.stages.discrete.step_s
        C, D = collocation(self.scheme, self.degree)
        infinite = ca.MX(ca.DM([np.inf] * n))
        points = [x]
        taus = [0.0, *ca.collocation_points(self.degree, self.scheme)]
        for j in range(1, self.degree + 1):
            share = taus[j]
            guess = self.plan_x[:, k] * (1 - share) + self.plan_x[:, k + 1] * share
            name = f"c{k}_{j}"
            symbol = self._variable(name, n, -infinite, infinite, guess / self.x_scale)
            points.append(symbol * self.x_scale)
        within = []
        for j in range(1, self.degree + 1):
            slope = sum((C[r, j] * points[r] for r in range(1, self.degree + 1)), C[0, j] * x)
            within.append((h * call(points[j], u, self.theta) - slope) / self.x_scale)
        end = sum((D[r] * points[r] for r in range(1, self.degree + 1)), D[0] * x)
        return end, within

    def _within(
        self,
        k: int,
        x: ca.MX,
        v: ca.MX,
        u: ca.MX,
        slack: ca.MX | None,
        within: list[ca.MX],
        *,
        free: bool,
    ) -> int:
        """Constraints within stage k; how many."""
        n = 0
        if k == 0 and self.scheme != "single":
            known = [(x - self.x0) / self.x_scale, (v - self.u_now) / self.u_scale]
            n = self._constrain(ca.vertcat(*known), 0.0, 0.0)
        n += sum(self._constrain(part, 0.0, 0.0) for part in within)
        limited = np.flatnonzero(np.isfinite(self.stages.rate[k]))
        if k and free and len(limited):
            rate = (self.stages.rate[k] / self.u_scale)[limited]
            n += self._constrain(((u - v) / self.u_scale)[limited.tolist()], -rate, rate)
        return n + self._soft(x, slack)

    def _soft(self, x: ca.MX, slack: ca.MX | None) -> int:
        if slack is None:
            return 0
        return self._constrain(self.functions.inequality(x, self.theta) - slack, -np.inf, 0.0)

    def _cost(self, k: int, x: ca.MX, v: ca.MX, u: ca.MX, following: ca.MX | None) -> ca.MX:
        s = self.stages
        cost = _square(s.change[k], u - v) + _square(s.level[k], u - self.target_u)
        if k:
            cost += self._tracking(k, x)
        if following is not None:
            cost += ca.dot(ca.DM(s.linear), following) + _square(s.quadratic, following)
        return cost

    def _tracking(self, k: int, x: ca.MX) -> ca.MX:
        s = self.stages
        n = len(s.channels)
        if not np.any(s.weight[k]):
            return ca.MX(0)
        reference = self.references[k * n : (k + 1) * n]
        return _square(s.weight[k], self.functions.residual(x, self.theta, reference))

    def _end(self, x: ca.MX, v: ca.MX) -> ca.MX:
        n = self.stages.n_x + self.stages.n_u
        cost = self._tracking(self.stages.horizon, x)
        if self.stages.problem.terminal is None:
            return cost
        off = ca.vertcat(x - self.target_x, v - self.target_u)
        return cost + ca.bilin(ca.reshape(self.P, n, n), off, off)


def _square(weight: np.ndarray, value: ca.MX) -> ca.MX:
    return ca.dot(ca.DM(weight) * value, value)
