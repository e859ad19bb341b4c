"""`dtcasadi bench NAME`: time the compiled functions on this machine."""

import argparse
from importlib import import_module

from ..bench import BENCHES
from .common import Parser, Report

# Benches of the packages above this one: name -> what it measures.
ABOVE = {
    "estimators": "errors of state estimators, and time of their steps in compiled C",
    "mpc": "time of a controller's step, errors and cost in closed loop, and baselines",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One sub-command for each benchmark."""
    names = parser.add_subparsers(metavar="NAME", dest="bench", required=True, parser_class=Parser)
    for name, line in sorted((BENCHES | ABOVE).items()):
        bench = names.add_parser(name, help=line, description=f"{line[0].upper()}{line[1:]}.")
        folder = "." if name in ABOVE else "..bench."
        file = f"bench_{name}" if name in ABOVE else name.replace("-", "_")
        module = import_module(folder + file, __package__)
        module.add_arguments(bench)
        bench.add_argument("--json", metavar="F", help="write every figure to this file")
        bench.set_defaults(bench_run=module.run)


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Run the benchmark."""
    return options.bench_run(options, report)
