"""`dtcasadi bench mpc`: controllers in closed loop, with the filter of each scene."""

import argparse
from typing import Any

from .common import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    from ocp import bench

    bench.add_arguments(parser)


def run(options: argparse.Namespace, report: Report) -> None:
    """Measure."""
    from ocp import bench

    bench.run(options, report, estimators=_filter_of)


def _filter_of(scene: Any) -> Any:
    from estimators.registry import chosen
    from estimators.scenario import discrete_of

    return chosen("ekf")["ekf"].build(scene, discrete_of(scene))
