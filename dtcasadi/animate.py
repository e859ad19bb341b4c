"""A run as a moving picture: GIF, or MP4 where ffmpeg is present."""

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from tqdm import tqdm

from .artists import SIGNS_HEIGHT, Box, add_signs, legend_handles, set_stage, signs_width
from .motion import Motion
from .result import Run
from .style import ORANGE, PictureError, checked_suffix, new_figure, styled

SUFFIXES = (".gif", ".mp4")
# Moving pictures are looked at closely by nobody, and each frame costs time.
_WIDTH_IN, _DPI = 5.2, 100
# Of several side by side: width of each, and room over it for title, time and pressures.
_PANEL_IN, _CAPTION_IN = 2.6, 0.5
_FASTER = " ({:.3g} times as fast)"
_PATIENCE_S = 1.0


@styled
def animate(
    run: Run | Mapping[str, Run],
    path: str | Path,
    fps: int = 25,
    *,
    speed: float = 1.0,
    max_frames: int = 500,
    view: str | None = None,
    ahead: Callable[[float], np.ndarray] | None = None,
) -> Path:
    """Write a run as a moving picture.

    A run too long for `max_frames` is shown faster, and the picture says how much.

    Args:
        run: the run, or several by their titles, shown side by side over the time of the first.
        path: file to write, ending in .gif or .mp4 (which needs ffmpeg).
        fps: frames per second; a GIF's are at whole hundredths of a second, at most 50.
        speed: simulated seconds per second shown.
        max_frames: most frames to draw.
        view: as in `plots.filmstrip`.
        ahead: time [s] -> points in the root frame, shape (n, 3) [m], drawn as a line in the first
            panel: what was predicted then.

    Returns:
        The path.

    Raises:
        PictureError: another suffix, ffmpeg is missing or fails, or an argument out of range.
        OSError: the file cannot be written; an older one is left as it was.
    """
    target = checked_film(path)
    writer = _writer(target.suffix.lower(), fps)
    runs = {"": run} if isinstance(run, Run) else dict(run)
    times, shown_speed = frame_times(next(iter(runs.values())), fps, speed, max_frames)
    panels = _framed({title: Motion.of(each, times, view) for title, each in runs.items()})
    figure, axes = _over(_stage(panels))
    # The name's end tells the writers the format; the folder is on the target's file system.
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder:
        scratch = Path(folder) / f"film{target.suffix.lower()}"
        _film(
            writer,
            figure,
            list(zip(axes, panels.items(), strict=True)),
            shown_speed,
            scratch,
            ahead,
        )
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


def _framed(motions: dict[str, Motion]) -> dict[str, Motion]:
    """The motions seen alike, within limits that hold all of them."""
    boxes = [motion.box for motion in motions.values()]
    box = Box(
        left=min(box.left for box in boxes),
        right=max(box.right for box in boxes),
        bottom=min(box.bottom for box in boxes),
        top=max(box.top for box in boxes),
    )
    return {title: replace(motion, box=box) for title, motion in motions.items()}


def _stage(panels: Mapping[str, Motion]) -> tuple[Figure, list[Axes]]:
    """A figure with a panel for each motion and everything that does not move.

    Above the first panel are the signs of gravity and scale, the frames' captions beside them or,
    of several panels, over each, and the legend over all.
    """
    motion = next(iter(panels.values()))
    robot, view, n = motion.run.model.robot, motion.view, len(panels)
    handles = legend_handles(robot)
    columns = len(handles) if len(handles) <= 6 else 4
    legend = 0.08 + 0.18 * math.ceil(len(handles) / columns)
    caption = 0.0 if n == 1 else _CAPTION_IN
    left, right, bottom = (0.72, 0.15, 0.5) if view.labels else (0.1, 0.1, 0.1)
    width = _WIDTH_IN - left - right if n == 1 else _PANEL_IN
    height = min(max(width * motion.box.size[1] / motion.box.size[0], 1.5), 5.0)
    # An even number of pixels, which video encoders ask for.
    even = 2 / _DPI
    total = math.ceil((height + bottom + SIGNS_HEIGHT + caption + legend) / even) * even
    across = math.ceil(n * (width + left + right) / even) * even
    figure = new_figure(across, total)
    drawn = []
    for k in range(n):
        start = k * (width + left + right) + left
        place = (start / across, bottom / total, width / across, height / total)
        drawn.append(figure.add_axes(place))
        set_stage(drawn[k], view, motion.box)
        drawn[k].apply_aspect()
    scale = drawn[0].get_window_extent().width / figure.dpi / motion.box.size[0]
    add_signs(figure, robot, view, (0.03, bottom + height + caption), scale)
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
    return figure, drawn


class _Backdrop(Artist):
    """Pixels that were drawn before."""

    zorder = -1.0

    def __init__(self, pixels: object):
        super().__init__()
        self._pixels = pixels

    def draw(self, renderer: Any) -> None:
        """Copy them to the page."""
        renderer.restore_region(self._pixels)


def _over(stage: tuple[Figure, list[Axes]]) -> tuple[Figure, list[Axes]]:
    """A figure with the given one as a still picture behind empty axes in the same place.

    Drawing words and axes anew in every frame would take several times as long as the robot.
    """
    still, axes = stage
    still.set_dpi(_DPI)
    canvas = FigureCanvasAgg(still)
    canvas.draw()
    figure = new_figure(*still.get_size_inches())
    figure.add_artist(_Backdrop(canvas.copy_from_bbox(still.bbox)))
    found = []
    for under in axes:
        over = figure.add_axes(under.get_position().bounds)
        over.set_axis_off()
        over.set_xlim(under.get_xlim())
        over.set_ylim(under.get_ylim())
        found.append(over)
    return figure, found


def _caption_on(figure: Figure, axes: Axes, motion: Motion, title: str) -> Text:
    """An empty text above the axes, beside the signs or, with a title, below them.

    A title of the axes would be laid out anew in every frame.
    """
    wide, tall = figure.get_size_inches()
    place = axes.get_position()
    if title:
        middle = (place.x0 + place.x1) / 2
        return figure.text(
            middle, place.y1 + 0.5 * _CAPTION_IN / tall, "", ha="center", va="center"
        )
    beside = (signs_width(motion.view) / wide + 1) / 2
    return figure.text(beside, place.y1 + SIGNS_HEIGHT / 2 / tall, "", ha="center", va="center")


def _film(
    writer: AbstractMovieWriter,
    figure: Figure,
    panels: list[tuple[Axes, tuple[str, Motion]]],
    speed: float,
    file: Path,
    ahead: Callable[[float], np.ndarray] | None = None,
) -> None:
    """Draw and write every frame."""
    shown = [
        (title, motion, motion.artists_on(axes), _caption_on(figure, axes, motion, title))
        for axes, (title, motion) in panels
    ]
    line = Line2D([], [], color=ORANGE, lw=1.6, marker=".", ms=3, zorder=6)
    panels[0][0].add_line(line)
    faster = "" if speed == 1 else _FASTER.format(speed)
    numbers = tqdm(
        range(len(shown[0][1].times)),
        desc="frames",
        delay=_PATIENCE_S,
        leave=False,
        disable=not sys.stderr.isatty(),
    )
    try:
        writer.setup(figure, str(file), dpi=_DPI)
        try:
            for k in numbers:
                for title, motion, artists, text in shown:
                    artists.show(*motion.frame(k))
                    head = f"{title}\n" if title else ""
                    text.set_text(head + motion.caption(k) + faster)
                if ahead is not None:
                    motion = shown[0][1]
                    line.set_data(*motion.view.project(ahead(float(motion.times[k]))).T)
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
