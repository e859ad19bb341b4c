"""`dtcasadi demo`: the paper's robot, simulated, drawn and reported."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from .common import FAILED, Report, made_folder, phase
from .running import draw, health, simulated

if TYPE_CHECKING:
    from ..result import Run

SCENE = "seed_four_disc"
FOLDER = "dtcasadi_demo"
# Ten seconds in four, in a picture small enough for a web page.
_FPS, _SPEED = 10, 2.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", default=FOLDER, help=f"folder for files [{FOLDER}]"
    )


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Simulate the seed scene, draw it, and say what happened."""
    start = time.perf_counter()
    folder = made_folder(Path(options.output))
    from ..scene import load_scene

    scene = load_scene(SCENE)
    result = simulated(scene, report, {})
    report.wrote(result.save(folder / f"{SCENE}.npz"))
    with phase(report, "pictures", "draw pictures        {seconds:8.3f} s"):
        draw(result, folder, report)
    with phase(report, "animation", "draw animation       {seconds:8.3f} s"):
        from ..animate import animate

        report.wrote(animate(result, folder / "animation.gif", _FPS, speed=_SPEED))
    what_happened(result, report)
    health(result, report)
    report.list_files()
    report.section("phases", "whole command")
    report.line("{total:.3f} s after start-up", total=time.perf_counter() - start)
    return None if result.success else FAILED


def what_happened(run: "Run", report: Report) -> None:
    """The fall, the rise and the end, from the run's own numbers."""
    import numpy as np

    n, t = run.model.n_discs, run.t
    R, r = run.poses()
    centre = r[:, -1] + R[:, -1] @ run.model.robot.discs[-1].centre_of_mass
    height = centre @ run.model.robot.up
    low = int(np.argmin(height))
    high = low + int(np.argmax(height[low:]))
    tilt = np.unwrap(np.arctan2(R[:, -1, 2, 1], R[:, -1, 1, 1]))
    late = t >= t[-1] - 0.1 * (t[-1] - t[0])
    report.section("motion", f"what happened to the centre of disc {n}")
    report.line(
        "falls from height {start_m:.3f} m to {lowest_m:.3f} m at {lowest_s:.2f} s",
        start_m=height[0],
        lowest_m=height[low],
        lowest_s=t[low],
    )
    report.line(
        "is lifted by {rise_m:.3f} m, to {highest_m:.3f} m at {highest_s:.2f} s",
        rise_m=height[high] - height[low],
        highest_m=height[high],
        highest_s=t[high],
    )
    report.line(
        "is at {end_m:.3f} m at {end_s:.4g} s, having moved within {late_range_m:.3f} m "
        "over the last {late_s:.2g} s",
        end_m=height[-1],
        end_s=t[-1],
        late_range_m=np.ptp(height[late]),
        late_s=0.1 * (t[-1] - t[0]),
    )
    report.line(
        "disc {disc} is tilted by {tilt_min_rad:.3f} to {tilt_max_rad:.3f} rad on the way",
        disc=n,
        tilt_min_rad=tilt.min(),
        tilt_max_rad=tilt.max(),
    )
