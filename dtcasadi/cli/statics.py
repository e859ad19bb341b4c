"""`dtcasadi statics SCENE`: where a scene's robot rests, or a curve of equilibria."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import StaticsError
from .common import FAILED, Report, check_target, phase
from .running import describe

if TYPE_CHECKING:
    from ..statics import Branch, Equilibrium

_MODES = 6
_ROWS = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument(
        "--pressure",
        metavar="P",
        type=float,
        nargs="+",
        help="chamber pressures [Pa], one for all or one for each [the scene's at its end]",
    )
    parser.add_argument("--from", metavar="S", type=float, dest="start", help="follow from here")
    parser.add_argument("--to", metavar="S", type=float, dest="stop", help="to here")
    parser.add_argument("--points", metavar="N", type=int, default=100, help="about how many")
    parser.add_argument(
        "--parameter",
        metavar="NAME",
        default="pressure",
        help="what changes: pressure, pressure[2], tau[1], springs.stiffness, wrench[3] [pressure]",
    )
    parser.add_argument("--steps", action="store_true", help="plain steps: end at a limit point")
    parser.add_argument("--wrench", metavar="DISC", type=int, nargs="+", help="discs with a load")
    parser.add_argument("--chart", metavar="NAME", help="coordinates instead of the scene's")
    parser.add_argument("--png", metavar="F", help="draw the modes, or the branch's diagram")
    parser.add_argument("--view", choices=("plane", "3d"), help="how to see the robot")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Find what was asked for, report and draw it."""
    from ..scene import load_scene
    from ..statics.search import search_of

    if (options.start is None) != (options.stop is None):
        raise StaticsError("expected both --from and --to, or neither")
    scene = load_scene(options.scene)
    picture = _picture(options.png) if options.png else None
    model = scene.build(**_build(options))
    describe(scene, model, report)
    report.section("phases", "wall time")
    with phase(report, "compile", "compile, or find it  {seconds:8.3f} s"):
        search_of(model)
    pressure: Any = scene.pressure(scene.t_end) if options.pressure is None else options.pressure
    if isinstance(pressure, list) and len(pressure) == 1:
        (pressure,) = pressure
    if options.start is None:
        return _single(model, pressure, picture, options.view, report)
    return _curve(model, pressure, picture, options, report)


def _single(
    model: Any, pressure: Any, picture: Path | None, view: str | None, report: Report
) -> int | None:
    from ..statics import equilibrium, plots

    with phase(report, "search", "search               {seconds:8.4f} s"):
        found = equilibrium(model, pressure)
    _describe(found, report)
    if picture and found.success:
        with phase(report, "picture", "draw picture         {seconds:8.3f} s"):
            plots.modes(found, picture, view=view)
        report.wrote(picture)
    report.list_files()
    return None if found.success else FAILED


def _curve(
    model: Any, pressure: Any, picture: Path | None, options: argparse.Namespace, report: Report
) -> int | None:
    from ..statics import branch, plots

    with phase(report, "follow", "follow               {seconds:8.3f} s"):
        curve = branch(
            model,
            options.parameter,
            options.start,
            options.stop,
            pressure=pressure,
            points=options.points,
            method="step" if options.steps else "arc",
        )
    _table(curve, report)
    if picture and curve.points:
        with phase(report, "picture", "draw picture         {seconds:8.3f} s"):
            plots.diagram(curve, picture, view=options.view)
        report.wrote(picture)
    report.list_files()
    return None if curve.success else FAILED


def _picture(name: str) -> Path:
    """The path of a picture that can be written."""
    from ..style import SUFFIXES, checked_suffix

    return check_target(checked_suffix(name, SUFFIXES))


def _build(options: argparse.Namespace) -> dict[str, Any]:
    """Options of the model that replace the scene's."""
    build: dict[str, Any] = {}
    if options.chart:
        build["chart"] = options.chart
    if options.wrench:
        build["wrenches"] = options.wrench
    name = options.parameter
    block = name.rpartition("[")[0] if name.endswith("]") else name  # up[1]: an entry
    if block not in ("pressure", "tau", "wrench"):
        build["parameters"] = (block,)
    return build


def _describe(found: "Equilibrium", report: Report) -> None:
    """One equilibrium on screen and in the record."""
    report.section("equilibrium", "equilibrium")
    report.line("{message}", message=found.message)
    report.note(
        success=found.success,
        status=found.status,
        kind=found.kind,
        stable=found.stable,
        residual_Nm=found.residual,
        load_Nm=found.load,
        pressure_Pa=found.pressure,
        iterations=found.iterations,
        evaluations=found.evaluations,
        recentrings=found.recentrings,
    )
    if not found.success:
        return
    tip = _tip(found)
    report.line(
        "centre of the last disc at x {x_m:.6g}, y {y_m:.6g}, z {z_m:.6g} m",
        **dict(zip(("x_m", "y_m", "z_m"), tip, strict=True)),
    )
    tension = found.thread_tension
    thread = int(tension.argmin()) + 1
    report.line(
        "lowest thread tension: {tension_N:.4g} N, in thread {tension_thread}{tension_remark}",
        tension_N=tension.min(),
        tension_thread=thread,
        tension_remark=" (negative: a real thread would go slack)" if tension.min() < 0 else "",
    )
    report.note(
        q=found.q,
        coordinate_names=found.model.coordinate_names,
        theta=found.theta,
        floppy=found.floppy.T,
    )
    report.section("modes", "small motion")
    print(f"  without damping  {_some([f'{w:.3g}' for w in found.frequencies])} rad/s")
    values = [value for value in found.eigenvalues if value.imag >= 0]
    words = [f"{v.real:.3g}" + (f" ± {v.imag:.3g} i" if v.imag else "") for v in values]
    print(f"  eigenvalues      {_some(words)} 1/s")
    report.note(
        frequencies=found.frequencies,
        eigenvalues_real=found.eigenvalues.real,
        eigenvalues_imag=found.eigenvalues.imag,
    )


def _some(words: list[str]) -> str:
    """The first few of a list, in order."""
    return ", ".join(words[:_MODES]) + (", ..." if len(words) > _MODES else "")


def _table(curve: "Branch", report: Report) -> None:
    """A branch on screen, some of its points; in the record all of them."""
    report.section("branch", f"equilibria against {curve.parameter}")
    report.line("{message}", message=curve.message)
    report.note(
        success=curve.success,
        parameter=curve.parameter,
        method=curve.method,
        s=curve.s,
        kind=[point.kind for point in curve.points],
        stable=curve.stable,
        q=[point.q for point in curve.points],
        tip_m=curve.tips,
        growth=[point.eigenvalues[0].real for point in curve.points],
        residual_Nm=[point.residual for point in curve.points],
    )
    row = "{s:>12} {kind:>12} {x_m:>10} {y_m:>10} {z_m:>10} {growth:>12}"
    print("  " + row.format(s="s", kind="", x_m="x m", y_m="y m", z_m="z m", growth="growth 1/s"))
    count = len(curve.points)
    shown = sorted({round(k * (count - 1) / (_ROWS - 1)) for k in range(_ROWS)}) if count else []
    for k in shown:
        x, y, z = (float(value) for value in curve.tips[k])
        report.row(
            "table",
            row,
            s=float(curve.s[k]),
            kind=curve.points[k].kind,
            x_m=x,
            y_m=y,
            z_m=z,
            growth=float(curve.points[k].eigenvalues[0].real),
        )
    for event in curve.events:
        x, y, z = (float(value) for value in _tip(event.equilibrium))
        report.row(
            "events",
            "{s:>12} {kind}, {multiplicity} mode(s)",
            s=event.s,
            kind=event.kind,
            multiplicity=event.multiplicity,
            after=event.after,
            tip_m=[x, y, z],
        )


def _tip(found: "Equilibrium") -> Any:
    """Centre of mass of the last disc."""
    R, r = found.poses
    return r[-1] + R[-1] @ found.model.robot.discs[-1].centre_of_mass
