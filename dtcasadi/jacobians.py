"""Builders of the derivative Functions: d qdd = -M^-1 d(inverse dynamics).

Small models are one flat SX graph; larger ones call per-segment Functions and a dense solve from
MX, which is as fast and compiles in a fraction of the time (benchmarks/results/compile_size.md).
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from . import functions
from .actuation import Actuation
from .constraints.derivatives import constrained_columns, multipliers_of
from .derivatives import Derivatives
from .graphs import OPTIONS, Graphs
from .linear import solve_spd


class ImplicitForm(NamedTuple):
    """The state equation as residual(q, v, z, a, zdot, u, theta) = 0, for implicit methods.

    With z the actuator states and xi = (a; zdot) the highest derivatives,

        residual = (inverse dynamics tau(q, v, a, pressure(q, v, z, u)); zdot - rate(q, v, z, u)),

    and `jacobian` gives d residual/d xi = M, d/d(v; z) = D, d/d(q; -) = K, shape (m, m) each with
    m = n_q + n_z (columns of z in K are zero), d/d u = U, shape (m, n_u), and T, shape
    (m, n_theta - n_frames), for theta behind its block `frames`, which only re-centring changes.
    """

    n_q: int
    n_z: int
    residual: ca.Function
    jacobian: ca.Function


def implicit_form(g: Graphs) -> ImplicitForm:
    """The implicit form of a model's state equation and its derivatives by recursion."""
    if g.robot.constraints:
        return _explicit_form(g)
    n, actuation = g.chain.n_q, Actuation.of(g)
    n_z, n_u = g.x.shape[0] - 2 * n, g.u.shape[0]
    sizes = (n, n, n_z, n, n_z, n_u, g.theta.shape[0])
    names = ("q", "v", "z", "a", "zdot", "u", "theta")
    ports = [g.chain.asm.sym(name, size) for name, size in zip(names, sizes, strict=True)]
    q, v, z, a, zdot, u, theta = ports
    tau, _ = g.residual_of(g.q, g.qd, g.qdd, g.pressure)
    inner = ca.Function("tau", [g.q, g.qd, g.qdd, g.pressure, g.theta], [tau], OPTIONS)
    pressure, rate = actuation.values(q, v, z, u, theta)
    balance = ca.vertcat(inner(q, v, a, pressure, theta), zdot - rate)
    residual = ca.Function(
        "implicit_residual", ports, [balance], list(names), ["residual"], OPTIONS
    )

    kind = ca.SX if g.inlined else ca.MX
    ports = [kind.sym(name, size) for name, size in zip(names, sizes, strict=True)]
    q, v, z, a, zdot, u, theta = ports
    at = (q, v, z, u, theta)
    pressure, _ = actuation.values(*at)
    M, dq, dqd, columns = _rigid_part(g)(q, v, a, pressure, theta)
    pair_q, pair_qd = _between_part(g)(q, v, pressure, theta)
    slopes = actuation.slopes(*at)
    by_q, by_v, by_z, by_u = (-ca.mtimes(columns, slope) for slope in slopes[:4])
    rate_q, rate_v, rate_z, rate_u = (-slope for slope in slopes[4:])
    by_theta, rate_theta = (-part for part in actuation.by_theta(*at))
    by_theta = _free_theta_part(g)(q, v, a, pressure, theta) + ca.mtimes(columns, by_theta)
    empty = kind(n + n_z, n_z)
    blocks = {
        "M": ca.diagcat(M, kind.eye(n_z)),
        "D": ca.blockcat([[dqd + pair_qd + by_v, by_z], [rate_v, rate_z]]),
        "K": ca.horzcat(ca.vertcat(dq + pair_q + by_q, rate_q), empty),
        "U": ca.vertcat(by_u, rate_u),
        "T": ca.vertcat(by_theta, rate_theta),
    }
    values = [ca.densify(block) for block in blocks.values()]
    jacobian = ca.Function("implicit_jacobian", ports, values, list(names), list(blocks), OPTIONS)
    return ImplicitForm(n, n_z, residual, jacobian)


def _explicit_form(g: Graphs) -> ImplicitForm:
    """The same with the accelerations solved for: their multipliers are no unknowns of a method."""
    n, n_z, n_u = g.chain.n_q, g.x.shape[0] - 2 * g.chain.n_q, g.u.shape[0]
    sizes = (n, n, n_z, n, n_z, n_u, g.theta.shape[0])
    names = ["q", "v", "z", "a", "zdot", "u", "theta"]
    rate, slopes, asm = functions.ode(g), ode_jacobian(g), g.chain.asm
    ports = [asm.sym(name, size) for name, size in zip(names, sizes, strict=True)]
    q, v, z, a, zdot, u, theta = ports
    balance = ca.vertcat(a, zdot) - rate(ca.vertcat(q, v, z), u, theta)[n:]
    residual = ca.Function("implicit_residual", ports, [balance], names, ["residual"], OPTIONS)

    kind = ca.SX if g.inlined else ca.MX
    ports = [kind.sym(name, size) for name, size in zip(names, sizes, strict=True)]
    q, v, z, a, zdot, u, theta = ports
    _, F_x, F_u = slopes(ca.vertcat(q, v, z), u, theta)
    by_theta = ca.Function(
        "by_theta", [g.x, g.u, g.theta], [ca.jacobian(rate(g.x, g.u, g.theta), g.theta)]
    )
    T = by_theta(ca.vertcat(q, v, z), u, theta)[n:, g.n_frames :]
    blocks = {
        "M": kind.eye(n + n_z),
        "D": -F_x[n:, n:],
        "K": ca.horzcat(-F_x[n:, :n], kind(n + n_z, n_z)),
        "U": -F_u[n:, :],
        "T": -T,
    }
    values = [ca.densify(block) for block in blocks.values()]
    jacobian = ca.Function("implicit_jacobian", ports, values, names, list(blocks), OPTIONS)
    return ImplicitForm(n, n_z, residual, jacobian)


def _free_theta_part(g: Graphs) -> ca.Function:
    """Derivatives d tau / d theta behind block `frames` at (q, qd, qdd, pressure, theta)."""
    columns = g.chain.asm.expression(g.chain.n_q, 0)
    if g.n_frames < g.theta.shape[0]:
        tau, _ = g.residual_of(g.q, g.qd, g.qdd, g.pressure)
        columns = ca.jacobian(tau, g.theta)[:, g.n_frames :]
    ports = [g.q, g.qd, g.qdd, g.pressure, g.theta]
    return ca.Function("theta_columns", ports, [columns], OPTIONS)


def _rigid_part(g: Graphs) -> ca.Function:
    """M, the rigid bodies' d tau/d q and d tau/d qd, and d Q/d pressure."""
    calls = g.with_calls
    parts = Derivatives(calls, calls.q, calls.qd, calls.qdd, calls.pressure)
    values = [parts.mass_matrix(), *parts.rigid(), parts.inflation_columns()]
    ports = [calls.q, calls.qd, calls.qdd, calls.pressure, calls.theta]
    return ca.Function("rigid_part", ports, values, OPTIONS)


def _between_part(g: Graphs) -> ca.Function:
    """The share of forces between discs, d tau/d q and d tau/d qd."""
    calls = g.with_calls
    parts = Derivatives(calls, calls.q, calls.qd, calls.qdd, calls.pressure)
    ports = [calls.q, calls.qd, calls.pressure, calls.theta]
    return ca.Function("between_part", ports, list(parts.between()), OPTIONS)


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
    pair_q, pair_qd = _between_part(g)(q, qd, pressure, theta)
    return g.top_function(
        "inverse_dynamics_jacobian", ports, dtau_dq=dq + pair_q, dtau_dqd=dqd + pair_qd
    )


def linear_form(g: Graphs) -> ca.Function:
    """Small motion about rest, M qdd + D qd + K (q - q0) = 0: M, D, K (q, pressure, theta)."""
    q, pressure, theta = (g.top(port) for port in ("q", "pressure", "theta"))
    still = type(q)(q.shape[0], 1)
    M, dq, dqd, _ = _rigid_part(g)(q, still, still, pressure, theta)
    pair_q, pair_qd = _between_part(g)(q, still, pressure, theta)
    ports = ("q", "pressure", "theta")
    return g.top_function("linear_form", ports, M=M, D=dqd + pair_qd, K=dq + pair_q)


def forward_dynamics_jacobian(g: Graphs) -> ca.Function:
    """Forward dynamics with its derivatives."""
    ports = ("q", "qd", "pressure", "tau", "theta")
    q, qd, pressure, tau, _ = (g.top(port) for port in ports)
    qdd = _acceleration(g, q, qd, pressure, tau)
    dq, dqd, dp, dtau = _acceleration_jacobian(g, q, qd, pressure, qdd, tau)
    outputs = {"dqdd_dq": dq, "dqdd_dqd": dqd, "dqdd_dpressure": dp, "dqdd_dtau": dtau}
    return g.top_function("forward_dynamics_jacobian", ports, qdd=qdd, **outputs)


def with_jacobian(plain: ca.Function, blocks: ca.Function, g: Graphs) -> ca.Function:
    """The Function with the recursion's derivatives as its own, for MX graphs that call it.

    CasADi would otherwise differentiate the forward recursion itself, which takes six times the
    operations with four discs. Derivatives for the theta block `frames`, which only re-centring
    changes, are left at zero.

    Args:
        plain: `forward_dynamics` or `ode`.
        blocks: its value and derivatives, `forward_dynamics_jacobian` or `ode_jacobian`.
        g: the model's graphs.
    """
    ports, (out,) = plain.name_in(), plain.name_out()
    symbols = [ca.MX.sym(port, plain.size1_in(port)) for port in ports]
    value, *known = blocks.call(symbols)
    n_theta = symbols[-1].shape[0]
    if n_theta == g.n_frames:
        rows = ca.MX(plain.size1_out(0), n_theta)
    elif plain.name() == "ode":
        x, u, theta = symbols
        n, actuation = g.chain.n_q, Actuation.of(g)
        sizes = [0, n, 2 * n, x.shape[0]]
        q, qd, z = ca.vertsplit(x, sizes)
        qdd = ca.vertsplit(value, sizes)[1]
        at = (q, qd, z, u, theta)
        pressures, rates = actuation.by_theta(*at)
        rows = _theta_jacobian(g)(q, qd, qdd, actuation.values(*at)[0], theta, pressures)
        rates = ca.horzcat(ca.MX(z.shape[0], g.n_frames), rates)
        rows = ca.vertcat(ca.MX(n, n_theta), rows, rates)
    else:
        q, qd, pressure, _, theta = symbols
        held = ca.MX(pressure.shape[0], n_theta - g.n_frames)
        rows = _theta_jacobian(g)(q, qd, value, pressure, theta, held)
    unused = ca.MX.sym(f"out_{out}", *plain.size_out(0))
    jacobian = ca.Function(
        f"jac_{plain.name()}",
        [*symbols, unused],
        [*known, rows],
        [*ports, unused.name()],
        [f"jac_{out}_{port}" for port in ports],
    )
    symbols = [g.chain.asm.sym(port, plain.size1_in(port)) for port in ports]
    options = {"custom_jacobian": jacobian, "jac_penalty": 0, "cse": True}
    return ca.Function(plain.name(), symbols, plain.call(symbols), ports, [out], options)


def _theta_jacobian(g: Graphs) -> ca.Function:
    """Derivative for theta but `frames`, -M^-1 d tau/d theta, at (q, qd, qdd, pressure, theta).

    The last port is the derivative of the pressure, shape (n_u, n_theta - n_frames).
    """
    parts = Derivatives(g, g.q, g.still, g.still, g.pressure)
    ports = [g.q, g.qd, g.qdd, g.pressure, g.theta]
    matrices = [parts.mass_matrix(), parts.inflation_columns()]
    matrices_of = ca.Function("matrices", [g.q, g.pressure, g.theta], matrices, OPTIONS)
    symbols = [ca.MX.sym(f"a{i}", port.shape[0]) for i, port in enumerate(ports)]
    pressures = ca.MX.sym("pressures", g.u.shape[0], g.theta.shape[0] - g.n_frames)
    mass, columns = matrices_of(symbols[0], *symbols[3:])
    push = ca.mtimes(columns, pressures) - _free_theta_part(g)(*symbols)
    solution = ca.horzcat(ca.MX(g.chain.n_q, g.n_frames), solve_spd(mass, push, native=False))
    return ca.Function("theta_jacobian", [*symbols, pressures], [solution])


def ode_jacobian(g: Graphs) -> ca.Function:
    """State equation with its Jacobians."""
    x, u = g.top("x"), g.top("u")
    n, actuation = g.chain.n_q, Actuation.of(g)
    q, qd, z = ca.vertsplit(x, [0, n, 2 * n, x.shape[0]])
    at = (q, qd, z, u, g.top("theta"))
    pressure, rate = actuation.values(*at)
    qdd = _acceleration(g, q, qd, pressure, None)
    dq, dqd, dp = _acceleration_jacobian(g, q, qd, pressure, qdd)
    slopes = actuation.slopes(*at)
    by_q, by_v, by_z, by_u = (ca.mtimes(dp, slope) for slope in slopes[:4])
    zero = type(x)
    F_x = ca.vertcat(
        ca.horzcat(zero(n, n), zero.eye(n), zero(n, z.shape[0])),
        ca.horzcat(dq + by_q, dqd + by_v, by_z),
        ca.horzcat(*slopes[4:7]),
    )
    F_u = ca.vertcat(zero(n, u.shape[0]), by_u, slopes[7])
    xdot = ca.vertcat(qd, qdd, rate)
    ports = ("x", "u", "theta")
    return g.top_function("ode_jacobian", ports, xdot=xdot, F_x=F_x, F_u=F_u)


def _acceleration_jacobian(
    g: Graphs, q: ca.SX, qd: ca.SX, pressure: ca.SX, qdd: ca.SX, tau: ca.SX | None = None
) -> list[ca.SX]:
    """Derivatives d qdd = -M^-1 d(inverse dynamics), for q, qd, pressure and where asked tau."""
    theta = g.top("theta")
    M, dq, dqd, columns = _rigid_part(g)(q, qd, qdd, pressure, theta)
    pair_q, pair_qd = _between_part(g)(q, qd, pressure, theta)
    n, n_u = g.chain.n_q, pressure.shape[0]
    rhs = [-(dq + pair_q), -(dqd + pair_qd), columns]
    if tau is not None:
        rhs.append(type(q).eye(n))
    if not g.robot.constraints:
        sizes = np.cumsum([0, n, n, n_u] + [n] * (tau is not None)).tolist()
        return ca.horzsplit(solve_spd(M, ca.horzcat(*rhs), native=g.native), sizes)
    applied = type(q)(n, 1) if tau is None else tau
    held = multipliers_of(g)(q, qd, pressure, applied, theta)
    return constrained_columns(g, M, rhs, [q, qd, qdd, held, theta])
