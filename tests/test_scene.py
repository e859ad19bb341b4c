"""Tests of dtcasadi.scene and the modules that read its files."""

import dataclasses
import math
import re

import numpy as np
import pytest
from scene_texts import FULL, PRESSED, SMALL, edited, parse

import dtcasadi.scene
from dtcasadi.actuators import Direct, Regulator
from dtcasadi.charts import CHARTS
from dtcasadi.errors import SceneError
from dtcasadi.measure import Measure
from dtcasadi.model import build
from dtcasadi.presets import rim, seed_four_disc
from dtcasadi.profile import Profile
from dtcasadi.robot import Robot
from dtcasadi.scene import Scene, load_scene, scene_names
from dtcasadi.scene_tables import REQUIRED, Table
from dtcasadi.scene_units import PURE

SEEDS = {
    "seed_four_disc": ((0, -1, 0), 12.0),
    "seed_four_disc_up": ((0, 1, 0), 12.0),
    "seed_four_disc_force": ((0, 1, 0), 3.82),
}


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
        assert load_scene(name).name == name.rpartition("/")[2]


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
    assert scene.measure == Measure()


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
    assert (whole.radial_compliance, part.radial_compliance) == (0.0, 2e-6)
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
    assert scene.measure == Measure("It stays in one piece", 1e-5, "seed_four_disc")


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
    assert options["actuator"] == (Direct() if kind == "direct" else Regulator())


def test_the_format_reference_names_every_key_and_suffix(monkeypatch):
    taken = set()
    take = Table.take

    def noting(table, key, expected, unit=PURE, default=REQUIRED):
        taken.update([key], (f"_{suffix}" for suffix in unit.suffixes))
        return take(table, key, expected, unit, default)

    monkeypatch.setattr(Table, "take", noting)
    parse(FULL)
    parse(PRESSED + "value = 3")
    places = (dtcasadi.scene, dtcasadi.scene_obstacles, dtcasadi.scene_constraints)
    words = set(re.findall(r"\w+", "".join(place.__doc__ or "" for place in places)))
    words |= {word.removesuffix("_deg") for word in words}
    coordinates = {name for chart in CHARTS.values() for name in chart.coordinate_names}
    assert len(taken) > 60
    assert not taken - words - coordinates


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


def test_a_scene_keeps_its_own_options():
    options = {"chart": "planar"}
    scene = seed(options=options)
    options["chart"] = "cardan"
    assert scene.options == {"chart": "planar"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "Seed"}, "scene.name: expected lower-case words joined by _, got 'Seed'"),
        ({"robot": 3}, "scene.robot: expected a Robot, got 3"),
        ({"pressure": 3.0}, "scene.pressure: expected a Profile, got 3.0"),
        ({"options": []}, "scene.options: expected a dict, got []"),
        (
            {"pressure": Profile.constant(np.array([1.0, 2.0]))},
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
