"""Builders of the derivative Functions: d qdd = -M^-1 d(inverse dynamics).

Small models are one flat SX graph; larger ones call the rigid bodies' part, the pairs' part and a
dense solve from MX, which keeps their C code small.
"""

from dataclasses import replace

import casadi as ca
import numpy as np

from .derivatives import Derivatives
from .graphs import OPTIONS, Graphs
from .linear import solve_spd


def _rigid_part(g: Graphs) -> ca.Function:
    """M, the rigid bodies' d tau/d q and d tau/d qd, and d Q/d pressure."""
    parts = Derivatives(g, g.q, g.qd, g.qdd, g.pressure)
    values = [parts.mass_matrix(), *parts.rigid(), parts.inflation_columns()]
    ports = [g.q, g.qd, g.qdd, g.pressure, g.theta]
    return ca.Function("rigid_part", ports, values, OPTIONS)


def _pair_part(g: Graphs) -> ca.Function:
    """Springs' and dampers' d tau/d q and d tau/d qd; calls, since AD makes them long."""
    if g.inlined or g.options.assembly == "graph":
        graphs = g
    else:
        graphs = Graphs(g.robot, replace(g.options, assembly="graph"), g.layout)
    parts = Derivatives(graphs, graphs.q, graphs.qd, graphs.qdd, None)
    ports = [graphs.q, graphs.qd, graphs.theta]
    return ca.Function("pair_part", ports, list(parts.pairs()), OPTIONS)


def _acceleration(g: Graphs, q: ca.SX, qd: ca.SX, pressure: ca.SX, tau: ca.SX | None) -> ca.SX:
    """Forward dynamics as an expression of the symbols' kind."""
    ports = [g.q, g.qd, g.pressure, g.theta]
    values = [q, qd, pressure, g.top("theta")]
    if tau is not None:
        ports, values = [*ports, g.tau], [*values, tau]
    qdd = g.qdd_of(g.q, g.qd, g.pressure, None if tau is None else g.tau)
    return ca.Function("acceleration", ports, [qdd], OPTIONS)(*values)


def inverse_dynamics_jacobian(g: Graphs) -> ca.Function:
    """Derivatives of Newton-Euler by recursion."""
    ports = ("q", "qd", "qdd", "pressure", "theta")
    q, qd, qdd, pressure, theta = (g.top(port) for port in ports)
    _, dq, dqd, _ = _rigid_part(g)(q, qd, qdd, pressure, theta)
    pair_q, pair_qd = _pair_part(g)(q, qd, theta)
    return g.top_function(
        "inverse_dynamics_jacobian", ports, dtau_dq=dq + pair_q, dtau_dqd=dqd + pair_qd
    )


def forward_dynamics_jacobian(g: Graphs) -> ca.Function:
    """Forward dynamics with its derivatives."""
    ports = ("q", "qd", "pressure", "tau", "theta")
    q, qd, pressure, tau, _ = (g.top(port) for port in ports)
    qdd = _acceleration(g, q, qd, pressure, tau)
    dq, dqd, dp, dtau = _acceleration_jacobian(g, q, qd, pressure, qdd, with_tau=True)
    outputs = {"dqdd_dq": dq, "dqdd_dqd": dqd, "dqdd_dpressure": dp, "dqdd_dtau": dtau}
    return g.top_function("forward_dynamics_jacobian", ports, qdd=qdd, **outputs)


def with_jacobian(function: ca.Function, g: Graphs) -> ca.Function:
    """The Function with this module's derivatives as its own, for MX graphs that call it.

    `forward_dynamics` and `ode` only; CasADi would otherwise differentiate the recursion itself,
    which takes six times the operations with four discs.
    """
    state = function.name() == "ode"
    blocks = (ode_jacobian if state else forward_dynamics_jacobian)(g)
    ports, (out,) = function.name_in(), function.name_out()
    symbols = [ca.MX.sym(port, function.size1_in(port)) for port in ports]
    value, *known = blocks.call(symbols)
    by_theta = _theta_jacobian(g)
    if state:
        x, u, theta = symbols
        n, actuator = g.chain.n_q, g.options.actuator
        q, qd, a = ca.vertsplit(x, [0, n, 2 * n, x.shape[0]])
        qdd = ca.vertsplit(value, [0, n, 2 * n, x.shape[0]])[1]
        rows = by_theta(q, qd, qdd, actuator.pressure(a, u), theta)
        rows = ca.vertcat(ca.MX(n, theta.shape[0]), rows, ca.MX(a.shape[0], theta.shape[0]))
    else:
        q, qd, pressure, _, theta = symbols
        rows = by_theta(q, qd, value, pressure, theta)
    unused = ca.MX.sym(f"out_{out}", *function.size_out(0))
    jacobian = ca.Function(
        f"jac_{function.name()}",
        [*symbols, unused],
        [*known, rows],
        [*ports, unused.name()],
        [f"jac_{out}_{port}" for port in ports],
    )
    symbols = [g.chain.asm.sym(port, function.size1_in(port)) for port in ports]
    options = {"custom_jacobian": jacobian, "jac_penalty": 0, "cse": True}
    return ca.Function(function.name(), symbols, function.call(symbols), ports, [out], options)


def _theta_jacobian(g: Graphs) -> ca.Function:
    """D qdd / d theta = -M^-1 d tau/d theta at (q, qd, qdd, pressure, theta).

    In block `frames` along rotations only: off them A^T is no inverse, and no number has a meaning.
    """
    tau, _ = g.residual_of(g.q, g.qd, g.qdd, g.pressure)
    mass = Derivatives(g, g.q, g.qd, g.qdd, None).mass_matrix()
    ports = [g.q, g.qd, g.qdd, g.pressure, g.theta]
    parts = ca.Function("theta_part", ports, [mass, ca.jacobian(tau, g.theta)], OPTIONS)
    symbols = [ca.MX.sym(f"a{i}", port.shape[0]) for i, port in enumerate(ports)]
    M, by_theta = parts.call(symbols)
    return ca.Function("theta_jacobian", symbols, [solve_spd(M, -by_theta, native=False)])


def ode_jacobian(g: Graphs) -> ca.Function:
    """State equation with its Jacobians."""
    x, u = g.top("x"), g.top("u")
    n, actuator = g.chain.n_q, g.options.actuator
    q, qd, a = ca.vertsplit(x, [0, n, 2 * n, x.shape[0]])
    pressure = actuator.pressure(a, u)
    qdd = _acceleration(g, q, qd, pressure, None)
    dq, dqd, dp = _acceleration_jacobian(g, q, qd, pressure, qdd, with_tau=False)
    rate_a, rate_u, pressure_a, pressure_u = _actuator_jacobian(g, a, u)
    zero = type(x)
    n_a, n_u = a.shape[0], u.shape[0]
    F_x = ca.vertcat(
        ca.horzcat(zero(n, n), zero.eye(n), zero(n, n_a)),
        ca.horzcat(dq, dqd, ca.mtimes(dp, pressure_a)),
        ca.horzcat(zero(n_a, 2 * n), rate_a),
    )
    F_u = ca.vertcat(zero(n, n_u), ca.mtimes(dp, pressure_u), rate_u)
    xdot = ca.vertcat(qd, qdd, actuator.rate(a, u))
    ports = ("x", "u", "theta")
    return g.top_function("ode_jacobian", ports, xdot=xdot, F_x=F_x, F_u=F_u)


def _actuator_jacobian(g: Graphs, a: ca.SX, u: ca.SX) -> list[ca.SX]:
    """Derivatives of the actuator's rate and pressure for its states and commands."""
    actuator = g.options.actuator
    local, command = ca.SX.sym("a", a.shape[0]), ca.SX.sym("u", u.shape[0])
    parts = (actuator.rate(local, command), actuator.pressure(local, command))
    blocks = [ca.jacobian(part, by) for part in parts for by in (local, command)]
    return ca.Function("actuator_jacobian", [local, command], blocks).call([a, u])


def _acceleration_jacobian(
    g: Graphs, q: ca.SX, qd: ca.SX, pressure: ca.SX, qdd: ca.SX, *, with_tau: bool
) -> list[ca.SX]:
    """D qdd = -M^-1 d(inverse dynamics), for q, qd, pressure and where asked tau."""
    theta = g.top("theta")
    M, dq, dqd, columns = _rigid_part(g)(q, qd, qdd, pressure, theta)
    pair_q, pair_qd = _pair_part(g)(q, qd, theta)
    n, n_u = g.chain.n_q, pressure.shape[0]
    rhs = [-(dq + pair_q), -(dqd + pair_qd), columns]
    if with_tau:
        rhs.append(type(q).eye(n))
    solution = solve_spd(M, ca.horzcat(*rhs), native=g.native)
    sizes = np.cumsum([0, n, n, n_u] + [n] * with_tau).tolist()
    return ca.horzsplit(solution, sizes)
