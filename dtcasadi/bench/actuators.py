"""What actuators cost: the state equation with air supply and hysteresis against `direct`."""

import argparse
from typing import TYPE_CHECKING

from . import variants
from .dynamics import seed_robot, size

if TYPE_CHECKING:
    from ..actuators import Actuator
    from ..cli.common import Report

SIZES, CHARTS = (4, 16), ("planar", "cardan")
_ROW = "{chart:8} {n_discs:>4} {actuator:16} {minimum_us:>10} {ratio:>7} {operations_ratio:>11}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument(
        "--sizes", type=size, nargs="+", default=list(SIZES), metavar="N", help="numbers of discs"
    )


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure, row by row."""
    from ..compiler import find_compiler

    compiler = find_compiler()
    report.section("actuators", "state equation of the seed robot, inflation volume")
    report.note(rounds=variants.ROUNDS, compiler=compiler.version if compiler else None)
    report.line(
        "{how}; least of {rounds} rounds that take turns; ratios to direct",
        how="compiled" if compiler else "CasADi's virtual machine",
        rounds=variants.ROUNDS,
    )
    titles = {"chart": "chart", "n_discs": "N", "actuator": "actuator", "minimum_us": "least us"}
    print("  " + _ROW.format(**titles, ratio="ratio", operations_ratio="operations"))
    for chart in CHARTS:
        for n_discs in sorted(set(options.sizes)):
            _rows(report, chart, n_discs)


def _actuators() -> dict[str, "Actuator"]:
    """In the seed robot's unitless numbers: pressures of 12 in an atmosphere of 120."""
    from ..actuators import Direct, Gas, Hysteresis, Orifice, PressureValve, Regulator

    orifices = Orifice(1e-3, 0.3), Orifice(1e-3, 0.4)
    gas = Gas(*orifices, supply_pressure=60.0, valve=PressureValve(4.0), atmosphere=120.0)
    return {
        "direct": Direct(),
        "regulator": Regulator(),
        "gas": gas,
        "hysteresis": Hysteresis(Direct(), 1.0),
        "gas, hysteresis": Hysteresis(gas, 1.0),
    }


def _rows(report: "Report", chart: str, n_discs: int) -> None:
    from ..model import build

    robot = seed_robot(n_discs)
    models = {
        name: build(robot, chart=chart, inflation="volume", actuator=actuator)
        for name, actuator in _actuators().items()
    }
    times, counts = variants.in_turn(models)
    for name in models:
        report.row(
            "timings",
            _ROW,
            chart=chart,
            n_discs=n_discs,
            actuator=name,
            minimum_us=times[name],
            ratio=times[name] / times["direct"] if times["direct"] else None,
            operations_ratio=counts[name] / counts["direct"],
        )
