"""`recentring.chart_limit`: models that cannot re-centre name the singularity they are next to."""

import re

import numpy as np
import pytest
from oracles.robots import random_robot

import dtcasadi as dtc
from dtcasadi import recentring as rc
from dtcasadi.bound import Bound
from dtcasadi.presets import seed_four_disc

ROBOT = random_robot(np.random.default_rng(3), 4)


@pytest.mark.parametrize(
    ("options", "index", "angle", "text"),
    [
        (
            {"chart": "paper"},
            6,
            np.pi,
            r"segment 2: beta = .* singularity of chart paper \(\|sin\|",
        ),
        (
            {"chart": "paper"},
            13,
            1.5705,
            r"segment 3: psi = 1.5705 rad .* paper \(\|cos\| = 3.0e-04",
        ),
        ({"damping": "coordinate"}, 1, -np.pi / 2, "segment 1: thread_y = .* of chart cardan"),
        ({"damping": "coordinate"}, 8, np.pi / 2, "segment 2: disc_y = .* of chart cardan"),
    ],
)
def test_chart_limit_names_the_angle(options, index, angle, text):
    m = dtc.build(ROBOT, **options)
    x = np.full(m.n_x, 0.5)
    assert rc.chart_limit(m, x) is None
    x[index] = angle
    sentence = rc.chart_limit(m, x)
    assert sentence is not None and re.match(text, sentence)


def test_chart_limit_leaves_other_charts_alone():
    physical = dtc.build(ROBOT)
    assert rc.chart_limit(physical, np.full(physical.n_x, np.pi / 2)) is None
    planar = dtc.build(ROBOT, chart="planar")
    assert rc.chart_limit(planar, np.zeros(planar.n_x)) is None


@pytest.mark.parametrize(("chart", "angle"), [("paper", 0.0), ("cardan", np.pi / 2)])
def test_threshold_is_where_round_off_meets_the_tolerance(rng, chart, angle):
    """One angle of the paper's robot at THRESHOLD: cond(M) round-off just below 1e-6."""
    m = dtc.build(seed_four_disc(), chart=chart, damping="coordinate")
    mass = Bound(m.mass_matrix, matrices=frozenset({"M"}))
    conditions = []
    for _ in range(50):
        q = rng.uniform(0.5, 1.1, 15) * rng.choice([-1, 1], 15)
        q[5 * rng.integers(3) + 1] = angle + rc.THRESHOLD
        conditions.append(np.linalg.cond(mass(q, m.theta0)))
    assert 1e-8 < np.median(conditions) * np.finfo(float).eps < max(conditions) * 2.3e-16 < 1e-6
