"""A run as a moving picture: GIF, or MP4 where ffmpeg is present."""

import math
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tqdm import tqdm

from .artists import legend_handles, set_stage
from .motion import Motion
from .result import Run
from .style import PictureError, checked_suffix, new_figure, styled

SUFFIXES = (".gif", ".mp4")
# Moving pictures are looked at closely by nobody, and each frame costs time.
_WIDTH_IN, _DPI = 6.0, 100
_PATIENCE_S = 1.0


@styled
def animate(
    run: Run,
    path: str | Path,
    fps: float = 25.0,
    *,
    speed: float = 1.0,
    max_frames: int = 500,
    view: str | None = None,
) -> Path:
    """Write a run as a moving picture.

    A run too long for `max_frames` is shown faster, and the picture says how much.

    Args:
        run: the run.
        path: file to write, ending in .gif or .mp4 (which needs ffmpeg).
        fps: frames per second; a GIF's are at whole hundredths of a second, at most 50.
        speed: simulated seconds per second shown.
        max_frames: most frames to draw.
        view: as in `plots.filmstrip`.

    Returns:
        The path.

    Raises:
        PictureError: another suffix, ffmpeg is missing or fails, or an argument out of range.
        OSError: the file cannot be written; an older one is left as it was.
    """
    target = checked_suffix(path, SUFFIXES)
    writer = _writer(target.suffix.lower(), fps)
    times, shown_speed = frame_times(run, fps, speed, max_frames)
    motion = Motion.of(run, times, view)
    figure, axes = _stage(motion)
    # The name's end tells the writers the format; the folder is on the target's file system.
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder:
        scratch = Path(folder) / f"film{target.suffix.lower()}"
        _film(writer, figure, axes, motion, shown_speed, scratch)
        scratch.replace(target)
    return target


def frame_times(run: Run, fps: float, speed: float, max_frames: int) -> tuple[np.ndarray, float]:
    """Times of the frames, the last one at the run's end, and simulated seconds per second.

    Raises:
        PictureError: an argument out of range.
    """
    for name, value in (("fps", fps), ("speed", speed)):
        if not (math.isfinite(value) and value > 0):
            raise PictureError(f"{name}: expected a positive number, got {value!r}")
    if max_frames < 2:
        raise PictureError(f"max_frames: expected at least 2, got {max_frames!r}")
    duration = float(run.t[-1] - run.t[0])
    speed = max(speed, duration * fps / (max_frames - 1))
    n = max(math.ceil(duration * fps / speed - 1e-9), 1) + 1
    return np.minimum(run.t[0] + np.arange(n) * speed / fps, run.t[-1]), speed


def _writer(suffix: str, fps: float) -> AbstractMovieWriter:
    if suffix == ".gif":
        return PillowWriter(fps=fps)
    if not FFMpegWriter.isAvailable():
        raise PictureError("an .mp4 needs ffmpeg, which is not on PATH: install it, or ask for .gif")
    return FFMpegWriter(fps=fps, codec="h264", extra_args=["-pix_fmt", "yuv420p"])


def _stage(motion: Motion) -> tuple[Figure, Axes]:
    """A figure with one panel and everything that does not move."""
    left, right, bottom, top = (0.6, 0.15, 0.5, 0.7) if motion.view.labels else (0.1, 0.1, 0.1, 0.7)
    shape = motion.box.size[1] / motion.box.size[0]
    width = _WIDTH_IN - left - right
    height = min(max(width * shape, 1.5), 5.0)
    total = height + bottom + top
    figure = new_figure(_WIDTH_IN, total)
    axes = figure.add_axes(
        (left / _WIDTH_IN, bottom / total, width / _WIDTH_IN, height / total)
    )
    set_stage(axes, motion.view, motion.box)
    motion.add_signs(axes, 0)
    handles = legend_handles(motion.run.model.robot)
    figure.legend(
        handles.values(),
        handles,
        loc="upper center",
        ncols=len(handles),
        borderaxespad=0.2,
        columnspacing=1.0,
        handlelength=1.5,
        fontsize=8,
    )
    return figure, axes


def _film(
    writer: AbstractMovieWriter,
    figure: Figure,
    axes: Axes,
    motion: Motion,
    speed: float,
    file: Path,
) -> None:
    """Draw and write every frame."""
    artists = motion.artists_on(axes)
    title = axes.set_title("", pad=4)
    faster = "" if speed == 1 else f" ({speed:.3g} times as fast)"
    numbers = tqdm(
        range(len(motion.times)),
        desc="frames",
        delay=_PATIENCE_S,
        leave=False,
        disable=not sys.stderr.isatty(),
    )
    try:
        writer.setup(figure, str(file), dpi=_DPI)
        try:
            for k in numbers:
                artists.show(*motion.frame(k))
                title.set_text(motion.caption(k) + faster)
                writer.grab_frame()
        except BaseException:
            with suppress(Exception):
                writer.finish()  # ends ffmpeg
            raise
        writer.finish()
    except subprocess.CalledProcessError as error:
        raise PictureError(f"ffmpeg failed: {error}")
