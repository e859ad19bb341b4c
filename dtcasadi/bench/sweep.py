"""Runs per second of a sweep on lanes against a process pool over the single-robot C code."""

import argparse
import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ..cli.common import Report
    from ..sweep.job import Job

SCENE, RUNS, T_END_S = "seed_four_disc", 10_000, 2.0
METHOD, STEP_S = "rk4", 0.0025
_ROW = "{how:34} {workers:>8} {seconds:>10} {runs_per_s:>12}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("--runs", type=int, default=RUNS, metavar="N", help=f"[{RUNS}]")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes [2]")
    parser.add_argument("--method", default=METHOD, metavar="NAME", help=f"[{METHOD}]")
    parser.add_argument("--step", type=float, default=STEP_S, metavar="S", help=f"[{STEP_S}]")


def run(options: argparse.Namespace, report: "Report") -> None:
    """The same runs both ways, each with the same processes."""
    from ..sweep.fixed import Fixed
    from ..sweep.job import engine_of
    from ..sweep.schedule import local_pool

    job, settings = job_of(options.method, options.step)
    inputs = inputs_of(options.runs)
    engine = engine_of(job)
    assert isinstance(engine, Fixed)
    report.section("sweep", f"{options.runs} runs of {SCENE} over {T_END_S:g} s")
    report.note(runs=options.runs, t_end_s=T_END_S, why=engine.advance.why or None)
    report.line(
        "{method} in steps of {step_s:g} s; {lanes} robots at a time; {workers} processes",
        method=options.method,
        step_s=options.step,
        lanes=engine.advance.lanes,
        workers=options.workers,
    )
    print("  " + _ROW.format(how="", workers="workers", seconds="seconds", runs_per_s="runs/s"))
    with local_pool(options.workers) as pool:
        warm(pool, options.workers, singles, job)
        pooled, x = timed(lambda: _pooled(pool, job, inputs))
        row(report, "pool, one robot, last state only", options.workers, pooled, len(inputs))
        warm(pool, options.workers, lanes, job)
        swept, found = timed(lambda: swept_on(pool, options.workers, inputs, settings))
        row(report, "sweep, every column", options.workers, swept, len(inputs))
    report.line("the sweep makes {speedup:.2f} times as many runs a second", speedup=pooled / swept)
    difference = float(np.abs(found["x.final"] - x).max())
    report.line("largest difference of a last state: {difference:.1e}", difference=difference)


def job_of(method: str = METHOD, step_s: float = STEP_S) -> "tuple[Job, dict[str, Any]]":
    """The job of the benchmark, and the arguments of `dtcasadi.sweep` that make the same one."""
    from ..scene import load_scene
    from ..sweep.job import Job

    scene = replace(load_scene(SCENE), t_end=T_END_S, method=method)
    job = Job(scene, ("payload", "pressure"), (("x", "final"),), step_s, {})
    return job, {"scene": scene, "step_s": step_s, "method": method, "save": ["x"]}


def inputs_of(n: int) -> np.ndarray:
    """Payloads up to 1 and pressures up to 12, drawn at random, shape (n, 2)."""
    return np.random.default_rng(0).uniform((0.0, 0.0), (1.0, 12.0), (n, 2))


def swept_on(executor: Executor, workers: int, inputs: np.ndarray, settings: dict[str, Any]) -> Any:
    """The sweep itself."""
    from ..sweep import Given, sweep

    over = {name: Given(inputs[:, k]) for k, name in enumerate(("payload", "pressure"))}
    return sweep(over=over, executor=executor, workers=workers, **settings)


def warm(executor: Executor, workers: int, each: Callable, job: "Job") -> None:
    """Have every process load what it needs; slow tasks, so that each gets some."""
    for _ in range(2):
        futures = [executor.submit(_slowly, each, job) for _ in range(2 * workers)]
        for future in futures:
            future.result()


def _slowly(each: Callable, job: "Job") -> None:
    each(job, inputs_of(8))
    time.sleep(0.2)


def lanes(job: "Job", inputs: np.ndarray) -> None:
    """Runs as the sweep makes them."""
    from ..sweep.job import compute

    compute(job, inputs)


def singles(job: "Job", inputs: np.ndarray) -> np.ndarray:
    """Last states (n, n_x), each run one call of the compiled loop of fixed steps."""
    from ..integrators import ONE_STEP, Package, Problem
    from ..integrators.package import Advance
    from ..integrators.recorder import Recorder
    from ..profile import Piece
    from ..sweep.job import engine_of

    setup = engine_of(job).setup
    rows, t_end = setup.rows(inputs), setup.scene.t_end
    method = Package(ONE_STEP[setup.scene.method], fixed=True)
    states = []
    for k in range(len(inputs)):
        piece = Piece(0.0, t_end, rows.offset[:, k], np.zeros(setup.model.n_u))
        start = (setup.model, rows.x0[:, k], rows.theta[:, k], (piece,), 1e-6, 1e-8)
        problem = Problem(*start, step_s=job.step_s)
        advance = Advance(problem, Recorder(problem))
        advance.over(method, piece, t_end)
        states.append(advance.x)
    return np.array(states)


def _pooled(pool: Executor, job: "Job", inputs: np.ndarray, size: int = 250) -> np.ndarray:
    chunks = [inputs[k : k + size] for k in range(0, len(inputs), size)]
    return np.concatenate(list(pool.map(singles, [job] * len(chunks), chunks)))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of a call, and what it returns."""
    start = time.perf_counter()
    found = call()
    return time.perf_counter() - start, found


def row(report: "Report", how: str, workers: int, seconds: float, runs: int) -> None:
    """One way of making the runs."""
    values = {"how": how, "workers": workers, "seconds": seconds, "runs_per_s": runs / seconds}
    report.row("ways", _ROW, **values)
