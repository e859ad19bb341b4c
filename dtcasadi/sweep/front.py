"""`dtcasadi.sweep`: many runs of a scene with different numbers."""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import checks
from ..contact.detect import candidates_of
from ..errors import SweepError
from ..integrators import METHODS, ONE_STEP, Problem
from ..integrators.stability import stability_limit
from ..profile import Piece
from ..scene import Scene, load_scene
from .axes import Axis, table
from .columns import DONE, FAILED, LOST
from .fixed import TOGETHER, Fixed
from .job import Engine, Job, engine_of, fingerprint
from .probe import checked_save
from .schedule import progress_bar, scheduled
from .store import SCHEMA, Store

# Fixed steps without a method: L-stable, order 4.
FIXED_METHOD = "rodas4"
# Runs of a chunk that are made one by one.
_ONE_BY_ONE = 16


@dataclass(frozen=True, eq=False)
class Sweep:
    """Results of a sweep, a row for each run in the order of the inputs.

    Attributes:
        names: the paths, shape (k,).
        inputs: their values, shape (n, k).
        status: 0 done, 1 failed numerically, 2 lost (its worker died), -1 not made; shape (n,).
        reason: why it failed or was lost, else empty; shape (n,).
        columns: by name, shape (n, ...) each: `tip` centre of mass of the last disc at the end [m];
            `tip_rotation` its R in the root frame, (n, 3, 3); `max_tilt` largest angle between a
            disc's axis and the root's [rad]; `max_strain` largest relative lengthening of a spring;
            `energy_residual` largest gap in the energy balance [J]; `energy_imbalance` the same
            over the energy turned over; `t_reached` [s]; and what `save` asked for. Extremes are
            those of at most 201 instants. Of a failed run they hold the last good state.
        arrays: everything, as in the file.
    """

    names: tuple[str, ...]
    inputs: np.ndarray
    status: np.ndarray
    reason: np.ndarray
    columns: dict[str, np.ndarray]
    arrays: dict[str, np.ndarray]

    @property
    def success(self) -> np.ndarray:
        """Which runs came to their end, shape (n,)."""
        return self.status == DONE

    def __getitem__(self, name: str) -> np.ndarray:
        """A column, or the values of a path."""
        if name in self.names:
            return self.inputs[:, self.names.index(name)]
        if name not in self.columns:
            expected = ", ".join([*self.names, *self.columns])
            raise SweepError(f"column: expected one of {expected}, got {name!r}")
        return self.columns[name]

    def __repr__(self) -> str:
        """How many there are, on one line."""
        done, failed, lost = (int(np.sum(self.status == s)) for s in (DONE, FAILED, LOST))
        return f"Sweep({len(self.status)} runs: {done} done, {failed} failed, {lost} lost)"


def sweep(
    scene: Scene | str | os.PathLike[str],
    over: Mapping[str, Axis],
    *,
    output: str | os.PathLike[str] | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    seed: int = 0,
    save: Sequence[str] = (),
    step_s: float | None = None,
    method: str | None = None,
    t_end: float | None = None,
    options: Mapping[str, Any] | None = None,
    force: bool = False,
    overwrite: bool = False,
) -> Sweep:
    """Run a scene for every combination of values of some of its numbers.

    With `step_s` the runs advance together in fixed steps, 8 robots per instruction with AVX-512
    (`dtcasadi.batch`); without it each run is `dtcasadi.simulate` with the scene's method and
    tolerances. Either way a run depends on its own inputs only: results are the same to the last
    bits on one process, several, or an executor.

    Args:
        scene: a scene, its path or its name.
        over: path -> values. Paths: those of `dtcasadi.build(parameters=...)`, where a block gets
            the value in all its entries (`springs.stiffness`) or in one (`up[1]`); `payload`, a
            mass added to the last disc [kg]; `pressure` or `pressure[1]`, held constant [Pa]
            (`opening` for valves); `pressure.scale`, a factor of the scene's profile;
            `initial.STATE`, a name of the model's `state_names`. Values: numbers, text such as
            `lin(0,12,5)`, `dtcasadi.sweep.normal(mean, sd, n)`; see `dtcasadi.sweep.axes`.
        output: .npz file; an unfinished one of the same sweep is continued.
        executor: any `concurrent.futures.Executor`, such as `Client.get_executor()` of
            dask.distributed; default: processes of this machine.
        workers: how many of those; default: one for each core. 1: none, all is done here.
        seed: of random draws.
        save: more columns: a quantity (`dtcasadi.sweep.probe.QUANTITIES`) with `.final` (the
            default), `.min`, `.max` or `.path` (at the instants).
        step_s: fixed step [s].
        method: integration method; with a fixed step one of `ONE_STEP`, default rodas4.
        t_end: duration [s] in place of the scene's.
        options: of `dtcasadi.build`, in place of the scene's.
        force: take a step beyond the linear stability limit of the scene's start.
        overwrite: begin anew where the file holds something else.

    Returns:
        The results; runs that failed are rows with a reason.

    Raises:
        SweepError: something cannot be used; the text says what was expected.
        OSError: the file cannot be written.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    names, inputs = table(over, seed)
    job = _job(scene, names, checked_save(save), step_s, method, t_end, dict(options or {}))
    workers = _workers(workers)
    path = None if output is None else _npz(Path(output))
    head = {
        "schema": np.array(SCHEMA),
        "fingerprint": np.array(fingerprint(job.fingerprint, inputs)),
        "input_names": np.array(names),
        "inputs": inputs,
    }
    store = Store(len(inputs), path, head)
    if overwrite or not store.resume():
        store.save()  # what cannot be written is better said before a long sweep than after it
    engine = engine_of(job)
    if isinstance(engine, Fixed) and not force:
        _refuse_unstable(engine, inputs)
    todo = store.todo
    size = _chunk_size(engine, len(todo), workers)
    chunks = [todo[k : k + size] for k in range(0, len(todo), size)]
    with progress_bar(len(inputs), len(inputs) - len(todo)) as bar:

        def receive(rows: np.ndarray, found: dict[str, np.ndarray] | str) -> None:
            store.receive(rows, found)
            bar.update(len(rows))

        try:
            if chunks:
                scheduled(job, inputs, chunks, receive, executor=executor, workers=workers)
        finally:
            store.save()
    return Sweep(
        names, inputs, store.status, store.reason.astype(str), store.columns, store.arrays()
    )


def _job(
    scene: Scene,
    names: tuple[str, ...],
    save: tuple[tuple[str, str], ...],
    step_s: float | None,
    method: str | None,
    t_end: float | None,
    options: dict[str, Any],
) -> Job:
    changes: dict[str, Any] = {}
    if t_end is not None:
        changes["t_end"] = checks.number("t_end", t_end, positive=True, error=_error)
    name = method or scene.method
    known = METHODS if step_s is None else ONE_STEP
    if step_s is not None:
        step_s = checks.number("step_s", step_s, positive=True, error=_error)
        if candidates_of(scene.robot) is not None:
            expected = "none, so that each run finds its own impulses: the scene has rigid contact"
            raise _error("step_s", expected, step_s)
        name = method or (scene.method if scene.method in ONE_STEP else FIXED_METHOD)
    if name not in known:
        raise _error("method", f"one of {', '.join(known)}", checks.shown(name))
    return Job(replace(scene, method=name, **changes), names, save, step_s, options)


def _refuse_unstable(engine: Fixed, inputs: np.ndarray) -> None:
    """As `simulate` does, for the first run."""
    method = engine.method
    if method.a_stable or method.error_order:
        return
    rows = engine.setup.rows(inputs[:1])
    pieces = tuple(
        Piece(
            piece.t_start,
            piece.t_end,
            rows.scale[:, 0] * piece.start + rows.offset[:, 0],
            piece.slope,
        )
        for piece in engine.pieces
    )
    scene = engine.setup.scene
    problem = Problem(
        engine.setup.model, rows.x0[:, 0], rows.theta[:, 0], pieces, scene.rtol, scene.atol
    )
    limit = stability_limit(problem, method)
    if engine.step_s > limit:
        raise _error(
            "step_s",
            f"a step within the linear stability limit {limit:.3g} s of {method.name} at the first "
            "run's start, an L-stable method (ros2, rodas4), or force=True (--force)",
            engine.step_s,
        )


def _workers(workers: int | None) -> int:
    if workers is None:
        return len(os.sched_getaffinity(0))
    return checks.index("workers", workers, 1, 10**4, error=_error)


def _chunk_size(engine: Engine, n: int, workers: int) -> int:
    """Runs of a chunk: enough of them for the lanes, and chunks enough for the workers."""
    if isinstance(engine, Fixed):
        share = -(-n // (4 * workers))
        return max(min(TOGETHER, -(-share // 8) * 8), 8)
    return max(1, min(_ONE_BY_ONE, n // (4 * workers)))


def _npz(path: Path) -> Path:
    return path if path.suffix == ".npz" else path.with_name(f"{path.name}.npz")


def _error(field: str, expected: str, got: object) -> SweepError:
    return SweepError(f"{field}: expected {expected}, got {got}")
