"""The `[robot.tube]` and `[robot.rod]` tables of scene files."""

# mypy: disable-error-code="attr-defined, union-attr"
# What kind of beam or force it is, the test knows.

import math

import numpy as np
import pytest
from scene_texts import errors_of

from dtcasadi.robot import Robot
from dtcasadi.scene import parse_scene

TUBE = """
schema = 1
[robot]
up = [0, 0, 1]
[robot.tube]
n_discs = 5
length_cm = 40
radius_mm = 25
wall_thickness_mm = 2
youngs_modulus_mpa = 0.8
poissons_ratio = 0.45
density = 1100
payload_g = 50
bend_deg = [30, -20]
twist_deg = 90
chambers = 2
strip_turns_deg = [45]
posts = 6
rated_pressure_kpa = 40
radial_compliance_per_kpa = 1e-3
retardation_time_ms = 30
[[robot.forces]]
kind = "point_load"
disc = 5
magnitude = 2
direction = [1, 0, 0]
[run]
t_end = 1
"""
ROD = """
schema = 1
[robot.rod]
n_discs = 4
length = 0.5
bending_stiffness = 2
shear_stiffness_kn = 3
twisting_stiffness = 1
mass_per_length_g_per_m = 300
radius_mm = 30
bend = 0.4
[[robot.rod.cells]]
area_cm2 = 4
centroid_mm = [0, 20]
rated_pressure_bar = 2
[run]
t_end = 1
"""


def same(one: Robot, other: Robot) -> None:
    for kind in ("discs", "threads", "springs", "chambers"):
        for a, b in zip(getattr(one, kind), getattr(other, kind), strict=True):
            assert vars(a).keys() == vars(b).keys()
            for name, value in vars(a).items():
                expected = getattr(b, name)
                if value is None or expected is None:
                    assert value is expected
                else:
                    np.testing.assert_allclose(value, expected, rtol=1e-12, atol=1e-15)
    assert np.array_equal(one.up, other.up) and one.gravity == other.gravity


def test_a_tube_is_what_from_tube_makes():
    scene = parse_scene(TUBE.encode())
    made = Robot.from_tube(
        *(0.4, 0.025, 2e-3, 0.8e6, 0.45, 1100.0, 5),
        payload=0.05,
        bend=(math.radians(30), math.radians(-20)),
        twist=math.pi / 2,
        chambers=2,
        strip_turns=[math.pi / 4],
        posts=6,
        rated_pressure=40e3,
        radial_compliance=1e-6,
        retardation_time=0.03,
        up=[0, 0, 1],
    )
    same(scene.robot, made)
    assert [force.disc for force in scene.robot.forces] == [5]
    assert scene.beam is not None and scene.pressure.n_u == 2 and len(scene.q0) == 20


def test_a_rod_is_what_from_rod_makes():
    scene = parse_scene(ROD.encode())
    made = Robot.from_rod(0.5, 2.0, 3e3, 1.0, 0.3, 4, radius=0.03, bend=0.4, cells=scene.beam.cells)
    same(scene.robot, made)
    assert scene.robot.chambers[0].rated_pressure == 2e5
    assert scene.robot.chambers[0].areas == pytest.approx(np.full(4, 4e-4))


@pytest.mark.parametrize(
    ("text", "old", "new", "line"),
    [
        (TUBE, "n_discs = 5", "n_discs = 2", "robot.tube.n_discs: expected an integer from 3 to"),
        (TUBE, "n_discs = 5", "", "robot.tube.n_discs: expected an integer from 2 to 4096, got no"),
        (TUBE, "_mm = 25", "_mm = -25", "robot.tube.radius_mm: expected a finite positive number"),
        (TUBE, "_mpa = 0.8", "_mpa = 0", "robot.tube.youngs_modulus_mpa: expected a finite pos"),
        (TUBE, "ratio = 0.45", "ratio = 0.6", "robot.tube.poissons_ratio: expected a number above"),
        (TUBE, "posts = 6", "posts = 7", "robot.tube.posts: expected an even number, got 7"),
        (TUBE, "[30, -20]", "[30]", "robot.tube.bend_deg: expected finite numbers of shape (2)"),
        (TUBE, "[45]", "[45, 45]", "robot.tube.strip_turns_deg: expected one for each of the 2"),
        (TUBE, "payload_g", "payloads", "robot.tube.payloads: expected one of"),
        (TUBE, "disc = 5", "disc = 6", "robot.forces[1].disc: expected a disc number from 2 to 5"),
        (TUBE, "up = [0, 0, 1]", 'discs = "none"', "robot.discs: expected one of up"),
        (ROD, "area_cm2 = 4", "area_cm2 = 0", "robot.rod.cells[1].area_cm2: expected a finite"),
        (ROD, "_mm = [0, 20]", "_mm = [20]", "robot.rod.cells[1].centroid_mm: expected finite"),
        (ROD, "stiffness = 2", 'stiffness = "2"', "robot.rod.bending_stiffness: expected a finite"),
        ("schema = 1\n[robot]\nrod = 3\n[run]\nt_end = 1", "3", "4", "robot.rod: expected a table"),
    ],
)
def test_an_error_names_its_place(text, old, new, line):
    assert old in text
    found = errors_of(text.replace(old, new))
    assert any(error.startswith(line) for error in found), found
