"""`dtcasadi estimate SCENE [LOG]`: a filter on a scene's sensors or on a log."""

import argparse
from pathlib import Path

from ..errors import EstimationError
from .common import Report, check_target, phase


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument("log", metavar="LOG", nargs="?", help="a .csv or .npz file")
    parser.add_argument("--estimator", choices=("ekf",), default="ekf", help="which filter")
    parser.add_argument("--png", metavar="F", help="draw truth and estimate")
    parser.add_argument("--save-log", metavar="F", help="write the simulated measurements as .csv")
    parser.add_argument("--t-end", metavar="S", type=float, help="duration [s]")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Simulate or read measurements, filter them, say and draw what came out."""
    from estimators.report import drawn, figures
    from estimators.runner import track
    from estimators.scenario import discrete_of, ekf_of, moved, recorded

    from ..logs import read_log
    from ..scene import load_scene

    scene = load_scene(options.scene)
    for target in (options.png, options.save_log):
        if target:
            check_target(Path(target))
    log = read_log(options.log) if options.log else None
    report.section("phases", "wall time")
    with phase(report, "build", "build, compile       {seconds:8.3f} s"):
        discrete = discrete_of(scene)
        ekf = ekf_of(scene, discrete)
    truth = None
    if log is None:
        with phase(report, "simulate", "simulate             {seconds:8.3f} s"):
            truth = moved(scene, discrete, options.t_end)
            log = recorded(scene, discrete, truth)
    if options.save_log:
        report.wrote(log.save(options.save_log))
    with phase(report, "filter", "filter               {seconds:8.3f} s"):
        found = track(ekf, log, t_end=options.t_end)
    if not any(est.used for est in found.estimates):
        raise EstimationError(f"{log.source}: expected readings of the scene's sensors, got none")
    figures(discrete, found, truth, report)
    if options.png:
        report.wrote(drawn(discrete, found, truth, Path(options.png)))
    report.list_files()
    return None
