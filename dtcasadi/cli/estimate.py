"""`dtcasadi estimate SCENE [LOG]`: filters on a scene's sensors or on a log."""

import argparse
from pathlib import Path
from typing import Any

from ..errors import EstimationError
from .common import Report, check_target, phase
from .simulate import check_film


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument("log", metavar="LOG", nargs="?", help="a .csv or .npz file")
    parser.add_argument(
        "--estimator", metavar="NAME", default="ekf", help="which filter, or all (default: ekf)"
    )
    parser.add_argument(
        "--smooth", action="store_true", help="also what the whole log says of every instant"
    )
    parser.add_argument("--png", metavar="F", help="draw truth, measurements and estimate")
    parser.add_argument("--animate", metavar="F", help="draw truth and estimates as .gif or .mp4")
    parser.add_argument("--save-log", metavar="F", help="write the simulated measurements as .csv")
    parser.add_argument(
        "--observability", action="store_true", help="what its sensors can see, before filtering"
    )
    parser.add_argument(
        "--bound",
        metavar="X",
        type=float,
        default=1.0,
        help="deviation sensors may leave, over the one before (default: 1)",
    )
    parser.add_argument("--t-end", metavar="S", type=float, help="duration [s]")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Simulate or read measurements, filter them, say and draw what came out."""
    if options.observability:
        _observe(options, report)
        return None
    from estimators.registry import chosen
    from estimators.report import Tip, figures
    from estimators.truth import moved, recorded

    from ..logs import read_log
    from ..scene import load_scene

    scene, choices = load_scene(options.scene), chosen(options.estimator, smooth=options.smooth)
    for target in (options.png, options.save_log):
        if target:
            check_target(Path(target))
    if options.animate:
        check_film(options.animate)
    log = read_log(options.log) if options.log else None
    report.section("phases", "wall time")
    truth = None
    if log is None:
        with phase(report, "simulate", "build, simulate      {seconds:8.3f} s"):
            truth = moved(scene, options.t_end)
            log = recorded(scene, truth)
    if options.save_log:
        report.wrote(log.save(options.save_log))
    results = _filtered(scene, choices, log, options.t_end, report)
    tip = Tip.of(scene)
    figures(results, tip, truth, report)
    if options.png:
        from estimators.plots import against_time

        shown = [*results.values()]
        report.wrote(against_time(shown, tip, truth, log, Path(options.png)))
    if options.animate:
        from estimators.film import side_by_side

        with phase(report, "animation", "draw animation       {seconds:8.3f} s"):
            report.wrote(side_by_side([*results.values()], truth, Path(options.animate)))
    report.list_files()
    return None


def _observe(options: argparse.Namespace, report: Report) -> None:
    """Say and draw what sets of the scene's sensors can see."""
    from estimators.scenario import discrete_of
    from estimators.sensor_report import described, force_errors, observed, picture, shown
    from estimators.truth import moved

    from .. import checks
    from ..scene import load_scene

    bound = checks.number("bound", options.bound, positive=True, error=_refusal)
    scene = load_scene(options.scene)
    if options.png:
        check_target(Path(options.png))
    report.section("phases", "wall time")
    with phase(report, "simulate", "build, simulate      {seconds:8.3f} s"):
        truth, discrete = moved(scene, options.t_end), discrete_of(scene)
    with phase(report, "observe", "runs beside it       {seconds:8.3f} s"):
        found = observed(scene, discrete, options.t_end)
        sets = shown(found, bound)
    with phase(report, "filter", "filter with each set {seconds:8.3f} s"):
        errors = force_errors(scene, truth, discrete, sets)
    described(found, sets, errors, bound, report)
    if options.png:
        report.wrote(picture(found, sets, errors, bound, options.png))
    report.list_files()


def _refusal(name: str, expected: str, got: object) -> EstimationError:
    return EstimationError(f"{name}: expected {expected}, got {got}")


def _filtered(
    scene: Any, choices: Any, log: Any, t_end: float | None, report: Report
) -> dict[str, Any]:
    """Every chosen filter's run on the log."""
    from estimators.report import Tip, result_of
    from estimators.scenario import discrete_of

    discrete, results = discrete_of(scene), {}
    for name, choice in choices.items():
        with phase(report, f"build_{name}", f"build {name:15}{{seconds:8.3f}} s"):
            made = choice.build(scene, discrete)
        with phase(report, f"filter_{name}", f"filter {name:14}{{seconds:8.3f}} s"):
            found = choice.run(made, log, t_end=t_end)
        if not any(est.used for est in found.estimates):
            raise EstimationError(
                f"{log.source}: expected readings of the scene's sensors, got none"
            )
        results[name] = result_of(choice.title, Tip.of(scene), made.discrete, found)
    return results
