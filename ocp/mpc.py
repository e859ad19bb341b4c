"""The controller: an estimate in, a command within its limits out, whatever happens."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from dtcasadi import checks
from dtcasadi.bound import Bound
from dtcasadi.codegen import Exposed, exposed
from dtcasadi.compile import twin
from dtcasadi.errors import ControlError

from .base import Discrete
from .contract import Contract, Pair
from .info import Check, Checker, StepInfo
from .nlp import Instance
from .problem import Problem, refusal
from .rti import Iteration
from .stages import stages
from .status import Action, ControlStatus
from .target import Target, TargetCalculator
from .terminal import TerminalCost

# Linearizations of the target calculator in a step; it starts where it ended last time.
_AIMING = 10
# The same in the first step, which may be slow.
_SEARCHING = 60


class PressureMPC:
    r"""Model predictive control of chamber pressures by the real-time iteration.

    Every `step` makes one Gauss-Newton iteration of the problem (`ocp.problem`) from the plan of
    the step before (`ocp.rti`) and gives a command within limits and rate limits, and a status,
    whatever comes in (`ocp.contract`). C code does the work, CasADi's virtual machine where there
    is no compiler. An object controls one robot; `functions` gives the same as C.

    Attributes:
        stages: the problem on its model.
        contract: the functions of a step.
        memory: what the last step left to the next.
        command: the command in force, shape (n_u,) [Pa].
        steps: how many steps there have been.
    """

    def __init__(
        self,
        discrete: Discrete,
        problem: Problem,
        *,
        u0: Sequence[float] | np.ndarray | None = None,
        iterations: int | None = None,
        plan_steps: int | None = None,
        hold_steps: int | None = None,
        ramp: float | Sequence[float] | None = None,
    ):
        """Check, and build the functions.

        Args:
            discrete: the model; outputs are its sensors.
            problem: what is wanted.
            u0: the command in force at the beginning, shape (n_u,) [Pa]; default: the safe one.
            iterations: budget of a step, changes of the quadratic program's active set; default:
                four for each decision and each soft limit, and 20.
            plan_steps: how many steps a plan may go on when no new one is found; default: N - 1.
            hold_steps: how many steps the command is held after that; default: N.
            ramp: how fast it goes to the safe pressure after that, one number or one for each
                command [Pa/s]; default: its range in 100 steps.

        Raises:
            ControlError: an argument or a term of the problem cannot be used.
        """
        self.stages = stages(discrete, problem)
        s, N = self.stages, self.stages.horizon
        iteration = Iteration(s, 1)
        budget = 4 * (iteration.n_v + len(s.limits) * N) + 20
        if iterations is not None:
            budget = checks.index("iterations", iterations, 1, 10**6, error=refusal)
        plan_steps, hold_steps = (
            default if value is None else checks.index(name, value, 0, 10**9, error=refusal)
            for name, value, default in (
                ("plan_steps", plan_steps, N - 1),
                ("hold_steps", hold_steps, N),
            )
        )
        if ramp is None:
            slope = iteration.scale / 100
        else:
            rate = checks.row("ramp", ramp, s.n_u, nonnegative=True, error=refusal)
            slope = rate * discrete.step_s
        self.contract = Contract(Iteration(s, budget), plan_steps, hold_steps, slope)
        self._bounds: dict[str, Bound] = {}
        self.reset(s.safe if u0 is None else u0)

    def reset(self, u: Sequence[float] | np.ndarray) -> None:
        """Forget the plan; u is the command in force, shape (n_u,) [Pa].

        Raises:
            ControlError: not finite, or outside the limits.
        """
        s = self.stages
        u = checks.row("u0", u, s.n_u, error=refusal)
        if np.any(u < s.lower[0]) or np.any(u > s.upper[0]):
            raise refusal("u0", "a command within the limits", checks.shown(u))
        self.command, self.memory = u, self.contract.start()(u).full()[:, 0]
        self.steps = 0
        self._target: Target | None = None
        self._terminal: tuple[np.ndarray, np.ndarray] | None = None

    def step(
        self, estimate: Any, *, reference: Any = None, theta: Any = None
    ) -> tuple[np.ndarray, StepInfo]:
        """The next command.

        Args:
            estimate: something with states `x` and parameters `theta`, as filters give it; or the
                states alone, shape (n_x,); None where there is none.
            reference: instead of the problem's: a row for each k = 0 ... N counted from now,
                one for each tracked channel, or one number.
            theta: instead of the estimate's or the model's, shape (n_theta,).

        Returns:
            The command, shape (n_u,) [Pa], and what was found.
        """
        s, last = self.stages, self.command
        lost, x, theta = _state(estimate, theta, s.n_x, s.discrete.theta0)
        wrong, wish = self._wish(reference)
        given = self._instance(x, theta, wish)
        target = np.concatenate([given.target_x, given.target_u])
        extra = [target] if self.contract.aims else []
        extra += [given.P] if self.contract.priced else []
        found = self._control(x, theta, wish.T, *extra, self.memory)
        self.memory, self.command = found.memory_next, found.u
        self.steps += 1
        near, rate = 1e-9 * self.contract.iteration.scale, s.rate[0]
        low, high = np.maximum(s.lower[0], last - rate), np.minimum(s.upper[0], last + rate)
        info = StepInfo(
            ControlStatus(int(found.outcome[0])),
            Action(int(found.action[0])),
            found.plan.T.copy(),
            found.states.T.copy(),
            int(found.iterations[0]),
            float(found.violation[0]),
            (found.u <= low + near) | (found.u >= high - near),
            given,
            self._target,
            lost or wrong,
        )
        return found.u.copy(), info

    def check(self, info: StepInfo) -> Check:
        """Simulate the plan of a step again by the model's own step."""
        return self._checker(info)

    def functions(self) -> dict[str, Exposed]:
        """The controller for `dtcasadi.export_c`.

        `control_start` makes the memory of the first call from the command in force, `control` is a
        whole step; `control_prepare` and `control_feedback` are its two phases.
        """
        start = self.contract.start()
        titles = {
            "control": "the next command and what the step leaves to the next one",
            "control_prepare": "before the estimate is there: rollout, linearization, condensing",
            "control_feedback": "once the estimate is there: the command",
        }
        found = {"control_start": exposed("control_start", start, title="memory without a plan")}
        for name, title in titles.items():
            found[name] = exposed(name, *self._pairs[name], title=title)
        return found

    @cached_property
    def _pairs(self) -> dict[str, Pair]:
        c = self.contract
        graphs = (c.control(), c.preparation(), c.reaction())
        return {pair.plain.name(): pair for pair in graphs}

    @cached_property
    def _control(self) -> Bound:
        plain, native = self._pairs["control"]
        ports = {"plan", "states", "reference", "terminal"} & {*plain.name_in(), *plain.name_out()}
        return Bound(twin(plain, source=native), matrices=ports)

    def _wish(self, reference: Any) -> tuple[str, np.ndarray]:
        """What is wrong with the reference, or '', and its rows, NaN where it is missing."""
        s = self.stages
        shape = (s.horizon + 1, len(s.channels))
        try:
            if reference is None:
                return "", s.references(self.steps * s.discrete.step_s)
            return "", np.array(np.broadcast_to(np.asarray(reference, dtype=float), shape))
        except Exception as error:  # a function of the caller's may raise anything
            return f"reference: {error}", np.full(shape, np.nan)

    def _instance(self, x: np.ndarray, theta: np.ndarray, wish: np.ndarray) -> Instance:
        """What holds now: target and terminal cost where the cost knows them."""
        s = self.stages
        n = s.n_x + s.n_u
        aim, P = np.zeros(n), s.problem.terminal
        if self.contract.aims and np.all(np.isfinite(np.concatenate([x, theta, wish[-1]]))):
            aim = self._aimed(x, theta, wish[-1])
        if self.contract.priced:
            P = self._priced(theta)
        P = np.zeros((n, n)) if P is None else np.asarray(P, dtype=float)
        return Instance(x, self.command, theta, wish, aim[: s.n_x], aim[s.n_x :], P)

    def _aimed(self, x: np.ndarray, theta: np.ndarray, wish: np.ndarray) -> np.ndarray:
        """The target of the reference at the end of the horizon; NaN where there is none."""
        s, last = self.stages, self._target
        start = (x, self.command) if last is None else (last.x, last.u)
        most = _AIMING if last is not None else _SEARCHING
        found = self._calculator(wish, theta, *start, most=most, patient=last is None)
        if found.found:
            self._target = found
        if self._target is None:
            return np.full(s.n_x + s.n_u, np.nan)
        return np.concatenate([self._target.x, self._target.u])

    def _priced(self, theta: np.ndarray) -> np.ndarray:
        """P of the terminal cost at the first target, again where the coordinates change."""
        n = self.stages.n_x + self.stages.n_u
        frames = theta[self.stages.discrete.theta_blocks.get("frames", slice(0, 0))]
        if self._target is None:
            return np.zeros((n, n))
        if self._terminal is None or not np.array_equal(self._terminal[0], frames):
            try:
                self._terminal = (frames.copy(), self._cost(self._target, theta))
            except ControlError:
                return np.full((n, n), np.nan)
        return self._terminal[1]

    @cached_property
    def _checker(self) -> Checker:
        return Checker(self.stages)

    @cached_property
    def _calculator(self) -> TargetCalculator:
        return TargetCalculator(self.stages)

    @cached_property
    def _cost(self) -> TerminalCost:
        return TerminalCost(self.stages)


def _state(
    estimate: Any, theta: Any, n_x: int, theta0: np.ndarray
) -> tuple[str, np.ndarray, np.ndarray]:
    """What is wrong with an estimate, or '', its states and parameters; NaN where missing."""
    none = np.full(n_x, np.nan)
    if estimate is None:
        return "none was given", none, theta0
    try:
        x = np.asarray(getattr(estimate, "x", estimate), dtype=float)
        theta = getattr(estimate, "theta", theta0) if theta is None else theta
        theta = np.asarray(theta, dtype=float)
    except (TypeError, ValueError) as error:
        return f"estimate: {error}", none, theta0
    for name, value, shape in (("x", x, (n_x,)), ("theta", theta, theta0.shape)):
        if value.shape != shape:
            return f"{name}: expected shape {shape}, got {value.shape}", none, theta0
    return "", x, theta
