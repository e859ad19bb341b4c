"""Time of an equilibrium from a cold start, and of a pressure sweep with stability."""

import argparse
import statistics
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..cli.common import Report

CHARTS = ("planar", "cardan")
PRESSURE, START, POINTS = 12.0, 1.0, 100
_ROW = (
    "{chart:8} {n_q:>4} {iterations:>6} {search_us:>10} {cold_us:>10} {steps_ms:>10} {arc_ms:>10}"
)
_TITLES = {
    "chart": "chart",
    "n_q": "n_q",
    "iterations": "Newton",
    "search_us": "search us",
    "cold_us": "in all us",
    "steps_ms": "steps ms",
    "arc_ms": "arc ms",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("--repeats", type=count, default=25, metavar="N", help="timings of each")


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure, chart by chart."""
    from ..compiler import find_compiler

    compiler = find_compiler()
    report.section("statics", "the paper's four-disc robot, thread on top")
    report.note(repeats=options.repeats, compiler=compiler.version if compiler else None)
    report.line(
        "search: Newton's method from the straight pose to rest at {pressure_Pa:g} Pa; in all: "
        "dtc.equilibrium with checks and stability; steps, arc: dtc.branch over {points} points "
        "from {start_Pa:g} to {pressure_Pa:g} Pa with stability; medians of {repeats} timings",
        pressure_Pa=PRESSURE,
        start_Pa=START,
        points=POINTS,
        repeats=options.repeats,
    )
    print("  " + _ROW.format(**_TITLES))
    for chart in CHARTS:
        _row(report, chart, options.repeats)


def _row(report: "Report", chart: str, repeats: int) -> None:
    import numpy as np

    from ..model import build
    from ..presets import seed_four_disc
    from ..statics import branch, equilibrium
    from ..statics.loads import LoadPath
    from ..statics.search import search_of

    model = build(seed_four_disc(), chart=chart)
    search, start = search_of(model), np.zeros(model.n_q)
    path = LoadPath.constant(np.full(1, PRESSURE), start, np.array(model.theta0))

    def swept(method: str) -> Callable[[], object]:
        return lambda: branch(model, "pressure", START, PRESSURE, points=POINTS, method=method)

    report.row(
        "timings",
        _ROW,
        chart=chart,
        n_q=model.n_q,
        iterations=search.run(path, start).iterations,
        search_us=1e6 * _median(lambda: search.run(path, start), repeats),
        cold_us=1e6 * _median(lambda: equilibrium(model, PRESSURE), repeats),
        steps_ms=1e3 * _median(swept("step"), repeats),
        arc_ms=1e3 * _median(swept("arc"), repeats),
    )


def _median(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call [s]."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def count(text: str) -> int:
    """A positive number from the command line."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"expected a positive number, got {text}")
    return number
