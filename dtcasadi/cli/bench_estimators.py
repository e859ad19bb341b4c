"""`dtcasadi bench estimators`: errors against microseconds for a step.

Those of EKF and observer are of compiled C, those of the unscented filter, of the moving horizon
and of the smoother's way back of calls from Python.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..bench.statics import count

if TYPE_CHECKING:
    from .common import Report

_ROW = (
    "{estimator:9} {us_per_step:>9} {tip_rmse_over_length:>10} {force_error:>8} "
    "{nees_in_band:>6} {convergence_s:>8}"
)
_TITLES = {
    "estimator": "estimator",
    "us_per_step": "us a step",
    "tip_rmse_over_length": "tip/length",
    "force_error": "force N",
    "nees_in_band": "NEES",
    "convergence_s": "settle s",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument(
        "--estimator", metavar="NAME", default="all", help="which one, or all (default: all)"
    )
    parser.add_argument("--runs", type=count, default=100, metavar="N", help="Monte Carlo runs")
    parser.add_argument("--steps", type=count, default=200, metavar="N", help="steps of each")
    parser.add_argument(
        "--chart", default="cardan", choices=("cardan", "planar"), help="of the timed robot"
    )
    parser.add_argument("--png", metavar="F", help="draw error against time for a step")


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure."""
    from estimators.benchmark import consistency, convergence, mismatch
    from estimators.registry import chosen
    from estimators.timing import Case

    from ..compiler import find_compiler
    from .common import check_target

    choices = chosen(options.estimator)
    if options.png:
        check_target(Path(options.png))
    compiler = find_compiler()
    report.section("time", "time of a step: the paper's four-disc robot, twelve measurements")
    report.note(compiler=compiler.version if compiler else None)
    case = Case(options.chart)
    parts = case.ekf_us()
    report.line(
        "EKF, one linearly implicit L-stable step with one Jacobian, {states} states: "
        "{us_per_step:.1f} us; linearization {linearization:.1f}, covariance {covariance:.1f}, "
        "sensors {sensors:.1f}",
        states=len(case.x),
        **{name: parts[name] for name in ("us_per_step", "linearization", "covariance", "sensors")},
    )
    wrench = Case(options.chart, wrench=True).ekf_us()["us_per_step"]
    report.line("with a wrench besides: {with_wrench_us:.1f} us", with_wrench_us=wrench)
    exact = Case(options.chart, method="midpoint", exact=True).ekf_us()["us_per_step"]
    report.line(
        "implicit midpoint, exact derivative: {midpoint_exact_us:.1f} us", midpoint_exact_us=exact
    )
    filterpy = case.filterpy_us()
    ekf = parts["us_per_step"]
    timed: dict[str, Callable[[], float]] = {
        "ekf": lambda: ekf,
        "ukf": case.ukf_us,
        "mhe": case.mhe_us,
        "smoother": lambda: ekf + case.smoother_us(),
        "spv": case.spv_us,
    }
    times = {name: timed[name]() for name in choices}
    errors, shares = mismatch(choices), consistency(choices, options.runs, options.steps)
    settled = convergence(choices, options.chart)
    print("\nmismatch: 8 discs, stiffer, hysteresis, against 4; settled: tip within 1 % for good")
    print("  " + _ROW.format(**_TITLES))
    table: dict[str, Any] = {}
    for name in choices:
        row: dict[str, float | None] = {"us_per_step": times[name], **errors[name]}
        row |= {"nees_in_band": shares.get(name), "convergence_s": settled[name]}
        table[name] = row
        shown = {key: "-" if value is None else f"{value:.3g}" for key, value in row.items()}
        print("  " + _ROW.format(estimator=name, **shown), flush=True)
    report.record["estimators"] = table
    report.record["filterpy_us_per_step"] = filterpy
    words = "not installed" if filterpy is None else f"{filterpy:.1f} us"
    print(f"  filterpy's EKF on the same compiled step and sensors, from Python: {words}")
    if options.png:
        report.wrote(_drawn(table, Path(options.png)))
    report.list_files()


def _drawn(table: dict[str, Any], path: Path) -> Path:
    """Errors of the mismatch case against time for a step."""
    from ..style import LINES, finished, new_figure, styled

    @styled
    def draw() -> None:
        figure = new_figure(6.4, 2.9, layout="constrained")
        panels = figure.subplots(1, 2)
        kinds = (
            ("tip_rmse_over_length", 100.0, "tip error [% of length]"),
            ("force_error", 1.0, "contact force error [N]"),
        )
        for axes, (key, factor, label) in zip(panels, kinds, strict=True):
            values = [factor * row[key] for row in table.values()]
            for (name, row), color, mark in zip(table.items(), LINES, "osDv^", strict=False):
                place = (row["us_per_step"], factor * row[key])
                axes.plot(*place, mark, color=color, label=name, ls="", alpha=0.8)
            times = [row["us_per_step"] for row in table.values()]
            axes.set_xscale("log")
            axes.set_xlim(min(times) / 2, 2 * max(times))
            axes.set_ylim(0, 1.3 * max(values))
            axes.set_xlabel("time of a step [us]")
            axes.set_ylabel(label)
            axes.grid(alpha=0.3)
        # Beside the dots names would overlap where two estimators cost the same.
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        finished(figure, path)

    draw()
    return path
