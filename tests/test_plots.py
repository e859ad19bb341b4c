"""dtcasadi.plots: what is drawn, that it is legible, and how it is written."""

import dataclasses
import os
from pathlib import Path

import drawn_runs
import matplotlib as mpl
import numpy as np
import pytest
from legible import assert_legible
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.figure import Figure

import dtcasadi as dtc
from dtcasadi import plots
from dtcasadi.style import PictureError

PICTURES = (plots.filmstrip, plots.coordinates, plots.energy_and_pressure)
SIGNS = {b"\x89PNG": ".png", b"<?xm": ".svg", b"%PDF": ".pdf"}


@pytest.fixture(scope="module", params=drawn_runs.ALL, ids=lambda make: make.__name__)
def run(request) -> dtc.Run:
    return request.param()


@pytest.fixture(scope="module")
def seed() -> dtc.Run:
    return drawn_runs.seed()


@pytest.mark.parametrize("picture", PICTURES, ids=lambda f: f.__name__)
def test_pictures_are_legible(run, picture):
    figure = picture(run)
    assert figure.get_size_inches()[0] == 9  # what fonts of 8 and 9 points are legible at
    assert_legible(figure)


@pytest.mark.parametrize("view", ["plane", "3d"])
def test_either_view_is_legible(run, view):
    assert_legible(plots.filmstrip(run, view=view))


def panels(figure: Figure) -> list[Axes]:
    """The frames of a filmstrip."""
    return [axes for axes in figure.axes if axes.get_label() != "signs"]


def test_filmstrip_shows_every_part_in_every_frame(run):
    robot = run.model.robot
    figure = plots.filmstrip(run, times=[0.0, 1.0, 2.2])
    assert len(panels(figure)) == 3
    for axes in panels(figure):
        (discs,) = axes.findobj(PolyCollection)
        assert len(discs.get_paths()) == robot.n_discs
        threads, springs = _threads_and_springs(axes)
        assert len(threads.get_segments()) == robot.n_discs - 1
        assert len(springs.get_segments()) == len(robot.springs)
        (chambers,) = axes.findobj(PathCollection)
        spans = sum(chamber.discs[1] - chamber.discs[0] for chamber in robot.chambers)
        assert len(chambers.get_paths()) == spans


def _threads_and_springs(axes) -> tuple[LineCollection, LineCollection]:
    springs, threads = sorted(axes.findobj(LineCollection), key=lambda c: c.get_zorder())
    return threads, springs


def test_filmstrip_has_one_scale_and_cuts_nothing(run):
    figure = plots.filmstrip(run)
    first = figure.axes[0]
    assert len(panels(figure)) == 8
    for axes in panels(figure):
        assert axes.get_aspect() == 1
        assert axes.get_xlim() == first.get_xlim() and axes.get_ylim() == first.get_ylim()
        box = axes.get_window_extent()
        (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
        # The panel has the limits' shape, so that equal scales leave no part of it unused.
        assert box.width / box.height == pytest.approx((x1 - x0) / (y1 - y0), rel=1e-6)
        for collection in axes.findobj(PolyCollection) + axes.findobj(LineCollection):
            for path in collection.get_paths():
                x, y = path.vertices.T
                assert x0 < x.min() and x.max() < x1 and y0 < y.min() and y.max() < y1


def test_filmstrip_names_time_pressure_gravity_and_units(seed):
    figure = plots.filmstrip(seed, times=[0.5, 1.25])
    assert [axes.get_title() for axes in panels(figure)] == [
        "t = 0.5 s, 12 Pa",
        "t = 1.25 s, 12 Pa",
    ]
    assert figure.axes[0].get_xlabel() == "z [m]"
    assert figure.axes[0].get_ylabel() == "height [m]"
    signs = figure.axes[-1]
    assert [text.get_text() for text in signs.texts] == ["", "g"]
    arrow = signs.texts[0]
    assert arrow.xy[1] < arrow.xyann[1] and arrow.xy[0] == pytest.approx(arrow.xyann[0])
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["root", "disc", "thread", "spring", "chamber", "path of disc 4"]


def test_large_pressures_are_in_kilopascal():
    run = drawn_runs.three_chambers()
    title = plots.filmstrip(run, times=[1.5]).axes[0].get_title()
    assert title == "t = 1.5 s\n19.9 | 9.9 | 4.0 kPa"
    assert plots.energy_and_pressure(run).axes[1].get_ylabel() == "pressure [kPa]"


def test_no_gravity_no_arrow():
    figure = plots.filmstrip(drawn_runs.weightless_column())
    assert not figure.axes[-1].texts


def test_gravity_across_the_page_is_told_in_words():
    run = drawn_runs.weightless_column()
    robot = dataclasses.replace(run.model.robot, gravity=9.81)
    model = dtc.build(robot)
    figure = plots.filmstrip(drawn_runs.swinging(model), view="plane")
    # With z to the right and y up the page, x points away from the reader, and gravity along -x.
    assert [text.get_text() for text in figure.axes[-1].texts] == ["g out of\nthe page"]


def test_the_length_shown_in_an_oblique_view_is_true(seed):
    figure = plots.filmstrip(seed, view="3d")
    bar = figure.axes[-1].get_lines()[-1]
    length = float(figure.axes[-1].texts[-1].get_text().removesuffix(" m"))
    on_page = np.ptp(figure.axes[-1].transData.transform(np.column_stack(bar.get_data()))[:, 0])
    first = figure.axes[0]
    assert on_page == pytest.approx(length * first.bbox.width / np.ptp(first.get_xlim()))


def test_coordinates_run_on_where_charts_are_recentred():
    """About the robot's own A and B, no line jumps: a step of 25 ms moves less than 0.03 rad."""
    run = drawn_runs.recentred()
    for axes in plots.coordinates(run).axes:
        for line in axes.get_lines()[:3]:
            values = np.asarray(line.get_ydata())
            assert len(values) == len(run.t) and np.max(np.abs(np.diff(values))) < 0.03
    assert np.max(np.abs(np.diff(run.q))) > 0.1


def test_coordinates_shows_what_moves_and_names_the_rest():
    model = dtc.build(drawn_runs.presets.seed_four_disc(), chart="paper")
    t = np.linspace(0, 1, 11)
    q = np.zeros((15, 11))
    q[1::5], q[3::5] = t, -t
    figure = plots.coordinates(drawn_runs.made_up(model, t, q, 0 * q))
    assert [axes.get_ylabel() for axes in figure.axes] == ["β [rad]", "ψ [rad]"]
    assert all(axes.get_xlabel() == "time [s]" for axes in figure.axes)
    assert figure.axes[0].get_title(loc="left") == "constant: α, γ, φ"
    assert figure.axes[1].get_lines()[2].get_ydata() == pytest.approx(-t)
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["segment 1", "segment 2", "segment 3"]


def test_coordinates_of_a_chain_at_rest():
    disc = dtc.Disc.hoop(1.0, 1.0)
    robot = dtc.Robot([disc] * 3, [dtc.Thread(1.0)] * 2)
    t, still = np.linspace(0, 1, 5), np.zeros((2, 5))
    resting = drawn_runs.made_up(dtc.build(robot, chart="hinge"), t, still, still)
    assert len(plots.coordinates(resting).axes[0].get_lines()) >= 2


def test_energy_and_pressure_draws_the_runs_numbers(seed):
    energy, pressure, residual, condition = plots.energy_and_pressure(seed).axes
    drawn = {line.get_label(): line.get_ydata() for line in energy.get_lines()}
    assert drawn["kinetic"] == pytest.approx(seed.energy["kinetic"])
    assert drawn["potential − start"] == pytest.approx(-5 * seed.energy["t"])
    assert pressure.get_lines()[0].get_ydata() == pytest.approx(np.full(121, 12.0))
    assert residual.get_lines()[0].get_ydata() == pytest.approx(seed.energy["residual"])
    assert condition.get_lines()[0].get_ydata() == pytest.approx(seed.condition)
    labels = [axes.get_ylabel() for axes in (energy, pressure, residual, condition)]
    assert [label[label.index("[") :] for label in labels] == ["[J]", "[Pa]", "[J]", "[-]"]


def test_commands_are_drawn_beside_lagging_pressures():
    labels = [
        line.get_label()
        for line in plots.energy_and_pressure(drawn_runs.three_chambers()).axes[1].get_lines()
    ]
    assert labels == [f"{word} {k}" for k in (1, 2, 3) for word in ("chamber", "command")]


def test_an_unbounded_condition_number_leaves_a_gap(seed):
    run = drawn_runs.swinging(seed.model, u=np.zeros((1, 121)), condition=np.full(121, np.inf))
    assert_legible(plots.energy_and_pressure(run))


def test_jumps_are_drawn_as_jumps_and_ramps_as_ramps():
    assert plots._steps(np.array([0, 0, 1, 1, 2, 2])) == "steps-post"
    assert plots._steps(np.array([0, 1, 2, 3, 3, 3])) == "default"


def test_a_run_of_one_instant_is_drawn(seed):
    model = seed.model
    t, q = np.zeros(1), np.full((6, 1), 0.1)
    run = drawn_runs.made_up(model, t, q, q)
    for picture in PICTURES:
        assert_legible(picture(run))


@pytest.mark.parametrize(("sign", "suffix"), SIGNS.items())
def test_the_suffix_decides_the_format(seed, tmp_path, sign, suffix):
    path = tmp_path / f"picture{suffix.upper()}"
    plots.coordinates(seed, path)
    assert path.read_bytes().startswith(sign)
    first = path.read_bytes()
    plots.coordinates(seed, path)
    assert path.read_bytes() == first  # the same run, the same file
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("name", ["picture.jpg", "picture"])
def test_other_suffixes_are_refused(seed, tmp_path, name):
    with pytest.raises(PictureError, match=r"expected a name ending in \.png, \.svg or \.pdf$"):
        plots.coordinates(seed, tmp_path / name)
    assert not os.listdir(tmp_path)


def test_a_missing_folder_is_an_os_error(seed, tmp_path):
    with pytest.raises(FileNotFoundError):
        plots.coordinates(seed, tmp_path / "missing" / "picture.png")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"view": "side"}, r"^view: expected one of plane, 3d, got 'side'$"),
        ({"times": []}, r"^times: expected times from 0 to 3 s, got \[\]$"),
        ({"times": [1.0, 3.5]}, r"^times: expected times from 0 to 3 s, got \[1.0, 3.5\]$"),
        ({"times": [float("nan")]}, r"^times: expected times from 0 to 3 s, got \[nan\]$"),
    ],
)
def test_bad_arguments_are_named(seed, arguments, message):
    with pytest.raises(PictureError, match=message):
        plots.filmstrip(seed, **arguments)


def test_the_users_settings_neither_change_nor_matter(seed):
    with mpl.rc_context({"font.size": 30.0, "axes.grid": True, "lines.linewidth": 9.0}):
        before = dict(mpl.rcParams)
        figure = plots.coordinates(seed)
        assert dict(mpl.rcParams) == before
    assert figure.axes[0].xaxis.label.get_fontsize() == 9


def test_pyplot_is_not_used():
    package = Path(plots.__file__).parent
    assert not [file.name for file in package.rglob("*.py") if "pyplot" in _imports(file)]


def _imports(file: Path) -> str:
    lines = file.read_text(encoding="utf-8").splitlines()
    return "\n".join(line for line in lines if line.lstrip().startswith(("import ", "from ")))
