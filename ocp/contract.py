"""A whole step of a controller as a graph: whatever comes in, a command within its limits goes out.

What one step leaves to the next is the port `memory`: the last plan shifted by an interval, the
command in force, the active set, how many steps ago a plan was last solved, and whether the plan is
still trusted to roll the model out. Any numbers may stand in it, zeros to begin with or NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from .rti import _HUGE, OPTIONS, Feedback, Iteration, Prepared, Wanted
from .status import Action, ControlStatus


class Memory(NamedTuple):
    """Parts of the port `memory`: plan (n_u, N), last (n_u,), active, age, trusted."""

    plan: ca.MX
    last: ca.MX
    active: ca.MX
    age: ca.MX
    trusted: ca.MX


class Pair(NamedTuple):
    """A Function for the virtual machine, and the same with C kernels for generated code."""

    plain: ca.Function
    native: ca.Function


_WANTED = ("reference", "target", "terminal")


@dataclass(frozen=True, eq=False)
class Contract:
    """The functions of a controller.

    Attributes:
        iteration: what solves.
        plan_steps: steps for which a last plan may go on without a new one.
        hold_steps: steps for which the command is held after that.
        ramp: largest change of a command in a step on the way to the safe pressure, (n_u,) [Pa].
    """

    iteration: Iteration
    plan_steps: int
    hold_steps: int
    ramp: np.ndarray

    @property
    def sizes(self) -> tuple[int, ...]:
        """Lengths of the parts of `memory`."""
        s = self.iteration.stages
        return (s.n_u * s.horizon, s.n_u, self.iteration.n_active, 1, 1)

    @property
    def aims(self) -> bool:
        """Whether the cost knows a target."""
        s = self.iteration.stages
        return s.problem.terminal is not None or bool(np.any(s.level))

    @property
    def priced(self) -> bool:
        """Whether the terminal cost comes from outside."""
        return isinstance(self.iteration.stages.problem.terminal, str)

    def start(self) -> ca.Function:
        """Function u -> memory of a controller without a plan that finds the command u in force."""
        u = ca.MX.sym("u", self.iteration.stages.n_u)
        plan = ca.repmat(u, self.iteration.stages.horizon, 1)
        rest = [ca.DM.zeros(self.sizes[2]), self.plan_steps, 1]
        return ca.Function("control_start", [u], [ca.vertcat(plan, u, *rest)], ["u"], ["memory"])

    def control(self) -> Pair:
        """Functions x, theta, reference, target, P, memory -> command, plan, states, ...

        Outputs: u (n_u,), plan (n_u, N), states (n_x, N + 1), outcome and action (numbers of
        `ControlStatus` and `Action`), iterations, violation, memory_next.
        """
        return self._pair("control", self._control)

    def preparation(self) -> Pair:
        """Functions x, theta, reference, target, P, memory -> prepared, all in one vector.

        x is the state predicted for the feedback, as `states` of the last plan has it.
        """
        return self._pair("control_prepare", self._prepare)

    def reaction(self) -> Pair:
        """Functions x, prepared, target, P, memory -> as `control`, the parameters as prepared."""
        return self._pair("control_feedback", self._react)

    def _pair(self, name: str, graph: object) -> Pair:
        found = []
        for native in (False, True):
            ports, outputs = graph(native)  # type: ignore[operator]
            given = list(ports.values())
            values = [ca.densify(value) for value in outputs.values()]
            found.append(ca.Function(name, given, values, [*ports], [*outputs], OPTIONS))
        return Pair(*found)

    def _ports(self) -> dict[str, ca.MX]:
        s, sym = self.iteration.stages, ca.MX.sym
        n = s.n_x + s.n_u
        return {
            "x": sym("x", s.n_x),
            "theta": sym("theta", len(s.discrete.theta0)),
            "reference": sym("reference", len(s.channels), s.horizon + 1),
            **({"target": sym("target", n)} if self.aims else {}),
            **({"terminal": sym("terminal", n, n)} if self.priced else {}),
            "memory": sym("memory", sum(self.sizes)),
        }

    def _control(self, native: bool) -> tuple[dict[str, ca.MX], dict[str, ca.MX]]:
        ports = self._ports()
        memory = self._memory(ports["memory"])
        prepared, wanted, faults = self._prepared(ports, memory, native)
        solved = self.iteration.feedback(
            prepared, None, memory.last, wanted, memory.active, native=native
        )
        return ports, self._judged(solved, memory, [*faults, prepared.failed])

    def _prepare(self, native: bool) -> tuple[dict[str, ca.MX], dict[str, ca.MX]]:
        ports = self._ports()
        prepared, _, faults = self._prepared(ports, self._memory(ports["memory"]), native)
        # A state that could not be predicted fails here as the model does.
        failed = prepared.failed + faults[0]
        parts = [*prepared._replace(failed=failed), faults[1]]
        return ports, {"prepared": ca.vertcat(*(ca.vec(ca.densify(part)) for part in parts))}

    def _react(self, native: bool) -> tuple[dict[str, ca.MX], dict[str, ca.MX]]:
        ports = self._ports()
        memory = self._memory(ports["memory"])
        symbols = self._shapes()
        sizes = [rows * columns for rows, columns in symbols]
        packed = ca.MX.sym("prepared", sum(sizes) + 1)
        *pieces, asked = ca.vertsplit(packed, np.cumsum([0, *sizes, 1]).tolist())
        prepared = Prepared(
            *(ca.reshape(piece, *shape) for piece, shape in zip(pieces, symbols, strict=True))
        )
        wanted = self._wanted(
            ports | {"reference": ca.MX.zeros(len(self.iteration.stages.channels), 1)}
        )
        lost = 1 - _finite(ports["x"])
        x = ca.if_else(lost, prepared.x[:, 0], ports["x"])
        solved = self.iteration.feedback(
            prepared, x - prepared.x[:, 0], memory.last, wanted, memory.active, native=native
        )
        faults = [lost, asked, prepared.failed]
        inputs = {"x": ports["x"], "prepared": packed}
        rest = ("target", "terminal", "memory")
        inputs |= {name: ports[name] for name in rest if name in ports}
        return inputs, self._judged(solved, memory, faults)

    def _shapes(self) -> list[tuple[int, int]]:
        """Shape of each part of a preparation."""
        it = self.iteration
        s, N, n = it.stages, it.stages.horizon, it.n_v
        n_r, n_g, n_x = len(s.channels), len(s.limits), s.n_x
        return [
            *((n_x, n_x * N), (n_x, s.n_u * N), (n_x, N + 1)),
            *((n_r, N), (n_r, n_x * N), (n_g, N), (n_g, n_x * N)),
            *((n, n), (n, n_r * N), (n, n_g * N), (n_x, n), (n, 1), (1, 1)),
        ]

    def _memory(self, packed: ca.MX) -> Memory:
        s = self.iteration.stages
        edges = np.cumsum([0, *self.sizes]).tolist()
        plan, last, active, age, trusted = ca.vertsplit(packed, edges)
        lower, upper = (ca.DM(np.clip(side, -1e30, 1e30)) for side in (s.lower, s.upper))
        # The value comes first: what is no number then becomes the limit.
        plan = ca.reshape(plan, s.n_u, s.horizon)
        plan = ca.fmin(ca.fmax(plan, lower.T), upper.T)
        last = ca.fmin(ca.fmax(last, lower[0, :].T), upper[0, :].T)
        return Memory(plan, last, active, age, trusted)

    def _wanted(self, ports: dict[str, ca.MX]) -> Wanted:
        s = self.iteration.stages
        n, P = s.n_x + s.n_u, s.problem.terminal
        values = {"target": ca.MX.zeros(n), "terminal": ca.MX.zeros(n, n)}
        if isinstance(P, np.ndarray):
            values["terminal"] = ca.MX(ca.DM(P))
        for name in _WANTED:
            if name in ports:
                values[name] = ca.if_else(_finite(ports[name]), ports[name], 0)
        return Wanted(values["reference"], values["target"], values["terminal"])

    def _prepared(
        self, ports: dict[str, ca.MX], memory: Memory, native: bool
    ) -> tuple[Prepared, Wanted, list[ca.MX]]:
        """The preparation, what it takes for wanted, and whether estimate and wish are missing."""
        s = self.iteration.stages
        lost = 1 - _finite(ports["x"]) * _finite(ports["theta"])
        asked = ca.mmin(ca.vertcat(*(_finite(ports[name]) for name in _WANTED if name in ports)))
        # Nothing that is not finite enters the computation, whose result is left aside then.
        x = ca.if_else(lost, 0, ports["x"])
        theta = ca.if_else(lost, ca.DM(s.discrete.theta0), ports["theta"])
        wanted = self._wanted(ports)
        held = ca.repmat(memory.last, 1, s.horizon)
        plan = ca.if_else(memory.trusted > 0.5, memory.plan, held)
        found = self.iteration.prepared(x, theta, plan, wanted, native=native)
        return found, wanted, [lost, 1 - asked]

    def _judged(self, solved: Feedback, memory: Memory, faults: list[ca.MX]) -> dict[str, ca.MX]:
        """Command and memory, from the plan or from what takes its place."""
        lost, asked, failed = (fault > 0 for fault in faults)
        broken = 1 - _finite(ca.vertcat(ca.vec(solved.u), ca.vec(solved.x), solved.violation))
        outcome = ca.if_else(solved.status > 0.5, ControlStatus.BUDGET, ControlStatus.SOLVED)
        checks = (
            (solved.status > 1.5, ControlStatus.SOLVER_FAILED),
            (failed + broken, ControlStatus.MODEL_FAILED),
            (asked, ControlStatus.NO_REFERENCE),
            (lost, ControlStatus.NO_ESTIMATE),
        )
        for fault, status in checks:
            outcome = ca.if_else(fault, int(status), outcome)
        good = outcome < ControlStatus.BUDGET + 0.5
        age = ca.if_else(good, 0, memory.age + 1)
        instead, action = self._instead(memory)
        N = self.iteration.stages.horizon
        plan = ca.if_else(good, solved.u, instead)
        plan = self.iteration.kept(plan, memory.last)
        shifted = ca.horzcat(plan[:, 1:], plan[:, N - 1])
        distrust = (outcome > ControlStatus.MODEL_FAILED - 0.5) + (action > Action.LAST_PLAN + 0.5)
        trusted = ca.if_else(good, 1, 1 - (distrust > 0))
        active = ca.if_else(good, self._shifted(solved.active), 0)
        following = [ca.vec(shifted), plan[:, 0], active, age, trusted]
        finite = {
            "states": ca.if_else(_finite(solved.x), solved.x, 0),
            "violation": ca.if_else(_finite(solved.violation), solved.violation, 0),
        }
        return {
            "u": plan[:, 0],
            "plan": plan,
            "states": finite["states"],
            "outcome": outcome,
            "action": ca.if_else(good, int(Action.PLAN), action),
            "iterations": solved.iterations,
            "violation": finite["violation"],
            "memory_next": ca.vertcat(*following),
        }

    def _instead(self, memory: Memory) -> tuple[ca.MX, ca.MX]:
        """The plan without a solution: the last one, then its command, then to the safe one."""
        s = self.iteration.stages
        N = s.horizon
        hold = ca.repmat(memory.last, 1, N)
        safe, ramp = ca.DM(s.safe), ca.DM(np.clip(self.ramp, 0, 1e30))
        steps = [memory.last]
        for _ in range(N):
            steps.append(steps[-1] + ca.fmin(ca.fmax(safe - steps[-1], -ramp), ramp))
        plans, holds = memory.age < self.plan_steps, memory.age < self.plan_steps + self.hold_steps
        plan = ca.if_else(plans, memory.plan, ca.if_else(holds, hold, ca.horzcat(*steps[1:])))
        action = ca.if_else(
            plans, int(Action.LAST_PLAN), ca.if_else(holds, int(Action.HOLD), int(Action.RAMP))
        )
        return plan, action

    def _shifted(self, active: ca.MX) -> ca.MX:
        """The active set an interval on; rows of blocks move where the first block is one long."""
        it = self.iteration
        s = it.stages
        soft = len(s.limits) * s.horizon
        edges = [0, it.n_v, it.n_active - soft, it.n_active]
        bounds, rates, limits = ca.vertsplit(active, edges)
        moves = len(it.first) > 1 and it.first[1] == 1
        parts = []
        for part, stride in (
            (bounds, s.n_u * moves),
            (rates, s.n_u * moves),
            (limits, len(s.limits)),
        ):
            n = part.shape[0]
            if n > stride:
                parts += [part[stride:], part[n - stride :]]
            else:
                parts.append(part)
        return ca.vertcat(*parts)


def _finite(value: ca.MX) -> ca.MX:
    """1 where every entry is a number of sane size."""
    return ca.sumsqr(value) <= _HUGE
