"""`dtcasadi identify SCENE LOG ... --free PATHS`: parameters of a robot from recorded motions."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import IdentificationError
from .common import FAILED, Report, check_target, phase

if TYPE_CHECKING:
    pass


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument("logs", metavar="LOG", nargs="+", help=".csv or .npz files")
    parser.add_argument(
        "--free",
        metavar="PATHS",
        required=True,
        help="what to find, separated by commas: springs.stiffness,damping.c_w,springs[*].damping",
    )
    pair = {"action": "append", "default": []}
    parser.add_argument("--start", metavar="PATH=V", help="start here instead", **pair)  # type: ignore[arg-type]
    parser.add_argument("--bounds", metavar="PATH=LOW:HIGH", help="either may be empty", **pair)  # type: ignore[arg-type]
    parser.add_argument("--prior", metavar="PATH=MEAN:SIGMA", help="known before", **pair)  # type: ignore[arg-type]
    parser.add_argument(
        "--validate",
        metavar="LOG|SHARE",
        nargs="+",
        help="logs to predict, or the share of each log to leave out at its end and predict",
    )
    parser.add_argument(
        "--initial",
        metavar="WHAT",
        default="unknown",
        help="first states: unknown, known (the scene's) or their standard deviation [unknown]",
    )
    parser.add_argument("--loss", choices=("squares", "huber"), default="squares")
    parser.add_argument("--step", metavar="S", type=float, help="step of the model [s]")
    parser.add_argument("--method", metavar="NAME", default="sdirk2", help="one-step method")
    parser.add_argument("--nodes", metavar="N", type=int, default=20, help="shooting nodes [20]")
    parser.add_argument("--begin", choices=("data", "simulation"), default="data")
    parser.add_argument("--level", metavar="P", type=float, default=0.95, help="of the intervals")
    parser.add_argument("--chart", metavar="NAME", help="coordinates instead of the scene's")
    parser.add_argument("--png", metavar="F", help="draw fit, residuals and intervals")
    parser.add_argument("-o", "--output", metavar="F", help="write the numbers as .npz")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Identify, say what came out and how far to believe it."""
    from ..identify import Settings, identify
    from ..identify.report import parameter_lines, test_lines, validation_lines
    from ..scene import load_scene

    scene = load_scene(options.scene)
    for target in (options.output, options.png):
        if target:
            check_target(Path(target))
    settings: dict[str, Any] = {
        "start": {name: _number(text, name) for name, text in _named("start", options.start)},
        "bounds": {name: _range(name, text) for name, text in _named("bounds", options.bounds)},
        "priors": {name: _range(name, text) for name, text in _named("prior", options.prior)},
        "validate": _validate(options.validate),
        "initial": _initial(options.initial),
        "settings": Settings(
            loss=options.loss, nodes=options.nodes, begin=options.begin, level=options.level
        ),
    }
    if options.chart:
        settings["chart"] = options.chart
    report.section("phases", "wall time")
    with phase(report, "identify", "build, compile, identify {seconds:8.3f} s"):
        found = identify(
            scene,
            options.logs,
            [path for path in options.free.split(",") if path],
            step_s=options.step,
            method=options.method,
            **settings,
        )
    report.line("of these the search      {solve_s:8.3f} s", solve_s=found.solve_s)
    report.section("identify", f"{found.status}: {found.message}")
    report.note(**found.record())
    for line in parameter_lines(found):
        print(line)
    for sentence in found.unidentifiable:
        print(f"  not told apart: {sentence}")
    _lines("residuals", test_lines(found.tests))
    for each in found.validation:
        _lines("validation", validation_lines(each))
    _lines("notes", [f"  {note}" for note in found.notes])
    if options.output:
        report.wrote(found.save(options.output))
    if options.png:
        from ..identify.plots import picture

        picture(found, options.png)
        report.wrote(Path(options.png))
    report.list_files()
    return None if found.success else FAILED


def _lines(title: str, lines: list[str]) -> None:
    if lines:
        print(f"\n{title}")
    for line in lines:
        print(line)


def _named(option: str, given: list[str]) -> list[tuple[str, str]]:
    """Name and text of each `PATH=...`."""
    pairs = []
    for text in given:
        name, equals, value = text.rpartition("=")
        if not equals or not name:
            raise IdentificationError(f"--{option}: expected PATH=..., got {text!r}")
        pairs.append((name.strip(), value))
    return pairs


def _range(name: str, text: str) -> tuple[float | None, float | None]:
    """Two numbers around a colon, None for an empty one."""
    low, colon, high = text.partition(":")
    if not colon:
        raise IdentificationError(f"{name}: expected two numbers as LOW:HIGH, got {text!r}")
    first, second = (_number(part, name) if part.strip() else None for part in (low, high))
    return first, second


def _number(text: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise IdentificationError(f"{name}: expected a number, got {text!r}") from None


def _initial(text: str) -> str | float:
    return text if text in ("unknown", "known") else _number(text, "--initial")


def _validate(given: list[str] | None) -> float | list[str] | None:
    """Logs, or a share where it is one number."""
    if given and len(given) == 1:
        try:
            return float(given[0])
        except ValueError:
            pass
    return given
