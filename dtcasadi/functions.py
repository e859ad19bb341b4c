"""One builder per Function of the front door but the derivatives; `Model` says what each means."""

import itertools

import casadi as ca
import numpy as np

from .acting import enclosed, stored, touches
from .actuation import actuated, closed, observed
from .derivatives import Derivatives
from .forces.inflation import pressures_on_volume
from .graphs import Graphs


def mass_matrix(g: Graphs) -> ca.Function:
    """M(q), eq (6)."""
    derivatives = Derivatives(g, g.q, g.still, g.still, None)
    return g.function("mass_matrix", ("q", "theta"), M=derivatives.mass_matrix())


def coriolis(g: Graphs) -> ca.Function:
    """Velocity terms on the left side."""
    chain = g.chain
    segments = chain.segments(g.q)
    motion = g.inertial_motion(segments, g.qd)
    wrenches = chain.inertial_wrenches(motion, g.still, ca.DM(3, 1))
    value = chain.project(segments, wrenches)[0] + g.missing_terms(motion)
    return g.function("coriolis", ("q", "qd", "theta"), force=value)


def gravity(g: Graphs) -> ca.Function:
    """dV/dq of the weight: inverse dynamics at rest without loads."""
    chain = g.chain
    segments = chain.segments(g.q)
    motion = chain.motion(segments, g.still)
    wrenches = chain.inertial_wrenches(motion, g.still, chain.root_acceleration())
    value, _ = chain.project(segments, wrenches)
    return g.function("gravity", ("q", "theta"), force=value)


def spring(g: Graphs) -> ca.Function:
    """dV/dq of the springs."""
    value = g.generalized(g.chain.numbers.springs, g.chain.segments(g.q), g.still)
    return g.function("spring", ("q", "theta"), force=-value)


def damping(g: Graphs) -> ca.Function:
    """What the robot's own springs and damping do because of the rates."""
    value = g.lost(g.own_forces, g.chain.segments(g.q), g.qd)
    if g.coordinate_damping is not None:
        value = value + g.coordinate_damping * g.qd
    return g.function("damping", ("q", "qd", "theta"), force=value)


def inflation(g: Graphs) -> ca.Function:
    """Generalized forces of the chamber pressures, III-C."""
    forces = list(itertools.chain(*g.chamber_forces(g.pressure)))
    value = g.generalized(forces, g.chain.segments(g.q), g.still)
    return g.function("inflation", ("q", "pressure", "theta"), force=value)


def volume(g: Graphs) -> ca.Function:
    """Air between the discs of each chamber."""
    segments = g.chain.segments(g.q)
    values = []
    for k, (chamber, numbers) in enumerate(g.chambers):
        parts = pressures_on_volume(chamber.discs, numbers, g.pressure[k])
        values.append(enclosed(g.chain, parts, segments))
    value = ca.vertcat(*values) if values else g.chain.asm.expression(0, 1)
    return g.function("volume", ("q", "pressure", "theta"), V=value)


def forces(g: Graphs) -> ca.Function:
    """Generalized forces of the open list and of the theta block `wrench`."""
    value = g.generalized(g.open_forces, g.chain.segments(g.q), g.qd)
    return g.function("forces", ("q", "qd", "theta"), force=value)


def contacts(g: Graphs) -> ca.Function:
    """Every rim point that may touch an obstacle."""
    chain = g.chain
    found = touches(chain, chain.numbers.contacts, chain.segments(g.q), g.qd)
    gap, place, force = found or (chain.asm.expression(n, 0) for n in (0, 3, 3))
    return g.function("contacts", ("q", "qd", "theta"), gap=gap, place=place, force=force)


def forward_dynamics(g: Graphs) -> ca.Function:
    """Articulated-body recursion."""
    qdd = g.qdd_of(g.q, g.qd, g.pressure, g.tau)
    ports = ("q", "qd", "pressure", "tau", "theta")
    return g.function("forward_dynamics", ports, qdd=qdd)


def multipliers(g: Graphs) -> ca.Function:
    """Multipliers of the constraints."""
    _, value = g.motion_of(g.q, g.qd, g.pressure, g.tau)
    ports = ("q", "qd", "pressure", "tau", "theta")
    return g.function("multipliers", ports, multipliers=value)


def constraint_terms(g: Graphs) -> ca.Function:
    """The constraints and their derivatives."""
    empty = g.chain.asm.expression
    parts = [empty(0, 1), empty(0, g.chain.n_q), empty(0, 1)]
    if g.robot.constraints:
        parts = g.constraint_terms.call([g.q, g.qd, g.theta])
    outputs = dict(zip(("phi", "A", "bias"), parts, strict=True))
    return g.function("constraint_terms", ("q", "qd", "theta"), **outputs)


def inverse_dynamics(g: Graphs) -> ca.Function:
    """Newton-Euler recursion."""
    tau, _ = g.residual_of(g.q, g.qd, g.qdd, g.pressure)
    ports = ("q", "qd", "qdd", "pressure", "theta")
    return g.function("inverse_dynamics", ports, tau=tau)


def thread_tension(g: Graphs) -> ca.Function:
    """Pull of the threads along their directions; negative: it pushes."""
    qdd, multipliers = g.motion_of(g.q, g.qd, g.pressure, g.tau)
    _, forces = g.residual_of(g.q, g.qd, qdd, g.pressure, multipliers)
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
    """Potential energy of gravity, springs and other forces that have one."""
    segments = g.chain.segments(g.q)
    value = g.chain.field_energy(segments) + stored(g.chain, g.conservative_forces, segments)
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
    pd = _canonical_force_of(g, qd) + g.tau
    if g.robot.constraints:
        _, multipliers = g.motion_of(g.q, qd, g.pressure, g.tau)
        _, A, _ = g.constraint_terms(g.q, qd, g.theta)
        pd = pd - ca.mtimes(A.T, multipliers)
    return g.function("canonical_ode", ports, qd=qd, pd=pd)


def _rates_of(g: Graphs) -> ca.SX:
    chain = g.chain
    at_rest = chain.motion(chain.segments(g.q), g.still)
    return chain.accelerations(at_rest, g.p, chain.total(chain.none()), ca.DM(3, 1))


def _canonical_force_of(g: Graphs, qd: ca.SX) -> ca.SX:
    segments = g.chain.segments(g.q)
    value = g.lagrangian_gradient_of(g.q, qd)
    value = value + g.chain.project(segments, g.loads(segments, qd, g.pressure))[0]
    value = value - g.generalized(g.conservative_forces, segments, g.still)
    if g.coordinate_damping is not None:
        value = value - g.coordinate_damping * qd
    return value


def ode(g: Graphs) -> ca.Function:
    """State equation."""
    q, qd, a = ca.vertsplit(g.x, [0, g.chain.n_q, 2 * g.chain.n_q, g.x.shape[0]])
    pressure, rate = actuated(g, q, qd, a, g.u)
    xdot = ca.vertcat(qd, g.qdd_of(q, qd, pressure, None), rate)
    return g.function("ode", ("x", "u", "theta"), xdot=xdot)


def air(g: Graphs) -> ca.Function:
    """What happens in the chambers."""
    q, qd, a = ca.vertsplit(g.x, [0, g.chain.n_q, 2 * g.chain.n_q, g.x.shape[0]])
    pressure, _ = actuated(g, q, qd, a, g.u)
    signals, _ = observed(g, q, qd, a, g.u)
    outputs = {"pressure": signals.pressure, "effective_pressure": pressure}
    flows = {name: value for name, value in signals._asdict().items() if name != "pressure"}
    return g.function("air", ("x", "u", "theta"), **outputs, **flows)


def power(g: Graphs) -> ca.Function:
    """Power supplied by pressure and forces without an energy, and lost; energy of the actuator."""
    chain = g.chain
    q, qd, a = ca.vertsplit(g.x, [0, chain.n_q, 2 * chain.n_q, g.x.shape[0]])
    segments = chain.segments(q)
    pressure, _ = actuated(g, q, qd, a, g.u)
    _, accounts = observed(g, q, qd, a, g.u)
    everything = g.forces(pressure)
    # Air that is accounted for drives the robot by itself.
    driving = g.forces(None if closed(g) else pressure)
    supplied = g.generalized([f for f in driving if not f.stores()], segments, g.still)
    lost = g.lost(everything, segments, qd)
    if g.coordinate_damping is not None:
        lost = lost + g.coordinate_damping * qd
    parts = {
        "supplied": ca.dot(qd, supplied) + accounts.supplied,
        "dissipated": ca.dot(qd, lost) + accounts.dissipated,
        "stored": accounts.stored,
    }
    return g.function("power", ("x", "u", "theta"), **parts)
