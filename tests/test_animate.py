"""dtcasadi.animate: frames, formats, and what is left behind when something fails."""

import os
import stat

import drawn_runs
import numpy as np
import pytest
from legible import assert_legible
from PIL import Image

import dtcasadi as dtc
from dtcasadi import animate as module
from dtcasadi.animate import animate, frame_times
from dtcasadi.motion import Motion
from dtcasadi.style import PictureError

# Stands in for ffmpeg: takes the frames and writes what its last argument names.
FFMPEG = """#!/bin/sh
for last; do :; done
cat > "$last"
"""
BROKEN = """#!/bin/sh
cat > /dev/null
echo "first line" >&2
echo "Unknown encoder 'h264'" >&2
exit 1
"""


@pytest.fixture(scope="module")
def run() -> dtc.Run:
    return drawn_runs.seed()


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """Puts a script in ffmpeg's place."""

    def install(text: str) -> None:
        folder = tmp_path / "bin"
        folder.mkdir()
        file = folder / "ffmpeg"
        file.write_text(text)
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")

    return install


def test_gif_moves_at_the_rate_asked_for(run, tmp_path):
    path = animate(run, tmp_path / "film.gif", fps=4)
    with Image.open(path) as film:
        assert film.n_frames == 13  # three seconds, both ends shown
        assert film.info["duration"] == 250 and film.info["loop"] == 0
        frames = []
        for k in (0, 6):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB"), dtype=float))
    assert frames[0].shape == frames[1].shape == (*frames[0].shape[:2], 3)
    changed = np.abs(frames[0] - frames[1]).max(axis=2) > 60
    assert 0.01 < changed.mean() < 0.5  # the robot moves, the rest stays
    assert os.listdir(tmp_path) == ["film.gif"]


@pytest.mark.parametrize("make", drawn_runs.ALL, ids=lambda make: make.__name__)
def test_frames_are_legible(make):
    run = make()
    motion = Motion.of(run, np.array([0.0, 1.5]))
    figure, _ = module._stage({"": motion})
    title = module._caption_on(figure, figure.axes[0], motion, "")
    title.set_text(motion.caption(1) + module._FASTER.format(12.5))
    assert_legible(figure)


def test_several_runs_side_by_side_are_legible_and_alike_in_scale(run, tmp_path):
    bent = drawn_runs.ALL[-1]()
    for other in (run, bent):
        panels = {"truth": other, "an estimate with a long name": other}
        motions = module._framed({k: Motion.of(v, np.array([0.0, 1.5])) for k, v in panels.items()})
        figure, drawn = module._stage(motions)
        for axes, (title, motion) in zip(drawn, motions.items(), strict=True):
            text = module._caption_on(figure, axes, motion, title)
            text.set_text(f"{title}\n{motion.caption(1)}")
        assert_legible(figure)
        assert drawn[0].get_xlim() == drawn[1].get_xlim()
    path = animate({"a": run, "b": run}, tmp_path / "film.gif", fps=2)
    with Image.open(path) as film:
        film.seek(3)
        frame = np.asarray(film.convert("RGB"), dtype=float)
    # The same robot in both halves, but for the signs above the first.
    half = frame.shape[1] // 2
    left, right = frame[200:, :half], frame[200:, half : 2 * half]
    assert np.mean(np.abs(left - right) > 60) < 0.02 < np.mean(left < 200)


def test_long_runs_are_shown_faster_not_longer(run):
    times, speed = frame_times(run, 25, 1.0, 500)
    assert speed == 1.0 and len(times) == 76
    assert np.diff(times) == pytest.approx(np.full(75, 0.04)) and times[-1] == 3.0
    times, speed = frame_times(run, 25, 1.0, 31)
    assert len(times) == 31 and speed == pytest.approx(2.5) and times[-1] == 3.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fps": 0}, "^fps: expected a positive number, got 0$"),
        ({"speed": float("inf")}, "^speed: expected a positive number, got inf$"),
        ({"max_frames": 1}, "^max_frames: expected at least 2, got 1$"),
        ({"view": "top"}, "^view: expected one of plane, 3d, got 'top'$"),
    ],
)
def test_bad_arguments_are_named(run, tmp_path, arguments, message):
    with pytest.raises(PictureError, match=message):
        animate(run, tmp_path / "film.gif", **arguments)
    assert not os.listdir(tmp_path)


def test_other_suffixes_are_refused(run, tmp_path):
    with pytest.raises(PictureError, match=r"film\.avi: expected a name ending in \.gif or \.mp4$"):
        animate(run, tmp_path / "film.avi")


def test_mp4_without_ffmpeg_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PictureError, match=r"^\S+film\.mp4: \.mp4 needs ffmpeg on PATH; install"):
        animate(run, tmp_path / "film.mp4")


def test_mp4_gets_every_frame(run, tmp_path, ffmpeg):
    ffmpeg(FFMPEG)
    path = animate(run, tmp_path / "film.mp4", fps=2)
    # Seven raw frames of four bytes a pixel; h264 wants even sides.
    assert path.stat().st_size % (7 * 4) == 0 and path.stat().st_size > 7 * 4 * 10**5


def test_a_failing_ffmpeg_is_one_line_and_leaves_nothing(run, tmp_path, ffmpeg):
    ffmpeg(BROKEN)
    (tmp_path / "film.mp4").write_text("older")
    with pytest.raises(PictureError, match="^ffmpeg failed: Unknown encoder 'h264'$"):
        animate(run, tmp_path / "film.mp4", fps=2)
    assert sorted(os.listdir(tmp_path)) == ["bin", "film.mp4"]
    assert (tmp_path / "film.mp4").read_text() == "older"


def test_an_ffmpeg_that_ends_early_is_one_line(run, tmp_path, ffmpeg):
    ffmpeg("#!/bin/sh\necho 'no space left' >&2\nexit 1\n")
    with pytest.raises(PictureError, match="^ffmpeg failed: no space left$"):
        animate(run, tmp_path / "film.mp4", fps=2)


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_an_interrupt_leaves_nothing(run, tmp_path, ffmpeg, monkeypatch, suffix):
    ffmpeg(FFMPEG)

    def interrupted(self: Motion, k: int) -> str:
        if k == 2:
            raise KeyboardInterrupt
        return str(k)

    monkeypatch.setattr(Motion, "caption", interrupted)
    with pytest.raises(KeyboardInterrupt):
        animate(run, tmp_path / f"film{suffix}", fps=2)
    assert os.listdir(tmp_path) == ["bin"]


def test_a_missing_folder_is_an_os_error(run, tmp_path):
    with pytest.raises(FileNotFoundError):
        animate(run, tmp_path / "missing" / "film.gif")
