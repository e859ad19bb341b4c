"""The symbols of a model, and the expressions its Functions share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from .actuators import Actuator
from .assemble import Flat, Graph
from .chain import Chain, Motion, Wrench
from .charts import Chart
from .linear import UNROLLED
from .numbers import Theta, numbers_of
from .robot import Robot

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
            [chamber.discs for chamber in robot.chambers],
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

    def inflation_loads(self, pressure: ca.SX | list) -> list[list[Wrench]]:
        """`last_disc` wrenches of all chambers."""
        centroids = [ca.DM(np.array(c.centroids)).T for c in self.robot.chambers]
        return self.chain.inflation(pressure, centroids)

    def loads(
        self, segments: list, qd: ca.SX, pressure: ca.SX | None, *, elastic: bool = True
    ) -> list[Wrench]:
        """All wrenches on discs but gravity: springs, physical damping, pressure, dead loads."""
        chain = self.chain
        groups = [chain.pair_forces(segments, qd, elastic, self.options.damping == "physical")]
        if pressure is not None:
            groups.append(self.inflation_loads(pressure))
        if self.options.wrenches:
            load = self.dead_load_parts()
            groups.append(chain.dead_loads(segments, self.options.wrenches, load))
        return chain.total(*groups)

    @cached_property
    def with_calls(self) -> "Graphs":
        """These graphs as calls of per-segment Functions, unless one flat graph is small enough."""
        if self.inlined or self.options.assembly == "graph":
            return self
        options = replace(self.options, assembly="graph")
        return Graphs(self.robot, options, self.layout, native=self.native)

    def dead_load_parts(self) -> ca.SX:
        """The theta block `wrench`, six numbers per named disc."""
        return self.theta[self.layout.blocks.get("wrench", slice(0, 0))]

    def inertial_motion(self, segments: list, qd: ca.SX) -> Motion:
        """The motion whose velocity terms count: none of them with `velocity_terms="none"`."""
        zero = self.chain.asm.expression(self.chain.n_q, 1)
        return self.chain.motion(segments, zero if self.options.velocity_terms == "none" else qd)

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
        chain = self.chain
        segments = chain.segments(q)
        motion = self.inertial_motion(segments, qd)
        total = chain.asm.expression(chain.n_q, 1) if tau is None else tau
        total = total - self.missing_terms(motion)
        if self.coordinate_damping is not None:
            total = total - self.coordinate_damping * qd
        loads = self.loads(segments, qd, pressure)
        return chain.accelerations(motion, total, loads, chain.root_acceleration())

    def residual_of(
        self, q: ca.SX, qd: ca.SX, qdd: ca.SX, pressure: ca.SX
    ) -> tuple[ca.SX, list[ca.SX]]:
        """Inverse dynamics tau as an expression, and the force of each thread on disc i+1."""
        chain = self.chain
        segments = chain.segments(q)
        motion = self.inertial_motion(segments, qd)
        needed = chain.inertial_wrenches(motion, qdd, chain.root_acceleration())
        loads = self.loads(segments, qd, pressure)
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
        zero = chain.asm.expression(chain.n_q, 1)
        still = chain.motion(segments, zero)
        weight = chain.inertial_wrenches(still, zero, chain.root_acceleration())
        elastic = chain.total(chain.pair_forces(segments, zero, springs=True, damping=False))
        value = chain.project(segments, elastic)[0] - chain.project(segments, weight)[0]
        if self.options.velocity_terms == "full":
            value = value + chain.momenta(chain.motion(segments, qd))[1]
        return value


def _difference(a: Wrench, b: Wrench) -> Wrench:
    return a[0] - b[0], a[1] - b[1]
