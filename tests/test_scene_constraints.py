"""Constraints in scene files, and what they refuse."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace
from typing import Any

import pytest
from scene_texts import SMALL, errors_of, parse

import dtcasadi as dtc
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.constraints import Guided, Joined, Pinned, Strap
from dtcasadi.errors import RobotError

SCENE = """
[[robot.constraints]]
kind = "guided"
disc = 3
point = [0, 0, 0]
place_mm = [0, 0, 1500]
along = [1, 0, 0]
[[robot.constraints]]
kind = "strap"
discs = [1, 2]
start = [0, 1, 0]
end_cm = [0, 100, 0]
length = 0.5
[[robot.constraints]]
kind = "pinned"
disc = 2
point = [0, 1, 0]
place = [0, 1, 1]
[[robot.constraints]]
kind = "joined"
discs = [2, 3]
start = [0, 1, 0]
end = [0, 1, -1]
"""


def test_scenes_hold_constraints():
    guided, strap, pinned, joined = parse(SMALL + SCENE).robot.constraints
    assert isinstance(guided, Guided) and guided.place.tolist() == [0, 0, 1.5]
    assert isinstance(strap, Strap) and (strap.discs, strap.length) == ((1, 2), 0.5)
    assert isinstance(pinned, Pinned) and isinstance(joined, Joined)
    for change, line in (
        (("disc = 3", "disc = 4"), "disc: expected an integer from 2 to 3, got 4"),
        (("along = [1, 0, 0]", ""), "along: expected either along or normal, got none"),
        (("discs = [1, 2]", "discs = [1, 9]"), "discs: expected discs from 1 to 3, got (1, 9)"),
        (('"joined"', '"glued"'), "kind: expected pinned, guided, strap or joined, got 'glued'"),
    ):
        assert line in "\n".join(errors_of(SMALL + SCENE.replace(*change)))


def held(robot: dtc.Robot, *constraints: Any) -> dtc.Robot:
    return replace(robot, constraints=constraints)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Pinned(1, (0, 0, 0), (0, 0, 0)), "disc: expected an integer from 2"),
        (lambda: Guided(2, (0, 0, 0), (0, 0, 0)), "along: expected either along or normal, got n"),
        (
            lambda: Guided(2, (0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 0, 0)),
            "along: expected either along or normal, got both",
        ),
        (lambda: Strap((2, 2), (0, 0, 0), (0, 0, 0), 1), "discs: expected two disc numbers in ris"),
        (lambda: Strap((1, 2), (0, 0, 0), (0, 0, 0), 0), "length: expected a finite positive numb"),
        (
            lambda: held(seed_robot(3), Pinned(4, (0, 0, 0), (0, 0, 0))),
            r"constraints\[1\].discs: expected discs from 1 to 3",
        ),
        (lambda: held(seed_robot(3), "pin"), r"constraints\[1\]: expected a Constraint, got 'pin'"),
    ],
)
def test_what_is_refused(make, text):
    with pytest.raises(RobotError, match=text):
        make()
