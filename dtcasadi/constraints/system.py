r"""Multipliers of bilateral constraints, eq (7), by the recursion.

With the free accelerations a0 and Y = M^-1 A^T, each column of it one articulated-body recursion,

.. math:: (A Y) \lambda = A\, a_0 + \dot A\, \dot q, \qquad \ddot q = a_0 - Y \lambda,

A Y being the operational-space inertia's inverse (Featherstone 2008, section 8.5). Constraints that
repeat each other make it singular; the multipliers are then those of minimum norm, by a few
proximal steps (Carpentier, Budhiraja, Mansard, "Proximal and sparse resolution of constrained
dynamic equations", RSS 2021), which have no branch on the rank and keep the graph smooth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from ..kernels.axes import cross
from ..linear import solve_spd
from .values import Poses, Row

if TYPE_CHECKING:
    from ..chain import Wrench
    from ..graphs import Graphs

# Share of the mean diagonal that is added before factoring, and how often its trace is removed.
_SHARE, _STEPS = 1e-9, 3
# Newton steps of a projection; the first leaves the square of the drift of one time step.
_CORRECTIONS = 2


def minimum_norm(matrix: ca.SX, rhs: ca.SX, *, native: bool) -> ca.SX:
    """The solution of least norm of a symmetric, positive semidefinite, consistent system."""
    m = matrix.shape[0]
    lifted = matrix + _SHARE * ca.trace(matrix) / m * type(matrix).eye(m)
    found = solve_spd(lifted, rhs, native=native)
    for _ in range(_STEPS - 1):
        found = found + solve_spd(lifted, rhs - ca.mtimes(matrix, found), native=native)
    return found


def rows_of(g: Graphs, segments: list) -> list[Row]:
    """All rows of the robot's constraints at the segments' pose."""
    poses = Poses(*g.chain.poses(segments))
    return [row for constraint in g.robot.constraints for row in constraint.rows(poses)]


def unit_wrenches(g: Graphs, segments: list, row: Row) -> list[Wrench]:
    """What a multiplier of -1 does on every disc, along the discs' axes."""
    R, _ = g.chain.poses(segments)
    loads = g.chain.none()
    for pull in row.pulls:
        force = ca.mtimes(R[pull.disc - 1].T, pull.direction)
        loads[pull.disc - 1].append((cross(ca.DM(pull.point), force), force))
    return [
        (sum((w[0] for w in mine), ca.DM(3, 1)), sum((w[1] for w in mine), ca.DM(3, 1)))
        for mine in loads
    ]


def terms(g: Graphs) -> ca.Function:
    """Phi (m,), A (m, n_q) and (d A / dt) qd (m,) at (q, qd, theta)."""
    segments = g.chain.segments(g.q)
    rows = rows_of(g, segments)
    phi = ca.vertcat(*(row.phi for row in rows))
    wrenches = (unit_wrenches(g, segments, row) for row in rows)
    A = ca.vertcat(*(g.chain.project(segments, each)[0].T for each in wrenches))
    bias = ca.jtimes(ca.mtimes(A, g.qd), g.q, g.qd)
    names = ["q", "qd", "theta"], ["phi", "A", "bias"]
    values = [ca.densify(value) for value in (phi, A, bias)]
    return ca.Function("constraint_terms", [g.q, g.qd, g.theta], values, *names, {"cse": True})


def responses(g: Graphs, q: ca.SX, A: ca.SX) -> ca.SX:
    """Y = M^-1 A^T, shape (n_q, m), column by column by the articulated-body recursion at rest."""
    chain = g.chain
    at_rest = chain.motion(chain.segments(q), g.still)
    nothing = chain.total(chain.none())
    columns = ca.horzsplit(A.T)
    return ca.horzcat(*(chain.accelerations(at_rest, c, nothing, ca.DM(3, 1)) for c in columns))


def constrained(g: Graphs, q: ca.SX, qd: ca.SX, free: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Accelerations that keep the constraints, and their multipliers, from free accelerations."""
    _, A, bias = g.constraint_terms(q, qd, g.theta)
    Y = responses(g, q, A)
    rhs = ca.mtimes(A, free) + bias
    multipliers = minimum_norm(ca.mtimes(A, Y), rhs, native=g.native)
    return free - ca.mtimes(Y, multipliers), multipliers


def projection(g: Graphs) -> ca.Function:
    """State x, theta -> x on the constraints: q by Newton's method, then qd, in the metric of M."""
    x = g.chain.asm.sym("x", g.x.shape[0])
    n = g.chain.n_q
    q, qd, z = ca.vertsplit(x, [0, n, 2 * n, x.shape[0]])
    for _ in range(_CORRECTIONS):
        phi, A, _ = g.constraint_terms(q, qd, g.theta)
        q = q - _correction(g, q, A, phi)
    _, A, _ = g.constraint_terms(q, qd, g.theta)
    qd = qd - _correction(g, q, A, ca.mtimes(A, qd))
    return ca.Function("projection", [x, g.theta], [ca.vertcat(q, qd, z)], {"cse": True})


def _correction(g: Graphs, q: ca.SX, A: ca.SX, rhs: ca.SX) -> ca.SX:
    """The least change in the metric of M with A change = rhs."""
    Y = responses(g, q, A)
    return ca.mtimes(Y, minimum_norm(ca.mtimes(A, Y), rhs, native=g.native))


def reactions(g: Graphs, q: ca.SX, multipliers: ca.SX) -> list[Wrench]:
    """What the constraints do to every disc, along the discs' axes."""
    segments = g.chain.segments(q)
    total = [(ca.DM(3, 1), ca.DM(3, 1)) for _ in range(g.chain.n_segments + 1)]
    for k, row in enumerate(rows_of(g, segments)):
        each = unit_wrenches(g, segments, row)
        total = [
            (a[0] - multipliers[k] * b[0], a[1] - multipliers[k] * b[1])
            for a, b in zip(total, each, strict=True)
        ]
    return total
