"""`dtcasadi mpc SCENE`: control a scene's pressures in closed loop with a robot that differs."""

import argparse
from pathlib import Path
from typing import Any

from .common import FAILED, Report, check_target, phase
from .simulate import check_film

CONTROLLERS = ("rti", "full", "pi", "static")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument(
        "--controller", choices=CONTROLLERS, default="rti", help="default: the real-time iteration"
    )
    parser.add_argument("--solver", default="ipopt", help="of the controller full; default: ipopt")
    parser.add_argument(
        "--estimator", metavar="NAME", default="ekf", help="which filter, or none: the true state"
    )
    parser.add_argument("--t-end", metavar="S", type=float, help="duration [s]")
    parser.add_argument("--png", metavar="F", help="draw outputs, pressures and times")
    parser.add_argument("--animate", metavar="F", help="draw the robot and what is predicted")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Build, run, say and draw."""
    from ocp.closed_loop import closed_loop
    from ocp.scenario import experiment

    from ..scene import load_scene

    scene = load_scene(options.scene)
    if options.png:
        check_target(Path(options.png))
    if options.animate:
        check_film(options.animate)
    report.section("phases", "wall time")
    with phase(report, "build", "build, compile       {seconds:8.3f} s"):
        found = experiment(scene)
        estimator = _estimator(found.scene, options.estimator)
        controller = _controller(found, options)
    t_end = options.t_end or scene.t_end
    with phase(report, "loop", "closed loop          {seconds:8.3f} s"):
        loop = closed_loop(
            controller,
            found.plant,
            found.stages,
            t_end=t_end,
            estimator=estimator,
            measured=scene.control.measured if scene.control and estimator else None,
        )
    _figures(loop, found, t_end, report)
    if options.png:
        from ocp.plots import picture

        picture(loop, options.png, title=scene.title)
        report.wrote(Path(options.png))
    if options.animate:
        from ocp.plots import film

        with phase(report, "animation", "draw animation       {seconds:8.3f} s"):
            report.wrote(film(loop, found, options.animate))
    report.list_files()
    return FAILED if loop.violations else None


def _estimator(scene: Any, name: str) -> Any:
    from estimators.registry import chosen
    from estimators.scenario import discrete_of

    if name == "none":
        return None
    (choice,) = chosen(name).values()
    return choice.build(scene, discrete_of(scene))


def _controller(found: Any, options: argparse.Namespace) -> Any:
    """The controller of a name."""
    from ocp.baselines import FullMPC, PIControl, StaticControl
    from ocp.mpc import PressureMPC
    from ocp.solvers import Solver
    from ocp.transcribe import transcribe

    s, u0 = found.stages, found.plant.u0
    if options.controller == "rti":
        return PressureMPC(s.discrete, s.problem, u0=u0)
    if options.controller == "full":
        return FullMPC(Solver(transcribe(s), options.solver), u0)
    return {"pi": PIControl, "static": StaticControl}[options.controller](s, u0)


def _figures(loop: Any, found: Any, t_end: float, report: Report) -> None:
    """What the loop came to."""
    import numpy as np

    from ocp.scenario import control_of, spans

    s = loop.stages
    units = sorted({unit for _, unit in s.channels})
    rests, moves = spans(control_of(found.scene).reference, t_end)
    report.section("loop", "closed loop")
    report.line(
        "tracked {channels} [{unit}] over {calls} calls, robot {length_m:.3g} m long",
        channels=", ".join(name for name, _ in s.channels),
        unit="/".join(units),
        calls=len(loop.t),
        length_m=found.length,
    )
    factor, unit = _shown(units)
    for t_from, t_to in rests:
        report.row(
            "rests",
            "rest  {t_from:>6} to {t_to:>6} s: steady error {steady:>8} " + unit,
            t_from=round(t_from, 3),
            t_to=round(t_to, 3),
            steady=loop.steady(t_from, t_to) * factor,
        )
    for t_from, t_to in moves:
        report.row(
            "moves",
            "move  {t_from:>6} to {t_to:>6} s: tracking rms {rms:>8} " + unit,
            t_from=round(t_from, 3),
            t_to=round(t_to, 3),
            rms=loop.rms(t_from, t_to) * factor,
        )
    report.line("limits violated in {violations} calls", violations=loop.violations)
    report.line(
        "time of a call after the first: median {median_ms:.3g} ms, 99 % {p99_ms:.3g} ms",
        median_ms=1e3 * float(np.median(loop.seconds[1:])),
        p99_ms=1e3 * float(np.quantile(loop.seconds[1:], 0.99)),
    )
    texts = [told.text for told in loop.told]
    counts = {text: texts.count(text) for text in dict.fromkeys(texts)}
    report.note(statuses=counts)
    for text, count in list(counts.items())[:5]:
        print(f"  {count:5} calls: {text}")


def _shown(units: list[str]) -> tuple[float, str]:
    import math

    return {"m": (1e3, "mm"), "rad": (180 / math.pi, "deg")}.get(
        units[0] if len(units) == 1 else "", (1.0, "")
    )
