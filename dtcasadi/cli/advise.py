"""`dtcasadi advise SCENE --tolerance 0.02`: the cheapest model that keeps a tolerance."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .common import FAILED, Report, check_target, phase

if TYPE_CHECKING:
    from ..advise import Advice

_ROW = (
    "{n_discs:>5} {chart:>10} {velocity_terms:>8} {actuator:>8} {method:>8} {step_s:>10} "
    "{error:>10} {cost:>10} {wall_time_s:>10}"
)
_ROWS = 14


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument(
        "--tolerance",
        metavar="X",
        type=float,
        default=0.02,
        help="largest error, a share of the range of motion [0.02]",
    )
    parser.add_argument(
        "--quantity",
        metavar="Q",
        default="tip",
        help="tip, shape or pressure-response (where the tip rests, by pressure) [tip]",
    )
    parser.add_argument("--png", metavar="F", help="draw error against cost")
    parser.add_argument("--write", metavar="F", help="write the small model's scene file (.toml)")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Measure, say what was found, write what was asked for."""
    from ..advise import advise
    from ..advise.front import written_scene
    from ..scene import load_scene
    from ..style import SUFFIXES, checked_suffix

    scene = load_scene(options.scene)
    png = check_target(checked_suffix(options.png, SUFFIXES)) if options.png else None
    small = check_target(Path(options.write)) if options.write else None
    report.section("phases", f"{scene.name}: {scene.title}")
    with phase(report, "measure", "measured in {seconds:.1f} s"):
        advice = advise(scene, options.tolerance, quantity=options.quantity)
    report.record |= {"tolerance": options.tolerance, "quantity": options.quantity}
    report.record |= advice.record()
    _describe(advice)
    report.record["planarity"] = advice.planarity.sentence()
    if png:
        from ..advise.picture import picture

        report.wrote(picture(advice, png))
    if advice.best is None:
        known, why = advice.reference.uncertainty, ""
        if known >= advice.tolerance:
            off = f"is off by {known:.1g} of the range" if known < float("inf") else "fails"
            why = f": the reference itself {off}"
        print(f"\nno candidate keeps the tolerance{why}")
        report.list_files()
        return FAILED
    if small:
        report.wrote(written_scene(advice, options.scene, small))
    report.list_files()
    return None


def _describe(advice: "Advice") -> None:
    from ..advise import described

    reference = advice.reference
    kind = "converged" if reference.converged else "NOT CONVERGED"
    print(f"\nreference: {kind}; {reference.note}")
    print(f"plane: {advice.planarity.sentence()}")
    shown = sorted(advice.candidates, key=lambda found: found.cost)
    near = [m for m in shown if m.error < 5 * advice.tolerance and m.candidate.step_s]
    rest = [m for m in shown if not m.candidate.dynamic]
    titles = {"n_discs": "discs", "velocity_terms": "velocity", "wall_time_s": "time s"}
    keys = ("n_discs", "chart", "velocity_terms", "actuator", "method", "step_s", "error", "cost")
    print("\n  " + _ROW.format(**{key: titles.get(key, key) for key in (*keys, "wall_time_s")}))
    for found in sorted([*near[:_ROWS], *rest[:3]], key=lambda m: m.cost):
        one = found.candidate
        chart = one.chart if isinstance(one.chart, str) else "mixed"
        print(
            "  "
            + _ROW.format(
                n_discs=one.n_discs,
                chart=chart,
                velocity_terms=one.velocity_terms,
                actuator=one.actuator,
                method=one.method,
                step_s="-" if one.step_s is None else f"{one.step_s:.3g}",
                error=f"{found.error:.2g}",
                cost=f"{found.cost:.3g}",
                wall_time_s=f"{found.wall_time:.2g}",
            )
            + ("  <- advised" if found is advice.best else "")
        )
    if advice.best is not None:
        best = advice.best
        print(f"\nadvised: {described(best)}")
        print(
            f"  error {best.error:.2g} of the range of motion, {best.cost:.3g} instructions a run"
        )
