"""The recursion of the mass matrix and the inverse-dynamics derivatives over all segment pairs."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca

from .chain import ZERO, pair_wrench, trigonometry
from .forces.damping import DampingNumbers
from .forces.springs import Springs
from .kernels import derivatives as der
from .kernels.kinematics import Segment, Words, project, turning

if TYPE_CHECKING:
    from .graphs import Graphs


def pair_jacobian(
    words: Words,
    q: ca.SX,
    qd: ca.SX,
    geometry: tuple,
    springs: Springs,
    damping: DampingNumbers | None,
) -> tuple[ca.SX, ca.SX]:
    """What springs and dampers of a segment add to d tau / d q and d tau / d qd.

    Forces between two discs act on their own segment's coordinates alone, so the local Jacobian of
    this kernel is all of their derivative.
    """
    seg = Segment(*trigonometry(q), *geometry)
    relative = turning(words, seg, qd, ca.SX.zeros(3))
    _, _, moment, force = pair_wrench(words, seg, relative, springs, damping)
    tau = -project(words, seg, moment, force)
    return ca.jacobian(tau, q), ca.jacobian(tau, qd)


class Derivatives:
    """Mass matrix, d tau / d q, d tau / d qd and d Q / d pressure at one (q, qd, qdd, pressure)."""

    def __init__(self, graphs: Graphs, q: ca.SX, qd: ca.SX, qdd: ca.SX, pressure: ca.SX | None):
        self._graphs, self._chain = graphs, graphs.chain
        self._q, self._qd, self._qdd, self._pressure = q, qd, qdd, pressure
        self._segments = self._chain.segments(q)

    def mass_matrix(self) -> ca.SX:
        """M, eq (6), as J^T I J with composite inertias, shape (n_q, n_q)."""
        chain, columns = self._chain, self._columns
        n = chain.n_segments
        blocks: list[list] = [[None] * n for _ in range(n)]
        for i in range(n):
            for j in range(i + 1):
                block = chain.asm.call(der.mass_block, columns[j].J, self._factors[i].U)
                blocks[j][i] = block
                blocks[i][j] = block.T
        return _stacked(blocks)

    def rigid(self) -> tuple[ca.SX, ca.SX]:
        """Derivatives of tau for q and qd without the pairs' share, shape (n_q, n_q) each."""
        chain, columns, n = self._chain, self._columns, self._chain.n_segments
        dq: list[list] = [[None] * n for _ in range(n)]
        dqd: list[list] = [[None] * n for _ in range(n)]
        for i, own in enumerate(self._factors):
            dq[i][i], dqd[i][i] = chain.asm.call(der.diagonal_blocks, own, columns[i])
            for j in range(i):
                dq[i][j], dqd[i][j] = chain.asm.call(der.lower_blocks, own, columns[j])
                dq[j][i], dqd[j][i] = chain.asm.call(der.upper_blocks, columns[j].J, own.Z, own.Y)
        total_q, total_qd = _stacked(dq), _stacked(dqd)
        options = self._graphs.options
        if options.velocity_terms == "none":
            total_qd = chain.asm.expression(*total_qd.shape)
        elif options.velocity_terms == "paper":
            extra_q, extra_qd = self._graphs.missing_terms_jacobian(self._q, self._qd)
            total_q, total_qd = total_q + extra_q, total_qd + extra_qd
        damping = self._graphs.coordinate_damping
        if damping is not None:
            total_qd = total_qd + ca.diag(damping)
        return total_q, total_qd

    def inflation_columns(self) -> ca.SX:
        """Generalized force of one pascal in each chamber, d Q / d pressure, shape (n_q, n_u)."""
        chain = self._chain
        columns = []
        for k in range(len(chain.chambers)):
            pressure = [ca.DM(1.0 if k == m else 0.0) for m in range(len(chain.chambers))]
            loads = chain.total(self._graphs.inflation_loads(pressure))
            columns.append(chain.project(self._segments, loads)[0])
        return ca.horzcat(*columns) if columns else chain.asm.expression(chain.n_q, 0)

    def pairs(self) -> tuple[ca.SX, ca.SX]:
        """The block-diagonal share of springs and physical damping in the same."""
        chain, numbers = self._chain, self._chain.numbers
        physical = self._graphs.options.damping == "physical"
        dq, dqd = [], []
        for i, (q, qd) in enumerate(zip(chain.split(self._q), chain.split(self._qd), strict=True)):
            geometry = tuple(
                part[i]
                for part in (numbers.bend, numbers.twist, numbers.length, numbers.exit_point)
            )
            damping = numbers.damping[i] if physical else None
            a, b = chain.asm.call(
                pair_jacobian, chain.words[i], q, qd, geometry, numbers.springs[i], damping
            )
            dq.append(a)
            dqd.append(b)
        return ca.diagcat(*dq), ca.diagcat(*dqd)

    @cached_property
    def _outward(self) -> tuple[list[der.RootState], list[der.Columns]]:
        """Root-frame states of the discs and columns of the segments."""
        chain = self._chain
        still = self._graphs.options.velocity_terms == "none"
        qd = chain.asm.expression(chain.n_q, 1) if still else self._qd
        start = der.RootState(ca.DM.eye(3), ZERO, ZERO, ZERO, ZERO, chain.root_acceleration())
        states, columns = [start], []
        parts = zip(
            chain.words, self._segments, chain.split(qd), chain.split(self._qdd), strict=True
        )
        for words, seg, qdi, qddi in parts:
            state, mine = chain.asm.call(der.root_step, words, seg, qdi, qddi, states[-1])
            states.append(state)
            columns.append(mine)
        return states, columns

    @property
    def _columns(self) -> list[der.Columns]:
        return self._outward[1]

    @cached_property
    def _factors(self) -> list[der.Factors]:
        """Composite sums, inward, times the columns of each segment."""
        chain, options = self._chain, self._graphs.options
        states, columns = self._outward
        loads = chain.none()
        if self._pressure is not None:
            loads = self._graphs.inflation_loads(self._pressure)
        dead = self._graphs.dead_load_parts()
        for held, extra in zip(
            loads, chain.dead_loads(self._segments, options.wrenches, dead), strict=True
        ):
            held.extend(extra)
        wrenches = chain.total(loads)
        result: list[der.Factors] = []
        outboard: der.Composite | tuple = ()
        for i in reversed(range(chain.n_segments)):
            disc = i + 2
            fixed = ca.DM(0, 1)
            if disc in options.wrenches:
                k = options.wrenches.index(disc)
                fixed = dead[6 * k : 6 * k + 6]
            outboard = chain.asm.call(
                der.composite_step,
                *chain.numbers.discs[i + 1],
                states[i + 1],
                *wrenches[i + 1],
                fixed,
                outboard,
            )
            result.insert(0, chain.asm.call(der.factors, columns[i], outboard))
        return result


def _stacked(blocks: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*(ca.horzcat(*row) for row in blocks))
