"""The picture of the contact scenes: two moments of each."""

from pathlib import Path

import numpy as np

import dtcasadi as dtc
from dtcasadi.artists import add_signs, set_stage, signs_width
from dtcasadi.motion import Motion
from dtcasadi.style import WIDTH_IN, finished, new_figure, styled

# Scene, its title, and when to show it [s].
SHOWN = (
    ("wall", "inflating against a wall", (0.5, 2.0)),
    ("cylinder", "curling round a cylinder", (0.3, 3.0)),
    ("fold", "folding onto itself", (1.6, 2.75)),
    ("floor", "dragging a payload", (3.6, 8.0)),
)
PANEL_IN, TITLE_IN, SIGNS_IN = 2.0, 0.45, 0.62


@styled
def draw(path: Path) -> None:
    """A column for each scene, with its own scale."""
    height = 2 * (PANEL_IN + TITLE_IN) + SIGNS_IN
    figure = new_figure(WIDTH_IN, height)
    width = WIDTH_IN / len(SHOWN)
    for column, (name, title, times) in enumerate(SHOWN):
        run = dtc.simulate(dtc.load_scene(f"contact/{name}"))
        motion = Motion.of(run, np.array(times), "plane")
        for row in range(len(times)):
            top = height - row * (PANEL_IN + TITLE_IN) - TITLE_IN
            place = np.array([column * width + 0.05, top - PANEL_IN, width - 0.1, PANEL_IN])
            axes = figure.add_axes(tuple(place / np.tile([WIDTH_IN, height], 2)))
            set_stage(axes, motion.view, motion.box)
            axes.set_axis_off()
            motion.artists_on(axes).show(*motion.frame(row))
            caption = motion.caption(row)
            text = f"{title}\n{caption}" if row == 0 else caption
            middle = (column + 0.5) / len(SHOWN)
            figure.text(middle, (top + 0.06) / height, text, ha="center", va="bottom")
        axes.apply_aspect()
        scale = axes.get_window_extent().width / figure.dpi / motion.box.size[0]
        corner = column * width + (width - signs_width(motion.view)) / 2, 0.03
        add_signs(figure, run.model.robot, motion.view, corner, scale)
    finished(figure, path)
