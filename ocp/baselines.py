"""Controllers to compare with: a full solution in every step, PI with statics, statics alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .nlp import Instance
from .plans import Rollout, limited
from .solution import Solution
from .solvers import Solver
from .stages import Stages
from .target import Target, TargetCalculator
from .terminal import TerminalCost


@dataclass(frozen=True, eq=False)
class Said:
    """What these controllers say of a step.

    Attributes:
        plan: commands ahead, shape (N, n_u) [Pa].
        states: predicted states, shape (N + 1, n_x); zero without a prediction.
        text: how it went.
        target: the equilibrium aimed at.
        solution: of the program, where one was solved.
    """

    plan: np.ndarray
    states: np.ndarray
    text: str
    target: Target | None = None
    solution: Solution | None = None


class _Aim:
    """Targets from call to call, each search starting at the last one."""

    def __init__(self, stages: Stages):
        self._find = TargetCalculator(stages)
        self._last: Target | None = None

    def __call__(
        self, reference: np.ndarray, theta: np.ndarray, x: np.ndarray, u: np.ndarray
    ) -> Target:
        last = self._last
        found = self._find(reference, theta, *((x, u) if last is None else (last.x, last.u)))
        self._last = found if found.found else last
        return found if found.found or last is None else last


class FullMPC:
    """Model predictive control that solves its program anew in every step.

    The plan of the step before, shifted by an interval and rolled out, is where a solve starts. A
    solution that fails its check gives way to that plan.

    Attributes:
        stages: the problem on its model.
        command: the command in force, shape (n_u,) [Pa].
    """

    def __init__(self, solver: Solver, u0: np.ndarray, *, accept: float = 0.0):
        """Take a solver and the command in force.

        Args:
            solver: of the problem's program.
            u0: command in force, shape (n_u,) [Pa].
            accept: largest violation of the scaled program's constraints with which a solution that
                is no optimum is taken all the same; a real-time iteration, a solver stopped after
                one step, has to accept its linear model's gaps.
        """
        self.stages = solver.nlp.stages
        self.command = np.asarray(u0, dtype=float)
        self._solver, self._accept = solver, accept
        self._roll, self._aim = Rollout(self.stages), _Aim(self.stages)
        self._cost = TerminalCost(self.stages)
        self._P: np.ndarray | None = None
        self._plan = np.tile(self.command, (self.stages.horizon, 1))

    def step(self, estimate: Any, *, reference: Any = None) -> tuple[np.ndarray, Said]:
        """The next command.

        Args:
            estimate: with states `x` and parameters `theta`.
            reference: a row for each k = 0 ... N; default: the problem's from time zero.
        """
        s = self.stages
        x, theta = np.asarray(estimate.x), np.asarray(estimate.theta)
        rows = s.references(0.0) if reference is None else np.asarray(reference)
        target = self._aim(rows[-1], theta, x, self.command)
        if self._P is None:
            self._P = self._cost(target, theta)
        instance = Instance(x, self.command, theta, rows, target.x, target.u, self._P)
        shifted = limited(s, np.vstack([self._plan[1:], self._plan[-1:]]), self.command)
        start = (self._roll(x, shifted, theta), shifted)
        solution = self._solver(instance, start)
        fits = solution.good or solution.residuals.feasibility < self._accept
        finite = np.all(np.isfinite(solution.u)) and np.all(np.isfinite(solution.x))
        x_plan, u_plan = (solution.x, solution.u) if fits and finite else start
        # What an interior point leaves outside of its bounds is cut off.
        self._plan = limited(s, u_plan, self.command)
        self.command = self._plan[0]
        return self.command.copy(), Said(self._plan, x_plan, solution.text, target, solution)


class StaticControl:
    """Open loop: the pressure that statics asks for the reference, within limits and rates.

    The parameters are the model's own: nothing of the plant comes back.
    """

    def __init__(self, stages: Stages, u0: np.ndarray):
        """Take a problem and the command in force, shape (n_u,) [Pa]."""
        self.stages, self.command = stages, np.asarray(u0, dtype=float)
        self._aim = _Aim(stages)

    def wanted(self, estimate: Any, rows: np.ndarray) -> np.ndarray:
        """The command that holds the present reference, shape (n_u,) [Pa]."""
        s = self.stages
        x = np.asarray(estimate.x)
        self._target = self._aim(rows[0], s.discrete.theta0, x, self.command)
        return self._target.u

    def step(self, estimate: Any, *, reference: Any = None) -> tuple[np.ndarray, Said]:
        """The next command, as `FullMPC.step`."""
        s = self.stages
        rows = s.references(0.0) if reference is None else np.asarray(reference)
        return self._given(self.wanted(estimate, rows), "inverse statics")

    def _given(self, u: np.ndarray, text: str) -> tuple[np.ndarray, Said]:
        s = self.stages
        plan = limited(s, np.tile(u, (s.horizon, 1)), self.command)
        self.command = plan[0]
        return plan[0].copy(), Said(plan, np.zeros((s.horizon + 1, s.n_x)), text)


class PIControl(StaticControl):
    r"""PI on the outputs' error over inverse statics.

    .. math:: u = u_s(y^{ref}) + S (k_p e + k_i \int e \, dt), \quad e = y^{ref} - y(\hat x)

    S is the slope of u against y at the model's equilibrium. The integral stands still while a
    command is at a limit (Astrom and Hagglund, Advanced PID Control, section 3.5).

    Attributes:
        k_p: share of the static correction made at once.
        k_i: share of it made in a second [1/s].
    """

    def __init__(self, stages: Stages, u0: np.ndarray, *, k_p: float = 0.2, k_i: float = 0.8):
        """Take a problem, the command in force and the gains."""
        super().__init__(stages, u0)
        self.k_p, self.k_i = k_p, k_i
        self._sum = np.zeros(len(stages.channels))

    def step(self, estimate: Any, *, reference: Any = None) -> tuple[np.ndarray, Said]:
        """The next command, as `FullMPC.step`."""
        s = self.stages
        rows = s.references(0.0) if reference is None else np.asarray(reference)
        u_s = self.wanted(estimate, rows)
        slope = np.linalg.pinv(self._target.slope)
        theta = np.asarray(estimate.theta)
        e = -np.array(s.residual(np.asarray(estimate.x), theta, rows[0])).ravel()
        u, said = self._given(u_s + slope @ (self.k_p * e + self._sum), "PI, inverse statics")
        held = (u >= s.upper[0]) | (u <= s.lower[0])
        if not np.any(held):
            self._sum += self.k_i * s.discrete.step_s * e
        return u, said
