"""The symbols of a model, and the expressions its Functions share."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca

from .acting import act
from .actuation import rest_volume
from .actuators import Actuator
from .assemble import Flat, Graph
from .chain import Chain, Motion, Wrench, sum_wrench
from .charts import Chart
from .constraints.system import constrained, reactions, terms
from .forces.inflation import INFLATION, ChamberNumbers
from .forces.loads import DeadWrench
from .forces.protocol import Force
from .forces.traits import traits
from .linear import UNROLLED
from .numbers import Theta, numbers_of
from .robot import Chamber, Robot

OPTIONS = {"cse": True}


@dataclass(frozen=True)
class Options:
    """What a model is built with, checked; see `dtcasadi.build`."""

    charts: tuple[Chart, ...]
    velocity_terms: str
    damping: str
    inflation: str
    actuator: Actuator
    parameters: tuple[str, ...]
    wrenches: tuple[int, ...]
    assembly: str


class Ports:
    """Symbols of every port and the chain on them."""

    def __init__(self, robot: Robot, options: Options, theta: Theta, *, native: bool = False):
        self.robot, self.options, self.layout, self.native = robot, options, theta, native
        asm = Graph() if options.assembly == "graph" else Flat()
        n_q = sum(chart.words.n_q for chart in options.charts)
        n_u = len(robot.chambers)
        names = options.actuator.state_names(n_u)
        sym = asm.sym
        self.q, self.qd, self.qdd = sym("q", n_q), sym("qd", n_q), sym("qdd", n_q)
        self.tau, self.p = sym("tau", n_q), sym("p", n_q)
        self.pressure = sym("pressure", n_u)
        self.x, self.u = sym("x", 2 * n_q + len(names)), sym("u", n_u)
        self.theta = sym("theta", len(theta.values))
        self._tops: dict[str, ca.SX | ca.MX] = {}
        self.chain = Chain(
            self._numbers(),
            [chart.words for chart in options.charts],
            asm,
        )

    def _numbers(self):  # noqa: ANN202
        symbols = {slot: self.theta[place] for slot, place in self.layout.slots}
        numbers = numbers_of(self.robot, symbols)
        if "frames" not in self.layout.blocks:
            return numbers
        frames = self.theta[self.layout.blocks["frames"]]
        bend, twist = list(numbers.bend), list(numbers.twist)
        moving = [i for i, chart in enumerate(self.options.charts) if chart.recentres]
        for k, i in enumerate(moving):
            bend[i] = ca.reshape(frames[18 * k : 18 * k + 9], 3, 3)
            twist[i] = ca.reshape(frames[18 * k + 9 : 18 * k + 18], 3, 3)
        return numbers._replace(bend=tuple(bend), twist=tuple(twist))

    @property
    def n_frames(self) -> int:
        """Length of the theta block `frames`, the first one."""
        return self.layout.blocks.get("frames", slice(0, 0)).stop

    @property
    def inlined(self) -> bool:
        """Whether derivatives are one flat graph too: small enough for an unrolled solve."""
        return self.options.assembly == "flat" and self.chain.n_q <= UNROLLED

    def top(self, port: str) -> ca.SX | ca.MX:
        """A port's symbol at the level where derivatives are put together: SX, or MX of calls."""
        if port not in self._tops:
            own = getattr(self, port)
            self._tops[port] = own if self.inlined else ca.MX.sym(port, own.shape[0])
        return self._tops[port]

    def top_function(self, name: str, inputs: Sequence[str], **outputs: ca.SX) -> ca.Function:
        """A Function of `top` symbols."""
        return self._named(name, [self.top(port) for port in inputs], inputs, outputs)

    def function(self, name: str, inputs: Sequence[str], **outputs: ca.SX) -> ca.Function:
        """A Function with named ports, common subexpressions shared."""
        return self._named(name, [getattr(self, port) for port in inputs], inputs, outputs)

    @staticmethod
    def _named(
        name: str, symbols: list[ca.SX], inputs: Sequence[str], outputs: dict[str, ca.SX]
    ) -> ca.Function:
        values = [ca.densify(value) for value in outputs.values()]
        return ca.Function(name, symbols, values, list(inputs), list(outputs), OPTIONS)


class Graphs(Ports):
    """Expressions that `functions` and `jacobians` build from."""

    @property
    def coordinate_damping(self) -> ca.SX | None:
        """The paper's b on each coordinate rate, or None with physical damping."""
        if self.options.damping != "coordinate":
            return None
        return ca.vertcat(
            *(
                ca.repmat(numbers.c_a, words.n_q, 1)
                for numbers, words in zip(self.chain.numbers.damping, self.chain.words, strict=True)
            )
        )

    @cached_property
    def own_forces(self) -> list[Force]:
        """The robot's own springs and physical damping."""
        numbers = self.chain.numbers
        physical = self.options.damping == "physical"
        return [*numbers.springs, *(numbers.damping if physical else ())]

    @cached_property
    def open_forces(self) -> list[Force]:
        """The robot's open list, its contacts and the theta block `wrench`."""
        start = self.layout.blocks.get("wrench", slice(0, 0)).start
        places = range(start, start + 6 * len(self.options.wrenches), 6)
        wrenches = [
            DeadWrench(disc, self.theta[k : k + 3], self.theta[k + 3 : k + 6])
            for disc, k in zip(self.options.wrenches, places, strict=True)
        ]
        numbers = self.chain.numbers
        return [*numbers.forces, *numbers.contacts, *wrenches]

    def chamber_forces(self, pressure: ca.SX) -> list[list[Force]]:
        """The forces of each chamber."""
        make = INFLATION[self.options.inflation]
        return [
            make(chamber.discs, numbers, pressure[k])
            for k, (chamber, numbers) in enumerate(self.chambers)
        ]

    @property
    def chambers(self) -> list[tuple[Chamber, ChamberNumbers]]:
        """The chambers with their numbers."""
        return list(zip(self.robot.chambers, self.chain.numbers.chambers, strict=True))

    @cached_property
    def rest_volume(self) -> ca.DM:
        """Volume of each chamber at q = 0 with the robot's own numbers [m^3]."""
        return rest_volume(self, self.layout.values)

    def forces(self, pressure: ca.SX | None) -> list[Force]:
        """All forces that give wrenches; without a pressure those of the chambers left out."""
        chambers = [] if pressure is None else self.chamber_forces(pressure)
        return [*self.own_forces, *itertools.chain(*chambers), *self.open_forces]

    @cached_property
    def conservative_forces(self) -> list[Force]:
        """Those with an energy."""
        return [force for force in self.forces(None) if force.stores()]

    def loads(self, segments: list, qd: ca.SX, pressure: ca.SX | None) -> list[Wrench]:
        """All wrenches on discs but those of fields."""
        return self.acting(self.forces(pressure), segments, qd)

    def acting(self, forces: Sequence[Force], segments: list, qd: ca.SX) -> list[Wrench]:
        """Sum of the forces' wrenches on each disc."""
        return self.chain.total(act(self.chain, forces, segments, qd))

    def generalized(self, forces: Sequence[Force], segments: list, qd: ca.SX) -> ca.SX:
        """Generalized forces of the forces' wrenches."""
        return self.chain.project(segments, self.acting(forces, segments, qd))[0]

    @property
    def still(self) -> ca.SX:
        """No rates."""
        return self.chain.asm.expression(self.chain.n_q, 1)

    def lost(self, forces: Sequence[Force], segments: list, qd: ca.SX) -> ca.SX:
        """What the rates take from the generalized forces."""
        mine = [force for force in forces if traits(force).rates]
        at_rest = self.generalized(mine, segments, self.still)
        return at_rest - self.generalized(mine, segments, qd)

    @cached_property
    def with_calls(self) -> "Graphs":
        """These graphs as calls of per-segment Functions, unless one flat graph is small enough."""
        if self.inlined or self.options.assembly == "graph":
            return self
        options = replace(self.options, assembly="graph")
        return Graphs(self.robot, options, self.layout, native=self.native)

    def inertial_motion(self, segments: list, qd: ca.SX) -> Motion:
        """The motion whose velocity terms count: none of them with `velocity_terms="none"`."""
        none = self.options.velocity_terms == "none"
        return self.chain.motion(segments, self.still if none else qd)

    def missing_terms(self, motion: Motion) -> ca.SX | float:
        """What eq (7) without 1/2 qd^T (dM/dq) qd adds to the left side: dT/dq."""
        if self.options.velocity_terms != "paper":
            return 0
        return self.chain.momenta(motion)[1]

    def missing_terms_jacobian(self, q: ca.SX, qd: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Derivatives of `missing_terms` for q and qd."""
        motion = self.chain.motion(self.chain.segments(self.q), self.qd)
        value = self.missing_terms(motion)
        blocks = [ca.jacobian(value, self.q), ca.jacobian(value, self.qd)]
        ports = [self.q, self.qd, self.theta]
        return ca.Function("missing_terms", ports, blocks)(q, qd, self.theta)

    def qdd_of(self, q: ca.SX, qd: ca.SX, pressure: ca.SX, tau: ca.SX | None) -> ca.SX:
        """Forward dynamics as an expression."""
        return self.motion_of(q, qd, pressure, tau)[0]

    def motion_of(
        self, q: ca.SX, qd: ca.SX, pressure: ca.SX, tau: ca.SX | None
    ) -> tuple[ca.SX, ca.SX]:
        """Forward dynamics and the constraints' multipliers."""
        chain = self.chain
        segments = chain.segments(q)
        motion = self.inertial_motion(segments, qd)
        total = self.still if tau is None else tau
        total = total - self.missing_terms(motion)
        if self.coordinate_damping is not None:
            total = total - self.coordinate_damping * qd
        loads = self.loads(segments, qd, pressure)
        free = chain.accelerations(motion, total, loads, chain.root_acceleration())
        if not self.robot.constraints:
            return free, chain.asm.expression(0, 1)
        return constrained(self, q, qd, free)

    @cached_property
    def constraint_terms(self) -> ca.Function:
        """The constraints' phi, A and bias (q, qd, theta)."""
        return terms(self)

    def residual_of(
        self,
        q: ca.SX,
        qd: ca.SX,
        qdd: ca.SX,
        pressure: ca.SX,
        multipliers: ca.SX | None = None,
    ) -> tuple[ca.SX, list[ca.SX]]:
        """Inverse dynamics tau as an expression, and the force of each thread on disc i+1.

        Without multipliers tau holds what the constraints do.
        """
        chain = self.chain
        segments = chain.segments(q)
        motion = self.inertial_motion(segments, qd)
        needed = chain.inertial_wrenches(motion, qdd, chain.root_acceleration())
        loads = self.loads(segments, qd, pressure)
        if multipliers is not None and self.robot.constraints:
            added = reactions(self, q, multipliers)
            loads = [chain.asm.call(sum_wrench, *both) for both in zip(loads, added, strict=True)]
        net = [self.chain.asm.call(_difference, a, b) for a, b in zip(needed, loads, strict=True)]
        tau, forces = chain.project(segments, net)
        tau = tau + self.missing_terms(motion)
        if self.coordinate_damping is not None:
            tau = tau + self.coordinate_damping * qd
        return tau, forces

    def lagrangian_gradient_of(self, q: ca.SX, qd: ca.SX) -> ca.SX:
        """dL/dq at fixed qd; without the kinetic part unless `velocity_terms="full"`."""
        chain = self.chain
        segments = chain.segments(q)
        at_rest = chain.motion(segments, self.still)
        weight = chain.inertial_wrenches(at_rest, self.still, chain.root_acceleration())
        value = self.generalized(self.conservative_forces, segments, self.still)
        value = value - chain.project(segments, weight)[0]
        if self.options.velocity_terms == "full":
            value = value + chain.momenta(chain.motion(segments, qd))[1]
        return value


def _difference(a: Wrench, b: Wrench) -> Wrench:
    return a[0] - b[0], a[1] - b[1]
