"""The model of a robot: named CasADi Functions, their compiled twins, and its parameters."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from . import jacobians, recentring
from .actuators import Actuator, actuator_of
from .bound import MATRICES, Bound
from .builders import BUILDERS
from .charts import Chart, charts_of
from .checks import choice, shown
from .compile import DEFAULT_FLAGS, twin
from .errors import ModelError
from .forces.inflation import INFLATION
from .graphs import Graphs, Options
from .numbers import theta_layout
from .robot import Robot
from .sampled import Sensors

if TYPE_CHECKING:
    from .discrete import DiscreteModel

# Above this number of discs a call graph compiles faster than it runs slower;
# benchmarks/results/compile_size.md has the figures behind it.
FLAT_UP_TO = 8


class _Graph:
    """A Function of the model, built on first use."""

    def __init__(self, doc: str):
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, model: "Model | None", owner: type) -> Any:
        """The CasADi Function (or this descriptor from the class, for its documentation)."""
        return self if model is None else model.function(self._name)


class Model:
    """A robot's equations of motion as named CasADi Functions.

        M(q) qdd + coriolis(q, qd) + gravity(q) + spring(q) + damping(q, qd)
            = inflation(q, pressure) + forces(q, qd) + tau

    Every Function is symbolic (DM, SX or MX, positional or by keyword, differentiable) and has
    `theta` as its last port; `model.theta0` holds the robot's own numbers. `compiled(name)` gives
    its C twin. `forward_dynamics` and `ode` carry their
    derivative from `jacobians`. Made by `dtcasadi.build`; immutable.

    Attributes:
        robot: the robot it was built from.
        options: what it was built with.
        n_q: number of generalized coordinates.
        n_x: number of states, x = [q; qd; actuator states].
        n_u: number of commands, one per chamber.
        theta0: parameters as the robot has them, shape (n_theta,).
        theta_blocks: name of each block of theta -> its slice.
        centres: where each segment that can re-centre is found in q and theta.
        state_names: one name per state.
        interpreted: Functions that `compiled` leaves to CasADi's virtual machine, where compiling
            would take minutes; with `ode_jacobian`, implicit steps stay there too.
        flags: compiler flags of whatever is compiled for it.
    """

    mass_matrix = _Graph("M(q, theta), shape (n_q, n_q), eq (6).")
    coriolis = _Graph("Velocity terms (q, qd, theta), shape (n_q,) [N m], by `velocity_terms`.")
    gravity = _Graph("dV_gravity/dq (q, theta), shape (n_q,) [N m].")
    spring = _Graph("dV_spring/dq (q, theta), shape (n_q,) [N m], eq (5).")
    damping = _Graph("Damping (q, qd, theta) on the left side, shape (n_q,) [N m].")
    inflation = _Graph("Q (q, pressure, theta) of the chambers, shape (n_q,) [N m], III-C.")
    volume = _Graph("V (q, pressure, theta) of each chamber's air, shape (n_u,) [m^3].")
    forces = _Graph(
        "Q (q, qd, theta) of the robot's forces and block `wrench`, shape (n_q,) [N m]."
    )
    contacts = _Graph(
        "Rim points: gap (n,) [m], place (3, n) [m], force (3, n) [N] (q, qd, theta)."
    )
    forward_dynamics = _Graph("qdd (q, qd, pressure, tau, theta), shape (n_q,) [rad/s^2].")
    multipliers = _Graph("lambda (q, qd, pressure, tau, theta) of the constraints [N], eq (7).")
    constraint_terms = _Graph("phi (m,) [m], A_q (m, n_q), bias dA_q/dt qd (m,) (q, qd, theta).")
    inverse_dynamics = _Graph("tau (q, qd, qdd, pressure, theta), shape (n_q,) [N m].")
    thread_tension = _Graph("Tensions (q, qd, pressure, tau, theta), shape (n_discs - 1,) [N].")
    poses = _Graph("R (3, 3 n_discs) and r (3, n_discs) [m] in the root frame (q, theta).")
    angular_jacobians = _Graph("Table I (q, theta): d omega_i / d qd, disc frames, stacked.")
    kinetic_energy = _Graph("T (q, qd, theta) [J].")
    potential_energy = _Graph("V (q, theta) of gravity, springs, conservative forces [J].")
    momenta = _Graph("Canonical momenta p = M qd (q, qd, theta), shape (n_q,), eq (7).")
    lagrangian_gradient = _Graph("dL/dq (q, qd, theta) at fixed qd, shape (n_q,) [N m], eq (7).")
    canonical_ode = _Graph("Eq (7): qd and pd (q, p, pressure, tau, theta).")
    ode = _Graph("State equation xdot (x, u, theta), shape (n_x,).")
    air = _Graph("Chambers (x, u, theta): pressure, effective_pressure [Pa], flows [kg/s].")
    power = _Graph("supplied, dissipated [W], stored by the actuator [J] (x, u, theta).")
    ode_jacobian = _Graph("xdot, F_x, F_u (x, u, theta) of the state equation, exact.")
    inverse_dynamics_jacobian = _Graph("d tau/d q and d tau/d qd (q, qd, qdd, pressure, theta).")
    forward_dynamics_jacobian = _Graph("qdd and its derivatives (q, qd, pressure, tau, theta).")

    def __init__(self, robot: Robot, options: Options):
        self.robot, self.options = robot, options
        frames = _recentring_segments(options)
        free = options.wrenches, options.parameters
        theta = theta_layout(robot, options.actuator, frames, *free)
        self.theta0, self.theta_blocks = theta.values, dict(theta.blocks)
        self.n_q = sum(chart.words.n_q for chart in options.charts)
        self.n_u = len(robot.chambers)
        actuator = options.actuator.state_names(self.n_u)
        self.n_x = 2 * self.n_q + len(actuator)
        self.coordinate_names = tuple(
            f"{name}_{i}"
            for i, chart in enumerate(options.charts, 1)
            for name in chart.coordinate_names
        )
        rates = tuple(f"{name}_rate" for name in self.coordinate_names)
        self.state_names = self.coordinate_names + rates + actuator
        self.centres = recentring.places(options.charts, self.theta_blocks)
        self._graphs = Graphs(robot, options, theta)
        self._native = Graphs(robot, options, theta, native=True)
        self._functions: dict[str, ca.Function] = {}
        self._compiled: dict[str, ca.Function] = {}
        self.interpreted: set[str] = set()
        self.flags: tuple[str, ...] = DEFAULT_FLAGS
        self._kept: dict[Hashable, Any] = {}

    @property
    def n_discs(self) -> int:
        """Number of discs, the root included."""
        return self.robot.n_discs

    @property
    def charts(self) -> tuple[Chart, ...]:
        """The chart of each segment."""
        return self.options.charts

    @property
    def actuator(self) -> Actuator:
        """How commands become pressures."""
        return self.options.actuator

    @property
    def recentres(self) -> bool:
        """Whether some segment's A and B, theta block `frames`, may absorb its pose."""
        return bool(self.centres)

    def rebuilt(self, charts: Sequence[Chart]) -> "Model":
        """The same robot and options with other charts, one per segment."""
        return Model(self.robot, replace(self.options, charts=tuple(charts)))

    def recentre(
        self, x: np.ndarray, theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same motion about new centres where a coordinate has left 45 degrees.

        Returns:
            x, theta, and T, shape (n_x, n_x), which maps a covariance P of x to T P T^T: the
            identity where nothing needs it or the model cannot re-centre. See
            `dtcasadi.recentring`.

        Raises:
            ModelError: wrong shapes, or a state to re-centre that is not finite.
        """
        return recentring.recentre(self, x, theta)

    def function(self, name: str) -> ca.Function:
        """The symbolic Function of a name.

        Raises:
            ModelError: unknown name.
        """
        if name not in self._functions:
            function = self.plain(name)
            if name in ("forward_dynamics", "ode") and not self.robot.constraints:
                blocks = self.function(f"{name}_jacobian")
                function = jacobians.with_jacobian(function, blocks, self._graphs)
            self._functions[name] = function
        return self._functions[name]

    def compiled(self, name: str) -> Bound:
        """The C twin of a Function as a call on arrays, compiled on first use and cached.

        Each call of `compiled` returns a new `Bound` with its own buffers: take one per thread.
        Without a C compiler it runs in CasADi's virtual machine and says so once.

        Raises:
            ModelError: unknown name.
        """
        if name not in self._compiled:
            function = self.plain(name)
            stays = name in self.interpreted
            if not stays:
                function = twin(function, source=self.native(name), flags=self.flags)
            self._compiled[name] = function
        function = self._compiled[name]
        ports = MATRICES.intersection(function.name_out())
        return Bound(function, matrices=ports, name=name)

    def discrete(
        self,
        step_s: float,
        *,
        method: str | None = None,
        exact: bool = True,
        sensors: Sensors = (),
    ) -> "DiscreteModel":
        """The model in steps of a fixed size, for estimators, controllers and C export.

        Args:
            step_s: step [s].
            method: a name of `dtcasadi.integrators.ONE_STEP`; default: `sdirk2`, L-stable and of
                order 2, or `moreau` with rigid contact.
            exact: exact derivatives in `linearize`, or the method's cheaper form.
            sensors: what is measured, values of `dtcasadi.sensors`.

        Raises:
            ModelError: an unknown method, a step that is not positive, or an unusable sensor.
        """
        from .discrete import discretize

        return discretize(self, step_s, method, exact=exact, sensors=sensors)

    def plain(self, name: str) -> ca.Function:
        """The Function without a derivative of its own.

        Raises:
            ModelError: unknown name.
        """
        if name not in BUILDERS:
            raise ModelError(f"function: expected one of {', '.join(BUILDERS)}, got {name!r}")
        return self.once(("plain", name), lambda: BUILDERS[name](self._graphs))

    def native(self, name: str) -> ca.Function:
        """The Function with hand-written C kernels inside, for code generation only."""
        return self.once(("native", name), lambda: BUILDERS[name](self._native))

    def once(self, key: Hashable, build: Callable[[], Any]) -> Any:
        """What `build` returns, made on the first call with this key and kept with the model."""
        if key not in self._kept:
            self._kept[key] = build()
        return self._kept[key]

    @property
    def graphs(self) -> tuple[Graphs, Graphs]:
        """The symbols and shared expressions, with C kernels (generated code only) and without."""
        return self._native, self._graphs

    def __repr__(self) -> str:
        """Size and options on one line."""
        charts = sorted({chart.name for chart in self.charts})
        return f"Model({self.n_discs} discs, {'/'.join(charts)}, n_q={self.n_q}, n_x={self.n_x})"


def _recentring_segments(options: Options) -> tuple[int, ...]:
    """Segments whose A and B are parameters; the paper's damping ties a model to its chart."""
    if options.damping != "physical":
        return ()
    return tuple(i for i, chart in enumerate(options.charts) if chart.recentres)


def build(
    robot: Robot,
    *,
    chart: str | Sequence[str] = "cardan",
    velocity_terms: str = "full",
    damping: str = "physical",
    inflation: str = "last_disc",
    actuator: str | Actuator = "direct",
    parameters: Sequence[str] = (),
    wrenches: Sequence[int] = (),
    assembly: str = "auto",
) -> Model:
    """Build the model of a robot.

    Args:
        robot: the robot.
        chart: `cardan`, `paper`, `planar`, `hinge`, `ball`, `rigid`, or a list, one per segment.
        velocity_terms: `full`; `paper` (eq (7) without 1/2 qd^T (dM/dq) qd); `none`.
        damping: `physical` (independent of the chart) or `coordinate` (the paper's b = c_a on every
            coordinate rate).
        inflation: `last_disc` (III-C: a chamber's pressure on its last disc, its reaction on the
            first) or `volume` (pressure * dV/dq of the air between the discs).
        actuator: `direct`, `regulator` or an actuator value; see `dtcasadi.actuators`.
        parameters: fields of robot and actuator to leave free in theta, for example
            `springs.stiffness` or `actuator.time_constant`.
        wrenches: numbers of discs that carry a free external load in the root frame, theta block
            `wrench` ([force; moment about the disc's origin] each) [N, N m].
        assembly: `flat` (one SX graph), `graph` (calls of per-segment Functions), `auto` (by size).

    Returns:
        The model.

    Raises:
        ModelError: an option is unknown; the text says what is valid.
        ChartError: an unknown chart.
    """
    if not isinstance(robot, Robot):
        raise ModelError(f"robot: expected a Robot, got {shown(robot)}")
    choice("velocity_terms", velocity_terms, ("full", "paper", "none"))
    choice("damping", damping, ("physical", "coordinate"))
    choice("inflation", inflation, tuple(INFLATION))
    choice("assembly", assembly, ("auto", "flat", "graph"))
    if assembly == "auto":
        assembly = "flat" if robot.n_discs <= FLAT_UP_TO else "graph"
    discs = tuple(wrenches)
    for disc in discs:
        if isinstance(disc, bool) or disc not in range(2, robot.n_discs + 1):
            raise ModelError(f"wrenches: expected discs from 2 to {robot.n_discs}, got {disc!r}")
    if len(set(discs)) != len(discs):
        raise ModelError(f"wrenches: expected each disc once, got {discs}")
    charts = charts_of(chart, robot.n_discs - 1)
    if not any(each.words.n_q for each in charts):
        raise ModelError("chart: expected at least one segment that moves, got rigid for all")
    driver = actuator_of(actuator)
    driver.fit(len(robot.chambers), inflation)
    options = Options(
        charts=charts,
        velocity_terms=velocity_terms,
        damping=damping,
        inflation=inflation,
        actuator=driver,
        parameters=tuple([parameters] if isinstance(parameters, str) else parameters),
        wrenches=discs,
        assembly=assembly,
    )
    return Model(robot, options)
