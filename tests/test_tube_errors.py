"""What no tube or rod can be is refused by its field."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

import math

import pytest
from tubes import NU, RHO, E, L, R, T

from dtcasadi.errors import RobotError
from dtcasadi.robot import Robot


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"radius": -1.0}, "radius"),
        ({"wall_thickness": 2 * R}, "wall_thickness"),
        ({"poissons_ratio": 0.6}, "poissons_ratio"),
        ({"density": math.nan}, "density"),
        ({"fabric": "belt"}, "fabric"),
        ({"payload": -1.0}, "payload"),
        ({"bend": (1.0, 2.0, 3.0)}, "bend"),
        ({"bend": "much"}, "bend"),
        ({"bend": 2 * L / R, "n_discs": 16}, "bend"),
        ({"twist": math.inf}, "twist"),
        ({"chambers": -1}, "chambers"),
        ({"strip_turns": (1.0,)}, "strip_turns"),
        ({"posts": 5}, "posts"),
        ({"retardation_time": -1.0}, "retardation_time"),
        ({"n_discs": 1}, "n_discs"),
        ({"n_discs": 3, "chambers": 3}, "n_discs"),
        ({"n_discs": 4.0}, "n_discs"),
        ({"up": (0, 0, 0)}, "up"),
        ({"rated_pressure": 0.0}, "rated_pressure"),
    ],
)
def test_a_wrong_tube_is_refused_by_its_field(changes, field):
    good = {
        "length": L,
        "radius": R,
        "wall_thickness": T,
        "youngs_modulus": E,
        "poissons_ratio": NU,
        "density": RHO,
        "n_discs": 4,
    }
    with pytest.raises(RobotError) as caught:
        Robot.from_tube(**(good | changes))
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"EI": 0.0}, "EI"),
        ({"GA": -1.0}, "GA"),
        ({"GJ": None}, "GJ"),
        ({"mass_per_length": "heavy"}, "mass_per_length"),
        ({"radius": 0.0}, "radius"),
        ({"cells": [3]}, "cells[1]"),
        ({"n_discs": 0}, "n_discs"),
    ],
)
def test_a_wrong_rod_is_refused_by_its_field(changes, field):
    good = {"length": 1.0, "EI": 1.0, "GA": 1e4, "GJ": 1.0, "mass_per_length": 1.0, "n_discs": 4}
    with pytest.raises(RobotError) as caught:
        Robot.from_rod(**(good | changes))
    assert caught.value.field == field
