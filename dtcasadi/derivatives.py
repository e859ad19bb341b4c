"""The recursion of the mass matrix and the inverse-dynamics derivatives over all segment pairs."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca

from .acting import act, span_derivatives, world_derivatives
from .chain import ZERO
from .kernels import derivatives as der

if TYPE_CHECKING:
    from .graphs import Graphs


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
        if drag := self._drag:
            extra_q, extra_qd = self._dragged(drag)
            total_q, total_qd = total_q + extra_q, total_qd + extra_qd
        damping = self._graphs.coordinate_damping
        if damping is not None:
            total_qd = total_qd + ca.diag(damping)
        return total_q, total_qd

    def inflation_columns(self) -> ca.SX:
        """Derivative d Q / d pressure of each chamber's forces, shape (n_q, n_u)."""
        chain, graphs = self._chain, self._graphs
        columns = []
        for forces in graphs.chamber_forces(self._pressure):
            loads = act(chain, forces, self._segments, graphs.still, slope="pressure")
            columns.append(chain.project(self._segments, chain.total(loads))[0])
        return ca.horzcat(*columns) if columns else chain.asm.expression(chain.n_q, 0)

    def between(self) -> tuple[ca.SX, ca.SX]:
        """The share of forces between discs in the same."""
        forces = self._graphs.forces(self._pressure)
        return span_derivatives(self._chain, forces, self._q, self._qd)

    @cached_property
    def _outward(self) -> tuple[list[der.RootState], list[der.Columns]]:
        """Root-frame states of the discs and columns of the segments."""
        none = self._graphs.options.velocity_terms == "none"
        return self._carried(self._graphs.still if none else self._qd)

    @cached_property
    def _moving_columns(self) -> list[der.Columns]:
        """Columns at the rates that forces see, whatever the velocity terms."""
        if self._graphs.options.velocity_terms == "none":
            return self._carried(self._qd)[1]
        return self._columns

    def _carried(self, qd: ca.SX) -> tuple[list[der.RootState], list[der.Columns]]:
        chain = self._chain
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
    def _of_the_world(self) -> dict[int, tuple[ca.SX, ca.SX]]:
        """How the world's forces on each disc (from 1) change beside turning with it."""
        forces = self._graphs.forces(None)
        return world_derivatives(self._chain, forces, self._segments, self._qd)

    @cached_property
    def _drag(self) -> list[ca.SX]:
        """The world's damping matrix of each disc (from disc 2) with all beyond; [] without any."""
        chain = self._chain
        mine = {disc: drag for disc, (_, drag) in self._of_the_world.items() if drag.nnz()}
        if not mine:
            return []
        sums = [chain.asm.expression(6, 6)]
        for disc in range(chain.n_segments + 1, 1, -1):
            sums.insert(0, sums[0] + mine[disc] if disc in mine else sums[0])
        return sums[:-1]

    def _dragged(self, drag: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
        """What forces that depend on the rates add to d tau / d q and d tau / d qd."""
        chain, columns, n = self._chain, self._moving_columns, self._chain.n_segments
        dq: list[list] = [[None] * n for _ in range(n)]
        dqd: list[list] = [[None] * n for _ in range(n)]
        for i in range(n):
            for j in range(n):
                parts = columns[i].J, columns[j].J, columns[j].Pd, drag[max(i, j)]
                dq[i][j], dqd[i][j] = chain.asm.call(der.drag_blocks, *parts)
        return _stacked(dq), _stacked(dqd)

    @cached_property
    def _factors(self) -> list[der.Factors]:
        """Composite sums, inward, times the columns of each segment."""
        chain = self._chain
        states, columns = self._outward
        # Forces between discs turn with their span and have their own derivatives.
        world = [f for f in self._graphs.forces(self._pressure) if len(f.touched()) == 1]
        wrenches = self._graphs.acting(world, self._segments, self._qd)
        nothing = ca.DM(6, 6)
        result: list[der.Factors] = []
        outboard: der.Composite | tuple = ()
        for i in reversed(range(chain.n_segments)):
            stiff, _ = self._of_the_world.get(i + 2, (nothing, nothing))
            outboard = chain.asm.call(
                der.composite_step,
                *chain.numbers.discs[i + 1],
                states[i + 1],
                *wrenches[i + 1],
                stiff,
                outboard,
            )
            result.insert(0, chain.asm.call(der.factors, columns[i], outboard))
        return result


def _stacked(blocks: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*(ca.horzcat(*row) for row in blocks))
