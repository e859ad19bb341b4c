"""What inflation by volume costs: the state equation with it and with `last_disc`, in turn."""

import argparse
from typing import TYPE_CHECKING

from . import variants
from .dynamics import seed_robot, size

if TYPE_CHECKING:
    from ..cli.common import Report

SIZES, CHARTS, KINDS = (4, 8), ("planar", "cardan"), ("last_disc", "volume")
_ROW = "{chart:8} {n_discs:>4} {last_disc_us:>13} {volume_us:>10} {ratio:>7} {operations_ratio:>11}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument(
        "--sizes", type=size, nargs="+", default=list(SIZES), metavar="N", help="numbers of discs"
    )


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure, row by row."""
    from ..compiler import find_compiler

    compiler = find_compiler()
    report.section("inflation", "state equation of the seed robot with either inflation")
    report.note(rounds=variants.ROUNDS, compiler=compiler.version if compiler else None)
    report.line(
        "{how}; least of {rounds} rounds that take turns",
        how="compiled" if compiler else "CasADi's virtual machine",
        rounds=variants.ROUNDS,
    )
    titles = {"chart": "chart", "n_discs": "N", "last_disc_us": "last_disc us"}
    titles |= {"volume_us": "volume us", "ratio": "ratio", "operations_ratio": "operations"}
    print("  " + _ROW.format(**titles))
    for chart in CHARTS:
        for n_discs in sorted(set(options.sizes)):
            _row(report, chart, n_discs)


def _row(report: "Report", chart: str, n_discs: int) -> None:
    from ..model import build

    models = {kind: build(seed_robot(n_discs), chart=chart, inflation=kind) for kind in KINDS}
    times, counts = variants.in_turn(models)
    report.row(
        "timings",
        _ROW,
        chart=chart,
        n_discs=n_discs,
        last_disc_us=times["last_disc"],
        volume_us=times["volume"],
        ratio=times["volume"] / times["last_disc"] if times["last_disc"] else None,
        operations_ratio=counts["volume"] / counts["last_disc"],
    )
