"""The picture of the presets: each where it rests without and with pressure."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

import dtcasadi as dtc
from dtcasadi.artists import Box, RobotArtists, add_signs, set_stage, signs_width
from dtcasadi.drawing import shapes_of, view_of
from dtcasadi.statics.search import virtual_search
from dtcasadi.style import WIDTH_IN, finished, new_figure, styled


class Shown(NamedTuple):
    """A scene, and pressures with what to call them."""

    scene: str
    pressures: tuple[tuple[str, list[float]], ...]


SHOWN = (
    Shown("tentacle", (("no pressure", [0.0]), ("20 kPa", [20e3]))),
    Shown(
        "grub",
        (
            ("100 kPa in all bellows", [100e3] * 4),
            ("150 and 50 kPa in one pair", [150e3, 50e3, 100e3, 100e3]),
        ),
    ),
    Shown("arm", (("no pressure", [0.0] * 4), ("60, 50, 60, 50 kPa", [60e3, 50e3, 60e3, 50e3]))),
)
PANEL_IN, TITLE_IN, SIGNS_IN = 2.5, 0.45, 0.62


@styled
def draw(path: Path) -> None:
    """A column for each preset, at rest above and inflated below, each with its own scale."""
    height = 2 * (PANEL_IN + TITLE_IN) + SIGNS_IN
    figure = new_figure(WIDTH_IN, height)
    width = WIDTH_IN / len(SHOWN)
    for column, shown in enumerate(SHOWN):
        scene = dtc.load_scene(shown.scene)
        model = scene.build(actuator="direct")
        virtual_search(model)
        found = [dtc.equilibrium(model, pressure) for _, pressure in shown.pressures]
        R, r = (np.array(part) for part in zip(*(each.poses for each in found), strict=True))
        view = view_of(scene.robot, R, r, "3d")
        shapes = [shapes_of(scene.robot, *pose, view) for pose in zip(R, r, strict=True)]
        box = Box.around(np.concatenate([shape.points for shape in shapes]))
        full = max(max(pressure) for _, pressure in shown.pressures)
        for row, (label, pressure) in enumerate(shown.pressures):
            top = height - row * (PANEL_IN + TITLE_IN) - TITLE_IN
            place = np.array([column * width, top - PANEL_IN, width, PANEL_IN])
            axes = figure.add_axes(tuple(place / np.tile([WIDTH_IN, height], 2)))
            set_stage(axes, view, box)
            artists = RobotArtists(axes, scene.robot, full)
            artists.show(shapes[row], np.array(pressure), np.zeros((0, 2)))
            title = f"{shown.scene}: {label}" if row == 0 else label
            middle = (column + 0.5) / len(SHOWN)
            figure.text(middle, (top + 0.12) / height, title, ha="center")
        scale = min(width / box.size[0], PANEL_IN / box.size[1])
        left = column * width + (width - signs_width(view)) / 2
        add_signs(figure, scene.robot, view, (left, 0.03), scale)
    finished(figure, path)


if __name__ == "__main__":
    draw(Path("presets.png"))
