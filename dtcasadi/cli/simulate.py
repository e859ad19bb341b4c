"""`dtcasadi simulate SCENE`: run a scene file or one that comes with the package."""

import argparse
from pathlib import Path

from .common import FAILED, Report, check_target, made_folder, phase
from .running import draw, health, simulated


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument("-o", "--output", metavar="F", help="write the run to this .npz file")
    parser.add_argument("--plots", metavar="FOLDER", help="draw the pictures into it")
    parser.add_argument("--animate", metavar="F", help="draw a .gif, or an .mp4 (needs ffmpeg)")
    parser.add_argument("--view", choices=("plane", "3d"), help="how to see the robot")
    parser.add_argument("--chart", metavar="NAME", help="coordinates instead of the scene's")
    parser.add_argument("--method", metavar="NAME", help="integration method")
    parser.add_argument("--t-end", metavar="S", type=float, help="duration [s]")
    parser.add_argument("--step", metavar="S", type=float, help="step of a fixed-step method [s]")
    parser.add_argument(
        "--fixed", action="store_true", help="steps of this size, without error control"
    )
    parser.add_argument(
        "--force", action="store_true", help="take a step beyond the linear stability limit"
    )
    parser.add_argument("--rtol", metavar="X", type=float, help="relative tolerance")
    parser.add_argument("--atol", metavar="X", type=float, help="absolute tolerance")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Simulate a scene, and write what was asked for."""
    from ..scene import load_scene

    scene = load_scene(options.scene)
    # What cannot be written is better said before a long run than after it.
    output = check_target(_npz(options.output)) if options.output else None
    film = check_film(options.animate) if options.animate else None
    pictures = made_folder(Path(options.plots)) if options.plots else None
    result = simulated(
        scene,
        report,
        {"chart": options.chart} if options.chart else {},
        force=options.force,
        method=options.method,
        t_end=options.t_end,
        step_s=options.step,
        fixed=options.fixed or None,
        rtol=options.rtol,
        atol=options.atol,
    )
    if output:
        report.wrote(result.save(output))
    if pictures:
        with phase(report, "pictures", "draw pictures        {seconds:8.3f} s"):
            draw(result, pictures, report, options.view)
    if film:
        from ..animate import animate

        with phase(report, "animation", "draw animation       {seconds:8.3f} s"):
            report.wrote(animate(result, film, view=options.view))
    health(result, report)
    report.list_files()
    return None if result.success else FAILED


def _npz(name: str) -> Path:
    path = Path(name)
    return path if path.suffix == ".npz" else path.with_name(f"{path.name}.npz")


def check_film(name: str) -> Path:
    """The path of an animation that can be made and written.

    Raises:
        PictureError: the suffix is not known, or ffmpeg is missing.
        OSError: the file cannot be written.
    """
    from ..animate import checked_film

    return check_target(checked_film(name))
