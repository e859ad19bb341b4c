"""`[[robot.forces]]` of scene files: every kind in SI units, and what is refused."""

import pytest
from scene_texts import FULL, SMALL, errors_of, parse

import dtcasadi as dtc


def test_every_kind_arrives_in_si_units():
    robot = parse(FULL).robot
    point, couple, payload, *rest = robot.forces
    assert isinstance(point, dtc.PointLoad) and isinstance(couple, dtc.Couple)
    assert (point.disc, point.magnitude) == (4, 0.5)
    assert point.direction.tolist() == [0, -1, 0]
    assert point.point is not None and point.point.tolist() == [0, 0.03, 0]
    assert (couple.magnitude, couple.follower) == (0.002, True)
    assert couple.direction.tolist() == [0, 0, 1]
    assert isinstance(payload, dtc.Payload) and payload.point is not None
    assert payload.mass == 0.02 and payload.inertia[2, 2] == pytest.approx(2e-6, rel=1e-15)
    assert payload.point.tolist() == robot.discs[3].centre_of_mass.tolist()
    drags = [force for force in rest if isinstance(force, dtc.Drag)]
    assert [drag.disc for drag in drags] == [2, 3, 4]
    assert drags[0].linear.tolist() == [0.01] * 3
    assert drags[0].quadratic.tolist() == [0.1, 0.1, 0.02]
    assert drags[0].flow.tolist() == [0, 0, 0.05]
    walls = [force for force in rest if isinstance(force, dtc.WallSpring)]
    assert [wall.discs for wall in walls] == [(1, 2)] * 2 + [(2, 3)] * 2 + [(3, 4)] * 2
    assert walls[0].start.tolist() == [0.028, 0.028, 0] and walls[0].stiffening == 1e4
    bunch, follower = rest[-2:]
    assert isinstance(bunch, dtc.FabricBunching)
    assert (bunch.gap, bunch.stiffness, bunch.end.tolist()) == (0.01, 2000.0, [0, 0.002, 0])
    assert isinstance(follower, dtc.FollowerLoad) and follower.disc == 2
    assert [type(part) for part in rest] == [type(p) for p in (*drags, *walls, bunch, follower)]


def test_a_scene_with_forces_is_built():
    """Their numbers are freed by the paths that the scene's errors use."""
    model = parse(FULL).build(parameters=("forces[1].magnitude", "forces[3].mass"))
    assert model.theta0[model.theta_blocks["forces[1].magnitude"]] == [0.5]


LOAD = """
[[robot.forces]]
kind = "point_load"
disc = 2
magnitude = 1
direction = [0, 0, 1]
"""
WALL = """
[[robot.forces]]
kind = "wall_spring"
discs = "all"
at_deg = [90]
stiffness = 1
"""


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (LOAD.replace("point_load", "push"), "kind: expected point_load, follower_load, couple, "),
        (LOAD.replace("disc = 2", "disc = 1"), "disc: expected a disc number from 2 to 3, got 1"),
        (LOAD.replace("disc = 2", "disc = 2.0"), 'disc: expected a disc number, or "all", got 2.0'),
        (LOAD.replace("disc = 2", ""), 'disc: expected a disc number, or "all", got nothing'),
        (LOAD.replace("[0, 0, 1]", "[0, 0, 0]"), "direction: expected a direction (3 numbers"),
        (
            LOAD.replace("magnitude = 1", "magnitude_mn = nan"),
            "magnitude_mn: expected a finite",
        ),
        (
            LOAD + "mass = 1",
            "mass: expected one of kind, disc, magnitude, direction, point",
        ),
        (LOAD.replace("point_load", "couple") + "follower = 1", "follower: expected true"),
        (
            WALL.replace("stiffness = 1", ""),
            "stiffness: expected a finite non-negative number [",
        ),
        (WALL.replace('"all"', "[3, 1]"), "discs: expected the first and a later disc, got [3, 1]"),
        (WALL.replace("at_deg = [90]", ""), "at: expected at, or start_at with end_at, or start w"),
        (WALL + "gap = 1", "gap: expected one of kind, discs, "),
        (
            WALL.replace("wall_spring", "fabric_bunching"),
            "gap: expected a finite positive number",
        ),
        (WALL + "smoothing_mm = 0", "smoothing_mm: expected a finite positive number, got 0"),
    ],
)
def test_errors_name_the_place(text, line):
    (found,) = errors_of(SMALL + text)
    assert found.startswith(f"robot.forces[1].{line}"), found
