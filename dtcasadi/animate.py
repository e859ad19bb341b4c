"""A run as a moving picture: GIF, or MP4 where ffmpeg is present."""

import math
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from tqdm import tqdm

from .artists import SIGNS_HEIGHT, add_signs, legend_handles, set_stage, signs_width
from .motion import Motion
from .result import Run
from .style import PictureError, checked_suffix, new_figure, styled

SUFFIXES = (".gif", ".mp4")
# Moving pictures are looked at closely by nobody, and each frame costs time.
_WIDTH_IN, _DPI = 5.2, 100
_FASTER = " ({:.3g} times as fast)"
_PATIENCE_S = 1.0


@styled
def animate(
    run: Run,
    path: str | Path,
    fps: int = 25,
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
    target = checked_film(path)
    writer = _writer(target.suffix.lower(), fps)
    times, shown_speed = frame_times(run, fps, speed, max_frames)
    motion = Motion.of(run, times, view)
    figure, axes = _over(_stage(motion))
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


def checked_film(path: str | Path) -> Path:
    """The path, if an animation of its kind can be made here.

    Raises:
        PictureError: another suffix, or ffmpeg is missing for an .mp4.
    """
    target = checked_suffix(path, SUFFIXES)
    if target.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise PictureError(f"{target}: .mp4 needs ffmpeg on PATH; install it, or ask for a .gif")
    return target


def _writer(suffix: str, fps: int) -> AbstractMovieWriter:
    if suffix == ".gif":
        return PillowWriter(fps=fps)
    return FFMpegWriter(fps=fps, codec="h264", extra_args=["-pix_fmt", "yuv420p"])


def _stage(motion: Motion) -> tuple[Figure, Axes]:
    """A figure with one panel and everything that does not move.

    Above the panel are the signs of gravity and scale, the frame's caption beside them and the
    legend over both.
    """
    robot, view = motion.run.model.robot, motion.view
    handles = legend_handles(robot)
    columns = len(handles) if len(handles) <= 6 else 4
    legend = 0.08 + 0.18 * math.ceil(len(handles) / columns)
    left, right, bottom = (0.72, 0.15, 0.5) if view.labels else (0.1, 0.1, 0.1)
    width = _WIDTH_IN - left - right
    height = min(max(width * motion.box.size[1] / motion.box.size[0], 1.5), 5.0)
    # An even number of pixels, which video encoders ask for.
    total = math.ceil((height + bottom + SIGNS_HEIGHT + legend) * _DPI / 2) * 2 / _DPI
    figure = new_figure(_WIDTH_IN, total)
    axes = figure.add_axes((left / _WIDTH_IN, bottom / total, width / _WIDTH_IN, height / total))
    set_stage(axes, view, motion.box)
    axes.apply_aspect()
    scale = axes.get_window_extent().width / figure.dpi / motion.box.size[0]
    add_signs(figure, robot, view, (0.03, bottom + height), scale)
    figure.legend(
        handles.values(),
        handles,
        loc="upper center",
        ncols=columns,
        borderaxespad=0.2,
        columnspacing=1.0,
        handlelength=1.5,
        fontsize=8,
    )
    return figure, axes


class _Backdrop(Artist):
    """Pixels that were drawn before."""

    zorder = -1.0

    def __init__(self, pixels: object):
        super().__init__()
        self._pixels = pixels

    def draw(self, renderer: Any) -> None:
        """Copy them to the page."""
        renderer.restore_region(self._pixels)


def _over(stage: tuple[Figure, Axes]) -> tuple[Figure, Axes]:
    """A figure with the given one as a still picture behind empty axes in the same place.

    Drawing words and axes anew in every frame would take several times as long as the robot.
    """
    still, axes = stage
    still.set_dpi(_DPI)
    canvas = FigureCanvasAgg(still)
    canvas.draw()
    figure = new_figure(*still.get_size_inches())
    figure.add_artist(_Backdrop(canvas.copy_from_bbox(still.bbox)))
    over = figure.add_axes(axes.get_position().bounds)
    over.set_axis_off()
    over.set_xlim(axes.get_xlim())
    over.set_ylim(axes.get_ylim())
    return figure, over


def _caption_on(figure: Figure, axes: Axes, motion: Motion) -> Text:
    """An empty text above the axes, beside the signs.

    A title of the axes would be laid out anew in every frame.
    """
    above = axes.get_position().y1 + SIGNS_HEIGHT / 2 / figure.get_size_inches()[1]
    beside = (signs_width(motion.view) / _WIDTH_IN + 1) / 2
    return figure.text(beside, above, "", ha="center", va="center")


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
    title = _caption_on(figure, axes, motion)
    faster = "" if speed == 1 else _FASTER.format(speed)
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
        except BrokenPipeError:
            pass  # ffmpeg has ended; `finish` knows why
        except BaseException:
            with suppress(Exception):
                writer.finish()  # ends ffmpeg
            raise
        writer.finish()
    except subprocess.CalledProcessError as error:
        reason = (error.stderr or str(error)).strip().splitlines()[-1]
        raise PictureError(f"ffmpeg failed: {reason}") from error
