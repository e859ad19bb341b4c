"""Runs in fixed steps, many at a time on SIMD lanes."""

import math
from collections.abc import Sequence

import numpy as np

from ..batch import Batch, batch
from ..commands import command_pieces
from ..health import samples_of
from ..integrators import ONE_STEP
from ..integrators.loop_state import Watched
from ..integrators.package import watched
from ..profile import Piece
from ..recentring import LIMIT, NEAR
from .advance import advance_function, repeated
from .columns import DONE, FAILED, IMBALANCE_MAX, imbalance_text, outcomes
from .probe import probe_of
from .targets import Rows, Setup

# Runs side by side: enough of them for Python's share to be small, few enough for the caches, and
# for processes that end their last ones at much the same time.
TOGETHER = 512
# Steps of a call where nothing has to be looked at between them.
BLOCK = 4


class Fixed:
    """Engine of runs in steps of one size, cut where the command jumps or kinks."""

    def __init__(self, setup: Setup, save: Sequence[tuple[str, str]], step_s: float):
        self.setup, self.save, self.step_s = setup, save, step_s
        model, scene = setup.model, setup.scene
        self.method = ONE_STEP[scene.method]
        self.ode: Batch = batch(model)
        self.probe = probe_of(model, [name for name, _ in save])
        self.look = batch(self.probe.function)
        self.followed = self.probe.followed(save)
        kinds = watched(model)
        self.limited = kinds[kinds[:, 1] == Watched.LIMITED, 0].tolist()
        self.singular = [
            (int(k), np.sin if kind == Watched.SINE else np.cos)
            for k, kind in kinds
            if kind != Watched.LIMITED
        ]
        pair = [advance_function(self.method, g, self.limited) for g in model.graphs]
        self.advance = batch(pair[1], native=pair[0])
        native, plain = (repeated(each, BLOCK) for each in pair)
        self.block = None if self.singular else batch(plain, native=native)
        self.pieces = [
            piece
            for piece in command_pieces(setup.base, model.n_u, scene.t_end)
            if isinstance(piece, Piece)
        ]
        spans = [piece.t_end - piece.t_start for piece in self.pieces]
        self.steps = [max(1, math.ceil(span / step_s - 1e-9)) for span in spans]
        self.kept = set(samples_of(np.empty(sum(self.steps) + 1)).tolist())

    def run(self, inputs: np.ndarray) -> dict[str, np.ndarray]:
        """See `Engine`."""
        parts = [
            _Flock(self, self.setup.rows(inputs[k : k + TOGETHER])).run()
            for k in range(0, len(inputs), TOGETHER)
        ]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


class _Flock:
    """Some runs under way, a column each."""

    def __init__(self, engine: Fixed, rows: Rows):
        self.engine, self.rows = engine, rows
        self.x, self.theta = rows.x0, rows.theta
        self.reason = np.array(rows.faults, dtype=object)
        self.t_stop = np.where(self.reason == "", engine.setup.scene.t_end, 0.0)
        self.work = np.zeros((2, self.x.shape[1]))
        instants, runs = len(engine.kept), self.x.shape[1]
        self.seen = np.empty((len(engine.followed.rows), instants, runs))
        self.done = np.empty((2, instants, runs))
        self.looks = 0

    def run(self) -> dict[str, np.ndarray]:
        """To the end, or each to where it fails."""
        engine, step = self.engine, 0
        for piece, steps in zip(engine.pieces, engine.steps, strict=True):
            t, h = piece.t_start, (piece.t_end - piece.t_start) / steps
            slope = self.rows.scale * piece.slope[:, np.newaxis]
            rates = engine.ode(self.x, self._command(piece, t), self.theta)
            end = step + steps
            while step < end:
                u = self._command(piece, t)
                if step in engine.kept:
                    self._look(u)
                inner = range(step + 1, step + BLOCK)
                if step + BLOCK < end and engine.kept.isdisjoint(inner):
                    after = self._block(u, slope, h, rates)
                    if after is not None:
                        rates, step = after, step + BLOCK
                        for _ in range(BLOCK):
                            t += h
                        continue
                taken = h if step + 1 < end else piece.t_end - t
                rates = self._step(t, u, slope, taken, rates)
                t, step = t + h, step + 1
        self._look(self._command(piece, piece.t_end))
        return self._columns()

    def _command(self, piece: Piece, t: float) -> np.ndarray:
        return self.rows.scale * piece(t)[:, np.newaxis] + self.rows.offset

    def _block(
        self, u: np.ndarray, slope: np.ndarray, h: float, rates: np.ndarray
    ) -> np.ndarray | None:
        """Several steps in one call; None, and nothing happened, where one needs a closer look."""
        if self.engine.block is None:
            return None
        call = self.engine.block(self.x, rates, u, slope, [h], self.theta)
        x, rates, status, work, peak = call
        # Runs that have stopped stay where they are.
        going = self.reason == ""
        if np.any((status[0] != 0) & going) or np.any((peak[0] > LIMIT) & going):
            return None
        stopped = ~going
        if stopped.any():
            x[:, stopped], work[:, stopped] = self.x[:, stopped], 0.0
        self.x = x
        self.work += work
        return rates

    def _step(
        self, t: float, u: np.ndarray, slope: np.ndarray, h: float, rates: np.ndarray
    ) -> np.ndarray:
        """One step of every run; returns the rates at its end."""
        x, rates, status, work, _ = self.engine.advance(self.x, rates, u, slope, [h], self.theta)
        bad = (status[0] != 0) | (self.reason != "")
        if bad.any():
            for k in np.flatnonzero(bad & (self.reason == "")).tolist():
                finite = bool(np.all(np.isfinite(x[:, k])))
                what = "did not converge" if finite else "gave a state that is not finite"
                self._fail(k, t, what)
            x[:, bad], work[:, bad] = self.x[:, bad], 0.0
        self.x = x
        self.work += work
        return self._watched(t + h, u + h * slope, rates)

    def _watched(self, t: float, u: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Re-centre where an angle has left its limit, stop at a chart's singularity."""
        engine, model = self.engine, self.engine.setup.model
        for entry, measure in engine.singular:
            near = np.abs(measure(self.x[entry])) < NEAR
            for run in np.flatnonzero(near & (self.reason == "")).tolist():
                self._fail(run, t, "came to a singularity of its chart")
        if not engine.limited:
            return rates
        off = np.flatnonzero((np.abs(self.x[engine.limited]) > LIMIT).any(axis=0))
        for k in off.tolist():
            self.x[:, k], self.theta[:, k], _ = model.recentre(self.x[:, k], self.theta[:, k])
        if len(off):
            rates[:, off] = engine.ode(self.x[:, off], u[:, off], self.theta[:, off])
        return rates

    def _fail(self, k: int, t: float, what: str) -> None:
        method = self.engine.method.name
        self.reason[k], self.t_stop[k] = f"{method}: the step {what} after t = {t:.6g} s", t

    def _look(self, u: np.ndarray) -> None:
        self.last = self.engine.look(self.x, u, self.theta)
        np.take(self.last, self.engine.followed.rows, axis=0, out=self.seen[:, self.looks])
        self.done[:, self.looks] = self.work
        self.looks += 1

    def _columns(self) -> dict[str, np.ndarray]:
        engine = self.engine
        seen = engine.probe.split(self.last[:, np.newaxis])
        seen |= {name: self.seen[rows] for name, rows in engine.followed.parts.items()}
        work = {"supplied": self.done[0], "dissipated": self.done[1]}
        with np.errstate(all="ignore"):
            columns = outcomes(seen, work, engine.save)
        if engine.setup.model.options.velocity_terms == "full":
            shares = columns["energy_imbalance"]
            for k in np.flatnonzero((self.reason == "") & ~(shares <= IMBALANCE_MAX)):
                self.reason[k] = f"{engine.method.name}: {imbalance_text(shares[k])}"
        columns["t_reached"] = self.t_stop
        columns["status"] = np.where(self.reason == "", DONE, FAILED).astype(np.int8)
        columns["reason"] = self.reason.astype(str)
        return columns
