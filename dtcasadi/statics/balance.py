"""The balance of forces at rest along a path of loads, as CasADi Functions."""

import casadi as ca

from .. import functions
from ..graphs import OPTIONS, Graphs
from ..jacobians import linear_form
from ..linear import Factored


def balance(g: Graphs) -> ca.Function:
    """What is missing at rest, and its derivatives.

        residual(q, s) = gravity + spring - inflation - other forces - tau

    Ports q, s and the fields of `LoadPath`; outputs residual (n_q,) [N m]; load, the largest sum of
    absolute parts of a coordinate [N m]; K = d residual/dq, M and D = d residual/d(qd, qdd),
    (n_q, n_q) each; slope = d residual/ds (n_q,).
    """
    kind = ca.SX if g.inlined else ca.MX
    n, n_u, n_theta = g.chain.n_q, g.pressure.shape[0], g.theta.shape[0]
    sizes = {"q": n, "s": 1, "pressure": n_u, "tau": n, "theta": n_theta}
    sizes |= {"d_pressure": n_u, "d_tau": n, "d_theta": n_theta}
    port = {name: kind.sym(name, size) for name, size in sizes.items()}
    loads = [port[name] + port["s"] * port[f"d_{name}"] for name in ("pressure", "tau", "theta")]
    directions = [port[name] for name in ("d_pressure", "d_tau", "d_theta")]
    residual, load, slope = _forces(g).call([port["q"], *loads, *directions])
    M, D, K = linear_form(g).call([port["q"], loads[0], loads[2]])
    values = {"residual": residual, "load": load, "K": K, "M": M, "D": D, "slope": slope}
    dense = [ca.densify(value) for value in values.values()]
    return ca.Function("balance", list(port.values()), dense, list(port), list(values), OPTIONS)


def _forces(g: Graphs) -> ca.Function:
    """Residual, size of the loads, and d residual along a direction of the loads."""
    sym = g.chain.asm.sym
    still = g.chain.asm.expression(g.chain.n_q, 1)
    needed, _ = g.residual_of(g.q, still, still, g.pressure)
    known = [
        functions.gravity(g)(g.q, g.theta),
        functions.spring(g)(g.q, g.theta),
        -functions.inflation(g)(g.q, g.pressure, g.theta),
    ]
    parts = [*known, needed - sum(known[1:], known[0]), g.tau]
    size = sum(ca.fabs(part) for part in parts)
    residual = needed - g.tau
    loads = (g.pressure, g.tau, g.theta)
    along = [sym(f"d{k}", load.shape[0]) for k, load in enumerate(loads)]
    slopes = [ca.jtimes(residual, load, d) for load, d in zip(loads, along, strict=True)]
    values = [residual, ca.mmax(size), sum(slopes[1:], slopes[0])]
    return ca.Function("static_forces", [g.q, *loads, *along], values, OPTIONS)


def newton(g: Graphs) -> ca.Function:
    """A Newton step under a linear constraint.

        [ K + shift M + ground 1   slope  ] [dq]   [-residual]
        [ normal^T                 weight ] [ds] = [    0    ]

    Ports residual, K, M, slope, shift, ground, normal, weight; outputs dq, ds.
    """
    n = g.chain.n_q
    shapes = {"residual": (n, 1), "K": (n, n), "M": (n, n), "slope": (n, 1), "shift": (1, 1)}
    shapes |= {"ground": (1, 1), "normal": (n, 1), "weight": (1, 1)}
    port = {name: ca.MX.sym(name, *shape) for name, shape in shapes.items()}
    matrix = ca.blockcat(
        [
            [
                port["K"] + port["shift"] * port["M"] + port["ground"] * ca.MX.eye(n),
                port["slope"],
            ],
            [port["normal"].T, port["weight"]],
        ]
    )
    rhs = ca.vertcat(-port["residual"], ca.MX(1, 1))
    solution = Factored(matrix, native=g.native).solve(rhs)
    parts = [ca.densify(part) for part in ca.vertsplit(solution, [0, n, n + 1])]
    return ca.Function("newton", list(port.values()), parts, list(port), ["dq", "ds"], OPTIONS)
