"""One builder per Function of the front door but the derivatives; `Model` says what each means."""

import casadi as ca
import numpy as np

from .derivatives import Derivatives
from .graphs import Graphs


def mass_matrix(g: Graphs) -> ca.Function:
    """M(q), eq (6)."""
    still = g.chain.asm.expression(g.chain.n_q, 1)
    derivatives = Derivatives(g, g.q, still, still, None)
    return g.function("mass_matrix", ("q", "theta"), M=derivatives.mass_matrix())


def coriolis(g: Graphs) -> ca.Function:
    """Velocity terms on the left side."""
    chain = g.chain
    segments = chain.segments(g.q)
    motion = g.inertial_motion(segments, g.qd)
    zero = chain.asm.expression(chain.n_q, 1)
    wrenches = chain.inertial_wrenches(motion, zero, ca.DM(3, 1))
    value = chain.project(segments, wrenches)[0] + g.missing_terms(motion)
    return g.function("coriolis", ("q", "qd", "theta"), force=value)


def gravity(g: Graphs) -> ca.Function:
    """dV/dq of the weight: inverse dynamics at rest without loads."""
    chain = g.chain
    zero = chain.asm.expression(chain.n_q, 1)
    segments = chain.segments(g.q)
    motion = chain.motion(segments, zero)
    wrenches = chain.inertial_wrenches(motion, zero, chain.root_acceleration())
    value, _ = chain.project(segments, wrenches)
    return g.function("gravity", ("q", "theta"), force=value)


def spring(g: Graphs) -> ca.Function:
    """dV/dq of the springs."""
    chain = g.chain
    segments = chain.segments(g.q)
    still = chain.asm.expression(chain.n_q, 1)
    loads = chain.total(chain.pair_forces(segments, still, springs=True, damping=False))
    value, _ = chain.project(segments, loads)
    return g.function("spring", ("q", "theta"), force=-value)


def damping(g: Graphs) -> ca.Function:
    """Everything that depends on the rates but inertia."""
    return g.function("damping", ("q", "qd", "theta"), force=_damping_of(g, g.q, g.qd))


def _damping_of(g: Graphs, q: ca.SX, qd: ca.SX) -> ca.SX:
    chain = g.chain
    segments = chain.segments(q)
    still = chain.asm.expression(chain.n_q, 1)
    physical = g.options.damping == "physical"
    moving = chain.pair_forces(segments, qd, springs=True, damping=physical)
    elastic = chain.pair_forces(segments, still, springs=True, damping=False)
    both = chain.project(segments, chain.total(moving))[0]
    value = chain.project(segments, chain.total(elastic))[0] - both
    if g.coordinate_damping is not None:
        value = value + g.coordinate_damping * qd
    return value


def inflation(g: Graphs) -> ca.Function:
    """Generalized forces of the chamber pressures, III-C."""
    chain = g.chain
    segments = chain.segments(g.q)
    value, _ = chain.project(segments, chain.total(g.inflation_loads(g.pressure)))
    return g.function("inflation", ("q", "pressure", "theta"), force=value)


def forward_dynamics(g: Graphs) -> ca.Function:
    """Articulated-body recursion."""
    qdd = g.qdd_of(g.q, g.qd, g.pressure, g.tau)
    ports = ("q", "qd", "pressure", "tau", "theta")
    return g.function("forward_dynamics", ports, qdd=qdd)


def inverse_dynamics(g: Graphs) -> ca.Function:
    """Newton-Euler recursion."""
    tau, _ = g.residual_of(g.q, g.qd, g.qdd, g.pressure)
    ports = ("q", "qd", "qdd", "pressure", "theta")
    return g.function("inverse_dynamics", ports, tau=tau)


def thread_tension(g: Graphs) -> ca.Function:
    """Pull of the threads along their directions; negative: it pushes."""
    qdd = g.qdd_of(g.q, g.qd, g.pressure, g.tau)
    _, forces = g.residual_of(g.q, g.qd, qdd, g.pressure)
    tension = g.chain.tensions(g.chain.segments(g.q), forces)
    ports = ("q", "qd", "pressure", "tau", "theta")
    return g.function("thread_tension", ports, tension=tension)


def poses(g: Graphs) -> ca.Function:
    """Every disc's frame in the root frame."""
    R, r = g.chain.poses(g.chain.segments(g.q))
    return g.function("poses", ("q", "theta"), R=ca.horzcat(*R), r=ca.horzcat(*r))


def angular_jacobians(g: Graphs) -> ca.Function:
    """Table I for any number of discs."""
    chain = g.chain
    segments = chain.segments(g.q)
    # Eq (4) is linear in qd, so its Jacobian at any qd is Table I, built column by column.
    blocks = []
    for column in np.eye(chain.n_q):
        rates = chain.motion(segments, chain.asm.expression(ca.DM(column))).rates
        blocks.append(ca.vertcat(*(rate.rate for rate in rates)))
    table = ca.horzcat(*blocks) if blocks else chain.asm.expression(3 * chain.n_segments, 0)
    return g.function("angular_jacobians", ("q", "theta"), J=table)


def kinetic_energy(g: Graphs) -> ca.Function:
    """Kinetic energy."""
    motion = g.chain.motion(g.chain.segments(g.q), g.qd)
    value = g.chain.momenta(motion)[2]
    return g.function("kinetic_energy", ("q", "qd", "theta"), T=value)


def potential_energy(g: Graphs) -> ca.Function:
    """Potential energy of gravity and springs."""
    value = g.chain.potential(g.chain.segments(g.q))
    return g.function("potential_energy", ("q", "theta"), V=value)


def momenta(g: Graphs) -> ca.Function:
    """Canonical momenta."""
    motion = g.chain.motion(g.chain.segments(g.q), g.qd)
    value = g.chain.momenta(motion)[0]
    return g.function("momenta", ("q", "qd", "theta"), p=value)


def lagrangian_gradient(g: Graphs) -> ca.Function:
    """dL/dq at fixed qd."""
    value = g.lagrangian_gradient_of(g.q, g.qd)
    return g.function("lagrangian_gradient", ("q", "qd", "theta"), dL_dq=value)


def canonical_rates(g: Graphs) -> ca.Function:
    """Rates qd = M^-1 p by the articulated-body recursion at rest."""
    return g.function("canonical_rates", ("q", "p", "theta"), qd=_rates_of(g))


def canonical_force(g: Graphs) -> ca.Function:
    """dL/dq + Q: the right side of eq (7) at given rates."""
    value = _canonical_force_of(g, g.qd)
    return g.function("canonical_force", ("q", "qd", "pressure", "theta"), pd=value)


def canonical_ode(g: Graphs) -> ca.Function:
    """Eq (7): qd = M^-1 p by the recursion, pd = dL/dq + Q."""
    qd = _rates_of(g)
    ports = ("q", "p", "pressure", "tau", "theta")
    return g.function("canonical_ode", ports, qd=qd, pd=_canonical_force_of(g, qd) + g.tau)


def _rates_of(g: Graphs) -> ca.SX:
    chain = g.chain
    still = chain.motion(chain.segments(g.q), chain.asm.expression(chain.n_q, 1))
    return chain.accelerations(still, g.p, chain.total(chain.none()), ca.DM(3, 1))


def _canonical_force_of(g: Graphs, qd: ca.SX) -> ca.SX:
    chain = g.chain
    segments = chain.segments(g.q)
    zero = chain.asm.expression(chain.n_q, 1)
    loads = g.loads(segments, qd, g.pressure)
    elastic = chain.total(chain.pair_forces(segments, zero, springs=True, damping=False))
    value = g.lagrangian_gradient_of(g.q, qd)
    value = value + chain.project(segments, loads)[0] - chain.project(segments, elastic)[0]
    if g.coordinate_damping is not None:
        value = value - g.coordinate_damping * qd
    return value


def ode(g: Graphs) -> ca.Function:
    """State equation."""
    q, qd, a = ca.vertsplit(g.x, [0, g.chain.n_q, 2 * g.chain.n_q, g.x.shape[0]])
    pressure = g.options.actuator.pressure(a, g.u)
    qdd = g.qdd_of(q, qd, pressure, None)
    xdot = ca.vertcat(qd, qdd, g.options.actuator.rate(a, g.u))
    return g.function("ode", ("x", "u", "theta"), xdot=xdot)


def power(g: Graphs) -> ca.Function:
    """Power supplied by pressure and dead loads, and power dissipated: qd^T of each force."""
    chain = g.chain
    q, qd, a = ca.vertsplit(g.x, [0, chain.n_q, 2 * chain.n_q, g.x.shape[0]])
    segments = chain.segments(q)
    loads = g.inflation_loads(g.options.actuator.pressure(a, g.u))
    dead = chain.dead_loads(segments, g.options.wrenches, g.dead_load_parts())
    supplied = chain.project(segments, chain.total(loads, dead))[0]
    parts = {"supplied": ca.dot(qd, supplied), "dissipated": ca.dot(qd, _damping_of(g, q, qd))}
    return g.function("power", ("x", "u", "theta"), **parts)
