"""The paper's own validation (section IV): two discs against equations derived by hand."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import two_disc
from oracles.cases import error, evaluate, numbers
from oracles.lagrangian import lagrangian
from oracles.robots import coordinates, random_robot

import dtcasadi as dtc
from dtcasadi.robot import Disc, Robot, Spring, Thread

CHARTS = ("paper",)
N_CONFIGURATIONS = 100  # for each of the two robots: 200 in all


def hoops() -> Robot:
    """The paper's example reduced to two discs: unit hoops and three springs (section V)."""
    hoop = Disc.hoop(2.0, 1.0)
    rim = [np.array([np.sin(a), 1 - np.cos(a), 0.0]) for a in np.pi / 2 * np.arange(1, 4)]
    springs = [Spring((1, 2), point, point, 1.0) for point in rim]
    return Robot((hoop, hoop), (Thread(1.0),), tuple(springs))


def arbitrary() -> Robot:
    """Offset centre, full tensor, springs anywhere; the thread as in the paper."""
    robot = random_robot(np.random.default_rng(2), 2)
    return replace(robot, threads=(Thread(0.8),))


@pytest.fixture(params=[hoops, arbitrary], ids=lambda make: make.__name__)
def robot(request) -> Robot:
    """A two-disc robot."""
    return request.param()


def test_hand_derivations_agree(rng, robot):
    """Newton-Euler, Euler-Lagrange and the plain Lagrangian are three independent derivations."""
    plain = lagrangian(robot, CHARTS)
    none = np.zeros(5)
    for _ in range(10):
        q = coordinates(rng, CHARTS)
        first, second = two_disc.newton_euler(robot, q), two_disc.euler_lagrange(robot, q)
        third = evaluate(plain, q, none, none, np.zeros(len(robot.chambers)))
        for name, value in first._asdict().items():
            # 1e-12: round-off of about a hundred operations.
            assert error(value, getattr(second, name)) < 1e-12
            assert error(value, third[name]) < 1e-12


@pytest.mark.parametrize("derive", [two_disc.newton_euler, two_disc.euler_lagrange])
def test_model_equals_hand_derivation(rng, robot, derive):
    """M, gravity and spring forces over arbitrary configurations, as the paper did."""
    model = dtc.build(robot, chart="paper")
    functions = {"M": model.mass_matrix, "gravity": model.gravity, "spring": model.spring}
    for _ in range(N_CONFIGURATIONS):
        # The paper's "wide selection of arbitrary values"; M itself is regular everywhere.
        q = rng.uniform(-np.pi, np.pi, 5)
        expected = derive(robot, q)
        for name, function in functions.items():
            # 1e-11, the accuracy asked of this comparison; round-off is near 1e-15.
            value = numbers(function, q, model.theta0)
            assert error(value, getattr(expected, name)) < 1e-11, name
