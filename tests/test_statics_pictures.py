"""dtcasadi.statics.plots: what is drawn, and that it is legible."""

from functools import cache

import numpy as np
import pytest
from legible import assert_legible
from matplotlib.collections import LineCollection, PolyCollection
from moving import DOWN, scene_model
from test_branches import DEAD_LOAD, hinged

import dtcasadi as dtc
from dtcasadi.errors import StaticsError
from dtcasadi.statics import plots
from dtcasadi.style import BLUE, ORANGE, VERMILION, PictureError


@cache
def lifted() -> dtc.Branch:
    """The paper's robot to its limit point and back: flutter, a limit point, divergence."""
    return dtc.branch(scene_model(DOWN), "pressure", 1.0, 20.0, points=40)


@cache
def column() -> tuple[dtc.Branch, ...]:
    """A pitchfork."""
    straight = dtc.branch(hinged(5), DEAD_LOAD, 0.0, 0.3, points=20)
    return straight, straight.switch(side=1, points=20), straight.switch(side=-1, points=20)


@pytest.mark.parametrize("view", ["plane", "3d"])
def test_diagrams_are_legible(view):
    assert_legible(plots.diagram(lifted(), view=view))
    assert_legible(plots.diagram(column(), view=view))


def test_diagram_tells_stable_from_unstable():
    branch = lifted()
    figure = plots.diagram(branch)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "pressure [Pa]"
    assert axes.get_ylabel() == "centre of disc 4, z [m]"
    pieces = [line for line in axes.get_lines() if len(line.get_xdata()) > 1]
    assert [(p.get_color(), p.get_linestyle()) for p in pieces] == [
        (BLUE, "-"),
        (ORANGE, ":"),
        (VERMILION, "--"),
    ]
    drawn = np.concatenate([np.asarray(p.get_xdata(), dtype=float) for p in pieces])
    assert drawn.min() == 1.0 and drawn.max() <= branch.events[1].s
    # Stable up to the onset of flutter, to the last digit.
    assert np.max(np.asarray(pieces[0].get_xdata())) == branch.events[0].s
    marks = [line.get_xdata() for line in axes.get_lines() if len(line.get_xdata()) == 1]
    assert [float(x[0]) for x in marks] == [event.s for event in branch.events]
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["stable", "gives way", "flutters", "onset of flutter", "limit point"]


def test_diagram_shows_poses_in_the_order_of_the_branch():
    figure = plots.diagram(lifted(), quantity=lambda point: point.poses[1][-1, 1], label="y [m]")
    assert figure.axes[0].get_ylabel() == "y [m]"
    small = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert [axes.get_title(loc="left") for axes in small] == list("abcde")
    letters = [text for text in figure.axes[0].texts if text.get_text() in "abcde"]
    assert [text.get_text() for text in letters] == list("abcde")
    assert letters[0].xy[0] == 1.0 and letters[-1].xy[0] == pytest.approx(1.0)
    for axes in small:
        assert axes.get_aspect() == 1 and len(axes.findobj(PolyCollection)) == 1
        assert axes.get_xlim() == small[0].get_xlim() and axes.get_ylim() == small[0].get_ylim()


@pytest.mark.parametrize("chart", ["planar", "cardan"])
def test_modes(chart):
    found = dtc.equilibrium(scene_model(DOWN, chart=chart), 12.0)
    figure = plots.modes(found)
    assert_legible(figure)
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert len(panels) == 6
    assert panels[0].get_title() == f"mode 1: {found.frequencies[0]:.3g} rad/s"
    for axes in panels:  # both ends of the swing are seen whole, and are not the same
        x0, x1 = axes.get_xlim()
        rims = [c for c in axes.findobj(LineCollection) if c.get_zorder() == 5]
        assert len(rims) == 4
        points = [np.concatenate(c.get_segments()) for c in rims[::2]]
        assert all(x0 < p[:, 0].min() and p[:, 0].max() < x1 for p in points)
        assert np.max(np.abs(points[0] - points[1])) > 0.05


def test_a_mode_that_gives_way_is_named_so():
    found = dtc.equilibrium(hinged(2), guess=[0.0, 0.0], theta=np.array([0, 0, -3.0, 0, 0, 0]))
    assert found.kind == "divergence"
    rate = np.sqrt(-found.squared_frequencies[0])
    title = plots.modes(found).axes[0].get_title()
    assert title == f"mode 1: gives way, {rate:.3g} 1/s"


def test_pictures_that_cannot_be_drawn(tmp_path):
    lost = dtc.equilibrium(hinged(1), tau=[1e3])
    with pytest.raises(StaticsError, match="no equilibrium found"):
        plots.modes(lost)
    empty = dtc.branch(hinged(1), {"tau": [1.0]}, 1e6, 2e6)
    with pytest.raises(PictureError, match="branches: expected branches with points"):
        plots.diagram(empty)
    with pytest.raises(PictureError, match="view: expected plane or 3d, got 'top'"):
        plots.diagram(lifted(), view="top")
    with pytest.raises(PictureError, match="expected a name ending in"):
        plots.diagram(lifted(), tmp_path / "a.bmp")
