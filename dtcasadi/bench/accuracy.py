"""Discs and threads against what is known of beams, chains and pendulums, by number of discs."""

import argparse
import math
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..cli.common import Report
    from .columns import Column

SIZES = (4, 8, 16, 32, 64)
# The segments in which the share of shear is measured, and how much softer for that.
_SHARE_SIZE, _SOFTER = 8, 4.0
# An error below this is round-off; there is no order to see in it.
_ROUND_OFF = 1e-8
_PRINTED = (
    *("tip_load_1_drop", "tip_load_10_drop", "heavy_elastica_5_drop", "end_moment_circle"),
    "inflated_tube",
    *("euler", "greenhill", "beck", "beck_damped", "cantilever_f1", "cantilever_f2"),
    *("hanging_chain_1", "n_pendulum_3", "large_pendulum", "torque_free_energy", "sleeping_top"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument(
        "--sizes", type=_size, nargs="+", default=list(SIZES), metavar="N", help="numbers of discs"
    )
    parser.add_argument("--png", type=Path, metavar="F", help="draw error against discs and cost")
    parser.add_argument("--no-cost", action="store_true", help="time nothing, compile nothing")


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure every anchor at every size."""
    from ..cli.common import check_target

    if options.png:
        check_target(options.png)
    sizes = sorted(set(options.sizes))
    report.section("anchors", f"anchors with {', '.join(map(str, sizes))} discs")
    anchors, cost = measured(sizes, with_cost=not options.no_cost)
    report.note(**anchors)
    widths = "{:24} {:>11} {:>6}" + " {:>10}" * len(sizes)
    print("  " + widths.format("relative error", "reference", "order", *map(str, sizes)))
    for name in _PRINTED:
        print("  " + widths.format(*_row(name, anchors[name], sizes)))
    report.section("cost", "the state equation of the rod, in the plane")
    report.note(**{str(n): cost[n] for n in sizes})
    for n, costs in ((n, cost[n]) for n in sizes if "ode_us" in cost[n]):
        text = f"{costs['operations']:7d} operations, {costs['ode_us']:8.3g} us a call"
        print(f"  {n:4} discs: {text}")
    if options.png:
        from .accuracy_picture import picture

        picture(anchors, cost, options.png)
        report.wrote(options.png)
        report.list_files()


def measured(
    sizes: Sequence[int], *, with_cost: bool = True
) -> tuple[dict[str, Any], dict[int, dict[str, Any]]]:
    """Every anchor as in the JSON file, and the cost by number of discs."""
    from tqdm import tqdm

    from .columns import Column, beam_references
    from .exact import chain_frequencies, chain_references, exact_values

    known = beam_references() | chain_references()
    values: dict[str, dict[int, float]] = {name: {} for name in known}
    cost: dict[int, dict[str, Any]] = {}
    bar = tqdm(sizes, leave=False, delay=1.0, disable=not sys.stderr.isatty(), unit="size")
    for n_discs in bar:
        bar.set_description(f"{n_discs} discs")
        column = Column(n_discs)
        start = time.perf_counter()
        found = column.values() | chain_frequencies(n_discs)
        cost[n_discs] = {"anchors_s": time.perf_counter() - start}
        if with_cost:
            cost[n_discs] |= _cost(column)
        for name, value in found.items():
            values[name][n_discs] = value
    shares = shear_shares()
    anchors = {
        name: entry(reference, values[name], shares.get(name, 0.0))
        for name, reference in known.items()
    }
    for name, (reference, n_discs, value) in exact_values().items():
        anchors[name] = entry(reference, {n_discs: value}, 0.0)
    return anchors, cost


def entry(reference: float, values: Mapping[int, float], share: float) -> dict[str, Any]:
    """One anchor of the JSON file.

    Args:
        reference: what is known.
        values: what was found, by number of discs.
        share: what shear adds to the relative error, times (n_discs - 1)^2.
    """
    errors = {n: value / reference - 1 for n, value in values.items()}
    rows = {
        str(n): {
            "value": values[n],
            "relative_error": errors[n],
            "timoshenko_share": share / (n - 1) ** 2,
        }
        for n in values
    }
    return {"reference": reference, "order": observed_order(errors), "by_discs": rows}


def observed_order(errors: Mapping[int, float]) -> float | None:
    """Order in the length of a segment between the two finest sizes; None for exact anchors."""
    finest = sorted(errors)[-2:]
    if len(finest) < 2 or min(abs(errors[n]) for n in finest) < _ROUND_OFF:
        return None
    (a, b) = finest
    return math.log(abs(errors[a] / errors[b])) / math.log((b - 1) / (a - 1))


def shear_shares() -> dict[str, float]:
    """Relative share of shear in each beam anchor, times (n_discs - 1)^2: from a softer rod."""
    from .columns import Column

    stiff, soft = (Column(_SHARE_SIZE, softer).values() for softer in (1.0, _SOFTER))
    scale = (_SHARE_SIZE - 1) ** 2 / (_SOFTER - 1)
    return {name: scale * (soft[name] / value - 1) for name, value in stiff.items()}


def _cost(column: "Column") -> dict[str, Any]:
    """Operations and time of one call of the state equation."""
    from .dynamics import operations, time_per_call

    model = column.model
    median, _ = time_per_call(model.compiled("ode").function, model.theta0)
    return {"operations": operations(model.function("ode")), "ode_us": median}


def _row(name: str, anchor: Mapping[str, Any], sizes: Sequence[int]) -> list[str]:
    order = anchor["order"]
    cells = [anchor["by_discs"].get(str(n)) for n in sizes]
    if not any(cells):  # exact, at a number of discs of its own
        cells[0] = next(iter(anchor["by_discs"].values()))
    errors = ["" if cell is None else f"{cell['relative_error']:+.1e}" for cell in cells]
    return [
        name,
        f"{anchor['reference']:.6f}",
        "exact" if order is None else f"{order:.2f}",
        *errors,
    ]


def _size(text: str) -> int:
    number = int(text)
    if not 4 <= number <= 256:
        raise argparse.ArgumentTypeError(f"expected a number of discs from 4 to 256, got {text}")
    return number
