"""Tests of dtcasadi.scene and the modules that read its files."""

import dataclasses
import math
import os
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from scene_texts import FULL, SMALL, edited

import dtcasadi.scene
from dtcasadi.actuators import Direct, Regulator
from dtcasadi.charts import CHARTS
from dtcasadi.errors import SceneError
from dtcasadi.model import build
from dtcasadi.presets import rim, seed_four_disc
from dtcasadi.profile import Profile
from dtcasadi.robot import Robot
from dtcasadi.scene import Scene, load_scene, parse_scene, scene_names
from dtcasadi.scene_file import MAX_BYTES
from dtcasadi.scene_tables import REQUIRED, Table
from dtcasadi.scene_units import PURE

SEEDS = {
    "seed_four_disc": ((0, -1, 0), 12.0),
    "seed_four_disc_up": ((0, 1, 0), 12.0),
    "seed_four_disc_force": ((0, 1, 0), 3.82),
}


def parse(text: str) -> Scene:
    return parse_scene(text.encode(), "f.toml", "scene")


def errors_of(text: str) -> list[str]:
    """The error lines of a scene, without the file's name."""
    with pytest.raises(SceneError) as caught:
        parse(text)
    assert all(line.startswith("f.toml: ") for line in caught.value.errors)
    return [line.removeprefix("f.toml: ") for line in caught.value.errors]


def assert_same_robot(one: Robot, other: Robot) -> None:
    for parts in ("discs", "threads", "springs", "chambers", "damping"):
        mine, others = getattr(one, parts), getattr(other, parts)
        assert len(mine) == len(others)
        for a, b in zip(mine, others, strict=True):
            for field in dataclasses.fields(a):
                assert np.array_equal(getattr(a, field.name), getattr(b, field.name)), field.name
    assert np.array_equal(one.up, other.up) and one.gravity == other.gravity


# ---- what comes with the package -----------------------------------------------------------------


def test_the_shipped_scenes_are_listed_and_load():
    assert set(scene_names()) >= set(SEEDS)
    assert list(scene_names()) == sorted(scene_names())
    for name in scene_names():
        assert load_scene(name).name == name


@pytest.mark.parametrize("name", SEEDS)
def test_the_seed_scenes_are_the_papers_section_v(name):
    up, pressure = SEEDS[name]
    scene = load_scene(name)
    assert_same_robot(scene.robot, seed_four_disc(up))
    assert scene.options == {"chart": "planar"}
    assert scene.initial_chart == ("planar",) * 3
    assert scene.q0.tolist() == [0.1, 0, 0.01, 0, 0.01, 0]
    assert not scene.qd0.any()
    assert scene.pressure(0.0) == scene.pressure(99.0) == [pressure]
    assert scene.t_end == 10.0
    assert all((d.c_a, d.c_b, d.c_w, d.c_r) == (100, 100, 100, 0) for d in scene.robot.damping)


# ---- the format ----------------------------------------------------------------------------------


def test_a_small_scene_has_the_defaults():
    scene = parse(SMALL)
    assert (scene.name, scene.title) == ("scene", "scene")
    assert (scene.rtol, scene.atol, scene.method, scene.step_s) == (1e-6, 1e-8, "auto", None)
    assert scene.options == {"chart": "cardan"}
    assert scene.q0.shape == scene.qd0.shape == (10,) and not scene.q0.any()
    assert scene.pressure.n_u == 0 and scene.initial_pressure is None
    assert scene.robot.up.tolist() == [0, 1, 0] and scene.robot.gravity == 9.81
    assert scene.robot.springs == scene.robot.chambers == ()


def test_every_key_arrives_in_si_units():
    scene = parse(FULL)
    robot = scene.robot
    assert (scene.name, scene.title) == ("full_scene", "A scene with every key")
    assert robot.n_discs == 4 and robot.gravity == 9.80665
    np.testing.assert_allclose(robot.up, np.array([0, -1, 0.5]) / math.hypot(1, 0.5))
    assert [d.mass for d in robot.discs] == [0.0125, 0.0125, 0.02, 0.015]
    assert robot.discs[0].centroid.tolist() == [0, 0.03, 0]
    assert robot.discs[2].centroid == pytest.approx([0, 0.02, 0])
    assert robot.discs[2].area == pytest.approx(0.0016)
    assert robot.discs[3].inertia.tolist() == [[4e-6, 1e-7, 0], [1e-7, 4e-6, 0], [0, 0, 7e-6]]
    assert robot.discs[3].centre_of_mass.tolist() == [0.001, 0.029, 0.002]
    assert robot.discs[3].area == 0.0025 and robot.discs[3].centroid.tolist() == [0, 0.028, 0]
    assert robot.discs[3].outline.shape == (3, 3)
    assert [t.length for t in robot.threads] == [0.025, 0.025, 0.02]
    assert robot.threads[2].exit_point.tolist() == [0, 0.001, 0]
    assert [d.c_a for d in robot.damping] == [1e-3, 1e-3, 0]
    assert [d.c_b for d in robot.damping] == [1e-3, 1e-3, 0]
    assert [d.c_r for d in robot.damping] == [0, 0, 2e-3]
    whole, part = robot.chambers
    assert whole.discs == (1, 4) and part.discs == (2, 3)
    assert part.areas.tolist() == [1e-3, 1.1e-3]
    assert part.centroids.tolist() == [[0, 0.01, 0], [0, 0.012, 0]]
    assert scene.options == {
        "chart": ("cardan", "paper", "cardan"),
        "velocity_terms": "full",
        "damping": "physical",
        "inflation": "last_disc",
        "actuator": Regulator(0.1, -5e3, 40e3, 200e3),
    }
    q0 = np.array([[math.radians(angle), 0.1] for angle in (5, -3, 2)]).ravel()
    np.testing.assert_allclose(scene.q0, q0, rtol=1e-15)
    np.testing.assert_allclose(np.degrees(scene.qd0), [10, 0, 0, 0, 0, -10], rtol=1e-15)
    assert scene.initial_chart == ("planar",) * 3
    assert scene.initial_pressure.tolist() == [10e3, 0]
    assert scene.pressure.kind == "linear" and scene.pressure.times.tolist() == [0, 0.5, 1.5]
    assert scene.pressure(0.5).tolist() == [20e3, 5e3]
    assert (scene.t_end, scene.rtol, scene.atol) == (4, 1e-7, 1e-9)
    assert (scene.method, scene.step_s) == ("rk4", 5e-4)


def test_rest_rotations_are_about_x_then_y_then_z():
    angles = np.array([0.3, -0.4, 0.5])
    text = edited(SMALL, "length = 1", f"length = 1\nbend = {angles.tolist()}")
    (c1, c2, c3), (s1, s2, s3) = np.cos(angles), np.sin(angles)
    about_x = [[1, 0, 0], [0, c1, -s1], [0, s1, c1]]
    about_y = [[c2, 0, s2], [0, 1, 0], [-s2, 0, c2]]
    about_z = [[c3, -s3, 0], [s3, c3, 0], [0, 0, 1]]
    expected = np.array(about_x) @ about_y @ about_z
    thread = parse(text).robot.threads[0]
    np.testing.assert_allclose(thread.bend, expected, atol=1e-16)
    assert np.array_equal(thread.twist, np.eye(3))


def test_springs_lie_on_the_rims_they_are_given_on():
    springs = parse(FULL).robot.springs
    assert [s.discs for s in springs] == (
        [(1, 2)] * 3 + [(2, 3)] * 3 + [(3, 4)] * 3 + [(1, 2)] * 2 + [(3, 4)]
    )
    for spring, degrees in zip(springs[:9], [90, 180, 270] * 3, strict=True):
        assert np.array_equal(spring.start, rim(0.028, math.radians(degrees)))
        assert np.array_equal(spring.end, spring.start)
        assert (spring.stiffness, spring.damping) == (200.0, 0.05)
    up, down = springs[9:11]  # a pair of diagonals, on the discs' own rims
    assert np.array_equal(up.start, [0, 0, 0]) and np.array_equal(up.end, [0.03, 0.03, 0])
    assert np.array_equal(down.start, [0.03, 0.03, 0]) and np.array_equal(down.end, [0, 0, 0])
    assert up.rest_length == pytest.approx(math.sqrt(0.025**2 + 2 * 0.03**2))
    free = springs[11]
    assert free.start.tolist() == [0, 0.04, 0] and free.end.tolist() == [0, 0.05, 0]
    assert (free.rest_length, free.damping) == (0.022, 1.0)


def test_a_spring_between_unlike_rims_follows_each():
    text = edited(SMALL, "count = 3\n", "")
    text = edited(text, "[robot.threads]\ncount = 2", "DISC2\n[robot.threads]\ncount = 1")
    text = edited(text, "DISC2", '[[robot.discs]]\nshape = "hoop"\nmass = 1\nradius = 3')
    text += "[[robot.springs]]\ndiscs = [1, 2]\nat_deg = [90]\nstiffness = 1"
    (spring,) = parse(text).robot.springs
    assert spring.start.tolist() == [1, 1, 0] and spring.end.tolist() == [3, 3, 0]


PRESSED = (
    SMALL + '[[robot.chambers]]\ndiscs = "all"\n[[robot.chambers]]\ndiscs = [1, 2]\n[pressure]\n'
)


@pytest.mark.parametrize(
    ("text", "at_half", "at_two"),
    [
        ("value = 3", [3, 3], [3, 3]),
        ("value_kpa = [3, 4]", [3000, 4000], [3000, 4000]),
        ("times = [0, 1]\nvalues = [3, 5]", [3, 3], [5, 5]),
        ("times = [0, 1]\nvalues = [3, 5]\nkind = 'linear'", [4, 4], [5, 5]),
        ("times_ms = [0, 1000]\nvalues_bar = [[0, 2], [1, 4]]", [0, 2e5], [1e5, 4e5]),
    ],
)
def test_a_pressure_is_one_number_for_all_or_one_for_each_chamber(text, at_half, at_two):
    profile = parse(PRESSED + text).pressure
    assert profile(0.5).tolist() == at_half and profile(2.0).tolist() == at_two


@pytest.mark.parametrize(
    ("initial", "q0"),
    [
        ("q = [1, 2, 3, 4]", [1, 2, 3, 4]),
        ("q_deg = [180, 0, 0, 0]", [math.pi, 0, 0, 0]),
        ("beta = [1, 2]", [1, 0, 2, 0]),
        ("beta = 1\npsi_deg = [0, 180]", [1, 0, 1, math.pi]),
    ],
)
def test_a_pose_is_a_list_or_named_coordinates(initial, q0):
    scene = parse(SMALL + f'[model]\nchart = "planar"\n[initial]\n{initial}')
    assert scene.q0.tolist() == q0


def test_coordinates_that_only_some_charts_have_are_zero_when_others_are_named():
    scene = parse(SMALL + '[model]\nchart = ["paper", "hinge"]\n[initial]\nbeta = [1, 2]')
    assert scene.q0.tolist() == [0, 1, 0, 0, 0, 2]


@pytest.mark.parametrize("kind", ["direct", "regulator"])
def test_an_actuator_may_be_named_or_a_table(kind):
    assert parse(SMALL + f'[model]\nactuator = "{kind}"').options["actuator"] == kind
    options = parse(SMALL + f'[model.actuator]\nkind = "{kind}"').options
    assert options["actuator"] == ("direct" if kind == "direct" else Regulator())


def test_the_format_reference_names_every_key_and_suffix(monkeypatch):
    taken = set()
    take = Table.take

    def noting(table, key, expected, unit=PURE, default=REQUIRED):
        taken.update([key], (f"_{suffix}" for suffix in unit.suffixes))
        return take(table, key, expected, unit, default)

    monkeypatch.setattr(Table, "take", noting)
    parse(FULL)
    parse(PRESSED + "value = 3")
    words = set(re.findall(r"\w+", dtcasadi.scene.__doc__))
    words |= {word.removesuffix("_deg") for word in words}
    coordinates = {name for chart in CHARTS.values() for name in chart.coordinate_names}
    assert len(taken) > 60
    assert not taken - words - coordinates


# ---- errors --------------------------------------------------------------------------------------

DISC = 'shape = "hoop"\nmass = 2\nradius = 1'
TURNS = "[[robot.springs]]\ndiscs = [1, 2]\nstiffness = 1\n"


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("schema = 1\n", "", "schema: expected 1, got nothing"),
        ("schema = 1", "schema = 1.0", "schema: expected 1, got 1.0"),
        ("schema = 1", "schema = 2\nrobots = 3", "schema: expected 1, got 2"),
        ("mass = 2", "mass = -2", "robot.discs[1].mass: expected a finite positive number, got -2"),
        (
            "mass = 2",
            "mass_g = 0",
            "robot.discs[1].mass_g: expected a finite positive number, got 0",
        ),
        (
            "mass = 2",
            "mass = nan",
            "robot.discs[1].mass: expected a finite positive number, got nan",
        ),
        (
            "mass = 2",
            "mass = true",
            "robot.discs[1].mass: expected a finite positive number, got True",
        ),
        (
            "mass = 2",
            'mass = "2"',
            "robot.discs[1].mass: expected a finite positive number, got '2'",
        ),
        (
            "mass = 2\n",
            "",
            "robot.discs[1].mass: expected a finite positive number [kg], got nothing",
        ),
        (
            "mass = 2",
            "mass = 1e400",
            "robot.discs[1].mass: expected a finite positive number, got inf",
        ),
        (
            "mass = 2",
            "mass = 1979-05-27",
            "robot.discs[1].mass: expected a finite positive number, "
            "got datetime.date(1979, 5, 27)",
        ),
        (
            "mass = 2",
            "mass = 0x1" + 5000 * "0",
            "robot.discs[1].mass: expected a finite positive number, "
            "got a value too large to show (int)",
        ),
        (
            "mass = 2",
            "mass = 2\nmass_g = 3",
            "robot.discs[1].mass: expected only one of mass, mass_g, got mass and mass_g",
        ),
        (
            "mass = 2",
            "mass = 2\nraduis = 3",
            "robot.discs[1].raduis: expected one of count, shape, mass, radius "
            "(did you mean radius?), got an unknown key",
        ),
        (
            "mass = 2",
            'mass = 2\n"\\u001b[2J" = 3',
            "robot.discs[1].'\\x1b[2J': expected one of count, shape, mass, radius, "
            "got an unknown key",
        ),
        (
            '"hoop"',
            '"hop"',
            "robot.discs[1].shape: expected hoop, solid, polygon or custom, got 'hop'",
        ),
        (
            "count = 3",
            "count = 0",
            "robot.discs[1].count: expected an integer from 1 to 4096, got 0",
        ),
        (
            "count = 3",
            "count = 3.0",
            "robot.discs[1].count: expected an integer from 1 to 4096, got 3.0",
        ),
        ("count = 3", "count = 4", "robot.threads: expected 3 for 4 discs, got 2"),
        (
            "count = 3",
            "count = 1",
            "robot.discs: expected at least 2 discs, the root included, got 1",
        ),
        (
            DISC,
            DISC + "\n[[robot.discs]]\ncount = 4094\n" + DISC,
            "robot.discs[4].count: expected at most 4096 discs in all, got 4097",
        ),
        (
            DISC,
            'shape = "polygon"\nmass = 1\nvertices_mm = [[0, 0], [1, 1], [2, 2]]',
            "robot.discs[1].vertices_mm: expected corners that enclose an area, "
            "got [[0.0, 0.0], [0.001, 0.001], [0.002, 0.002]]",
        ),
        (
            DISC,
            'shape = "custom"\nmass = 1\ninertia = [[1, 0, 0], [0, 1, 0], [0, 0, 5]]',
            "robot.discs[1].inertia: expected positive principal moments, each at most the sum of "
            "the other two, got [1.0, 1.0, 5.0]",
        ),
        (
            "[robot]",
            "[robot]\nup = [0, 0, 0]",
            "robot.up: expected a direction (3 numbers, not all zero), got [0.0, 0.0, 0.0]",
        ),
        (
            "[robot]",
            "[robot]\nup = 3",
            "robot.up: expected finite numbers of shape (3), got shape ()",
        ),
        (
            "[robot]",
            "[robot]\ngravity = -1",
            "robot.gravity: expected a finite non-negative number, got -1",
        ),
        (
            "[robot]",
            "[robot]\nsprings = 3",
            "robot.springs: expected [[robot.springs]] tables, got 3",
        ),
        ("[robot]", "[robot]\ndamping = 3", "robot.damping: expected a table, got 3"),
        (
            "[robot]",
            "[robot]\ndamping = {c_a = -1}",
            "robot.damping.c_a: expected a finite non-negative number, got -1",
        ),
        (
            "[robot]",
            "[robot]\ndamping = [{c_a = 1}]",
            "robot.damping: expected 2 for 3 discs, got 1",
        ),
        (
            "length = 1",
            "length = 1\nbend_deg = [1, true, 0]",
            "robot.threads[1].bend_deg: expected finite numbers of shape (3), got [1, True, 0]",
        ),
        ("t_end = 3", "t_end = 0", "run.t_end: expected a finite positive number, got 0"),
        ("t_end = 3", "", "run.t_end: expected a finite positive number [s], got nothing"),
        ("t_end = 3", "t_end = 3\nrtol = 1", "run.rtol: expected a number below 1, got 1.0"),
        (
            "t_end = 3",
            't_end = 3\nmethod = "a b"',
            "run.method: expected the name of an integration method, got 'a b'",
        ),
        ("[run]", "[rum]", "run: expected a table, got nothing"),
        (
            "schema = 1",
            'schema = 1\nname = "Two words"',
            "name: expected lower-case words joined by _, at most 60 characters, got 'Two words'",
        ),
        (
            "schema = 1",
            'schema = 1\ntitle = "a\\nb"',
            "title: expected one line of text, got 'a\\nb'",
        ),
    ],
)
def test_an_error_names_file_key_expectation_and_gift(old, new, line):
    assert errors_of(edited(SMALL, old, new))[0] == line


@pytest.mark.parametrize(
    ("addition", "line"),
    [
        (
            TURNS,
            "robot.springs[1].at: expected at, or start_at with end_at, or start with end, got nothing",
        ),
        (
            TURNS + "at = [1]\nend = [1, 2, 3]",
            "robot.springs[1].at: expected at, or start_at with end_at, or start with end, got at and start",
        ),
        (
            TURNS + "start_at = [1]\nend_at = [1, 2]",
            "robot.springs[1].end_at: expected 1 angles, as in start_at, got 2",
        ),
        (
            TURNS + "at = [1]\nrest_length = -1",
            "robot.springs[1].rest_length: expected a finite non-negative number, got -1",
        ),
        (
            TURNS.replace("[1, 2]", "[1, 3]") + "at = [1]",
            "robot.springs[1].discs: expected neighbours [i, i + 1], got [1, 3]",
        ),
        (
            TURNS.replace("[1, 2]", "[3, 4]") + "at = [1]",
            "robot.springs[1].discs: expected disc numbers from 1 to 3, got [3, 4]",
        ),
        (
            TURNS.replace("[1, 2]", '"any"') + "at = [1]",
            "robot.springs[1].discs: expected \"all\" or two neighbouring disc numbers, got 'any'",
        ),
        (
            TURNS.replace("[1, 2]", '"all"') + f"at = {[1] * 10_001}",
            "robot.springs[1].discs: expected at most 20000 springs in all, got 20002",
        ),
        (
            "[[robot.chambers]]\ndiscs = [2, 2]",
            "robot.chambers[1].discs: expected first < last, got (2, 2)",
        ),
        (
            "[[robot.chambers]]\ndiscs = [1, true]",
            'robot.chambers[1].discs: expected "all" or the first and the last disc number, got [1, True]',
        ),
        (
            '[[robot.chambers]]\ndiscs = "all"\nareas = [1, 2]',
            "robot.chambers[1].areas: expected finite numbers of shape (3), got shape (2,)",
        ),
        (
            "[model]\nchart = 'plane'",
            "model.chart: expected cardan, paper, planar, hinge, ball or rigid, or a list of them, got 'plane'",
        ),
        ("[model]\nchart = ['planar']", "model.chart: expected 1 or 2 names, got 1"),
        (
            "[model]\nvelocity_terms = 'half'",
            "model.velocity_terms: expected full, paper or none, got 'half'",
        ),
        ("[model]\nactuator = 'pump'", "model.actuator: expected direct or regulator, got 'pump'"),
        (
            "[model.actuator]\nkind = 'pump'",
            "model.actuator.kind: expected direct or regulator, got 'pump'",
        ),
        (
            "[model.actuator]\nkind = 'regulator'\nmaximum = -1",
            "model.actuator.maximum: expected a pressure above the minimum of 0 Pa, got -1.0",
        ),
        (
            "[model.actuator]\nkind = 'direct'\nmaximum = 1",
            "model.actuator.maximum: expected one of kind, got an unknown key",
        ),
        (
            "[initial]\nq = [1, 2]",
            "initial.q: expected finite numbers of shape (10), got shape (2,)",
        ),
        (
            "[initial]\nq = 0\nthread_x = 1",
            "initial.q: expected either q or named coordinates, got both",
        ),
        (
            "[initial]\nbeta = 1",
            "initial.beta: expected a coordinate of every segment (chart cardan), got another one",
        ),
        (
            "[initial]\nthread_x = [1, 2, 3]",
            "initial.thread_x: expected finite numbers of shape (2), got shape (3,)",
        ),
        (
            "[initial]\npressure = 1",
            "initial.pressure: expected no pressure for a robot without chambers, got one",
        ),
        (
            "[pressure]\nvalue = 1",
            "pressure: expected no pressure for a robot without chambers, got one",
        ),
        (
            "[sensors]",
            "sensors: expected one of schema, name, title, robot, model, initial, pressure, run, got an unknown key",
        ),
    ],
)
def test_an_error_in_an_optional_table(addition, line):
    assert errors_of(SMALL + addition)[0] == line


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "pressure.value: expected finite numbers of shape (2) [Pa], got nothing"),
        ("valeu = 1", "pressure.value: expected finite numbers of shape (2) [Pa], got nothing"),
        ("value = [1]", "pressure.value: expected finite numbers of shape (2), got shape (1,)"),
        (
            "value = 1\nkind = 'step'",
            "pressure.kind: expected one of value, times, values, got an unknown key",
        ),
        (
            "times = [0, 1]",
            "pressure.values: expected finite numbers of shape (n) [Pa], got nothing",
        ),
        (
            "times = [0, 1]\nvalues = [1]",
            "pressure.values: expected 2 rows, one for each time, got 1",
        ),
        (
            "times = [1, 1]\nvalues = [1, 2]",
            "pressure.times: expected strictly increasing times, got [1.0, 1.0]",
        ),
        (
            "times_ms = [0]\nvalues_kpa = [[1]]",
            "pressure.values_kpa: expected finite numbers of shape (n, 2), got shape (1, 1)",
        ),
        (
            "times = [0]\nvalues = [1]\nkind = 'spline'",
            "pressure.kind: expected step or linear, got 'spline'",
        ),
    ],
)
def test_an_error_in_the_pressure(text, line):
    assert errors_of(PRESSED + text)[0] == line


def test_all_errors_of_a_file_are_reported_together_in_its_order():
    text = edited(FULL, "mass_g = 12.5", "mass_g = -12.5")
    text = edited(text, "length = 0.02", "lenght = 0.02")
    text = edited(text, "c_r = 2e-3", "c_r = inf")
    text = edited(text, '"cardan", "paper", "cardan"', '"cardan", "peper", "cardan"')
    text = edited(text, "rtol = 1e-7", "rtol = 0")
    assert [line.split(":")[0] for line in errors_of(text)] == [
        "robot.discs[1].mass_g",
        "robot.threads[3].length",
        "robot.threads[3].lenght",
        "robot.damping[3].c_r",
        "model.chart",
        "run.rtol",
    ]


def test_a_flood_of_errors_is_counted():
    lines = errors_of(SMALL + "\n".join(f"key_{k} = 1" for k in range(80)))
    assert len(lines) == 51 and lines[-1] == "and 30 more errors"


CORNERS = [[math.cos(k / 200), math.sin(k / 200)] for k in range(1025)]
LARGE_PLATE = f'shape = "polygon"\nmass = 1\nvertices = {CORNERS}'


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            edited(SMALL, DISC, LARGE_PLATE),
            "robot.discs[1].vertices: expected at most 1024 corners, got 1025",
        ),
        (
            SMALL + 257 * '[[robot.chambers]]\ndiscs = "all"\n',
            "robot.chambers: expected at most 256, got 257",
        ),
        (
            edited(SMALL, "[robot]", "[robot]\nchambers = 3"),
            "robot.chambers: expected [[robot.chambers]] tables, got 3",
        ),
    ],
)
def test_sizes_are_limited(text, line):
    assert errors_of(text) == [line]


def test_reading_of_springs_stops_at_a_flood_of_errors():
    assert len(errors_of(SMALL + 60 * "[[robot.springs]]\n")) == 51


def test_a_wrong_disc_does_not_hide_another():
    text = edited(FULL, "mass = 0.02", "mass = 0")
    text = edited(text, "0, 7000]]", "0, 90000]]")
    paths = [line.split(":")[0] for line in errors_of(text)]
    assert paths == ["robot.discs[3].mass", "robot.discs[4].inertia_g_mm2"]


def test_the_error_survives_the_way_back_from_a_worker_process():
    with pytest.raises(SceneError) as caught:
        parse("schema = 1")
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.errors == caught.value.errors and str(again) == str(caught.value)


# ---- files ---------------------------------------------------------------------------------------


def test_a_path_is_a_string_or_a_path_object(tmp_path):
    file = tmp_path / "My scene-2.toml"
    file.write_text(SMALL)
    for path in (file, str(file)):
        assert load_scene(path).name == "my_scene_2"
    file = tmp_path / "22.toml"
    file.write_bytes(b"\xef\xbb\xbf" + SMALL.replace("\n", "\r\n").encode())  # as Windows writes
    assert load_scene(file).name == "scene"


def test_a_name_is_never_a_path(tmp_path, monkeypatch):
    (tmp_path / "mine").write_text(SMALL)
    (tmp_path / "seed_four_disc").write_text("nonsense")
    monkeypatch.chdir(tmp_path)
    assert load_scene("seed_four_disc").t_end == 10.0
    assert load_scene("./mine").name == "mine"
    with pytest.raises(
        SceneError, match=r"^scene: expected a path such as ./mine.toml, or one of "
    ):
        load_scene("mine")
    with pytest.raises(
        SceneError, match=r"\(did you mean seed_four_disc\?\), got 'seed_for_disc'$"
    ):
        load_scene("seed_for_disc")
    with pytest.raises(SceneError, match=r"no such file"):
        load_scene("../scenes/seed_four_disc")


def no_file(tmp_path: Path) -> Path:
    return tmp_path / "none.toml"


def folder(tmp_path: Path) -> Path:
    return tmp_path


def pipe(tmp_path: Path) -> Path:
    os.mkfifo(tmp_path / "pipe.toml")
    return tmp_path / "pipe.toml"


def binary(tmp_path: Path) -> Path:
    (tmp_path / "x.toml").write_bytes(b"\x89PNG\r\n\x1a\n\x00")
    return tmp_path / "x.toml"


def large(tmp_path: Path) -> Path:
    (tmp_path / "x.toml").write_bytes(b"#" * (MAX_BYTES + 1))
    return tmp_path / "x.toml"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (no_file, "expected a readable scene file, got no such file or directory"),
        (folder, "expected a readable scene file, got a folder or a device"),
        (pipe, "expected a readable scene file, got a folder or a device"),
        (binary, "expected a TOML file in UTF-8, got the byte 0x89 at position 0"),
        (large, "expected a scene file of at most 1_000_000 bytes, got more"),
    ],
)
def test_a_file_that_cannot_be_read(tmp_path, make, message):
    path = make(tmp_path)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value) == f"{path}: {message}"


@pytest.mark.parametrize("path", ["a\0b", "\udc80/\ud800", "x" * 5000 + ".toml", 3, None, b"x", ""])
def test_what_cannot_be_a_path(path):
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (line,) = caught.value.errors
    assert line.isprintable()


@pytest.mark.parametrize(
    ("text", "got"),
    [
        ("a = ", "expected a TOML file, got an error: "),
        ("a = 1\na = 2", "expected a TOML file, got an error: "),
        ("a = " + "[" * 9999, "expected a TOML file, got tables or lists nested too deeply"),
        ("a = " + "9" * 9999, "expected a TOML file, got an integer of thousands of digits"),
        (".".join("a" * 9999) + " = 1", "expected keys of at most 16 parts, got a longer one"),
        (
            '\'a\' . "\\"" . ' * 9999 + "a = 1",
            "expected keys of at most 16 parts, got a longer one",
        ),
    ],
)
def test_what_is_no_toml(text, got):
    (line,) = errors_of(text)
    assert line.startswith(got)


# ---- the scene -----------------------------------------------------------------------------------


def seed(**changes) -> Scene:
    return dataclasses.replace(load_scene("seed_four_disc"), **changes)


def test_a_scene_can_be_changed_by_replacing_its_fields():
    scene = seed(t_end=3.0, pressure=Profile.constant(5.0))
    assert scene.t_end == 3.0 and scene.pressure(0.0) == [5.0]
    assert scene.initial_chart == ("planar",) * 3
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.t_end = 4.0
    with pytest.raises(ValueError, match="read-only"):
        scene.q0[0] = 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "Seed"}, "scene.name: expected lower-case words joined by _, got 'Seed'"),
        ({"robot": 3}, "scene.robot: expected a Robot, got 3"),
        ({"pressure": 3.0}, "scene.pressure: expected a Profile, got 3.0"),
        ({"options": []}, "scene.options: expected a dict, got []"),
        (
            {"pressure": Profile.constant([1.0, 2.0])},
            "scene.pressure: expected 1 commands, one for each chamber, got 2",
        ),
        ({"q0": np.zeros(5)}, "scene.q0: expected finite numbers of shape (6), got shape (5,)"),
        ({"qd0": np.full(6, np.nan)}, "scene.qd0: expected finite numbers of shape (6), got [nan"),
        ({"t_end": 0.0}, "scene.t_end: expected a finite positive number, got 0.0"),
        ({"rtol": -1}, "scene.rtol: expected a finite positive number, got -1"),
        ({"step_s": "1"}, "scene.step_s: expected a finite positive number, got '1'"),
        ({"initial_pressure": [1, 2]}, "scene.initial_pressure: expected finite numbers of shape "),
    ],
)
def test_a_scene_made_by_hand_is_checked_too(changes, message):
    with pytest.raises(SceneError) as caught:
        seed(**changes)
    assert str(caught.value).startswith(message)


def test_a_scene_builds_its_model_with_options_replaced():
    scene = load_scene("seed_four_disc")
    model = scene.build()
    assert [chart.name for chart in model.charts] == ["planar"] * 3
    assert isinstance(model.actuator, Direct)
    assert np.array_equal(scene.x0(model), np.concatenate([scene.q0, scene.qd0]))
    other = scene.build(velocity_terms="none", chart="hinge")
    assert other.options.velocity_terms == "none" and other.n_q == 3


def test_the_initial_pose_is_converted_to_the_models_chart():
    scene = seed(qd0=np.array([0.3, -0.2, 0.1, 0, 0, 0.5]))
    x0 = scene.x0(scene.build(chart="cardan"))
    assert x0.shape == (30,)
    q, qd = x0[:15].reshape(3, 5), x0[15:].reshape(3, 5)
    np.testing.assert_allclose(q[:, [0, 2]].ravel(), scene.q0, atol=1e-15)
    np.testing.assert_allclose(qd[:, [0, 2]].ravel(), scene.qd0, atol=1e-14)
    assert not q[:, [1, 3, 4]].any()
    np.testing.assert_allclose(qd[:, [1, 3, 4]], 0.0, atol=1e-15)


def test_the_actuator_starts_settled():
    regulator = Regulator(maximum=10.0)
    scene = seed()
    model = scene.build(actuator=regulator)
    assert scene.x0(model)[-1] == 10.0  # the command of 12 within its limits
    assert seed(initial_pressure=[4.0]).x0(model)[-1] == 4.0
    assert model.n_x == len(scene.x0(model)) == 13


def test_a_full_scene_builds():
    scene = parse(FULL)
    model = scene.build()
    assert model.n_q == 15 and model.n_u == 2
    x0 = scene.x0(model)
    assert x0[-2:].tolist() == [10e3, 0.0]
    model_by_hand = build(scene.robot, **scene.options)
    assert model_by_hand.state_names == model.state_names
