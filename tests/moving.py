"""Models that the tests of `simulate` share, each built once in a session."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from oracles.robots import random_robot

import dtcasadi as dtc
from dtcasadi.robot import Chamber, Damping, Disc, Robot, Thread

TIGHT: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-12}


DOWN, UP, FORCE = "seed_four_disc", "seed_four_disc_up", "seed_four_disc_force"


@cache
def scene_model(name: str, **options: str) -> dtc.Model:
    """A shipped scene's model; two of them have the same robot."""
    if name == FORCE:
        return scene_model(UP, **options)
    return dtc.load_scene(name).build(**options)


def seed() -> dtc.Model:
    """The paper's robot in the plane, thread on top."""
    return scene_model(DOWN)


def seed_x0() -> np.ndarray:
    """Its initial state."""
    return dtc.load_scene(DOWN).x0(seed())


@cache
def free() -> dtc.Model:
    """A disc in space with springs and weight, without damping and chambers."""
    robot = random_robot(np.random.default_rng(2), 2)
    springs = tuple(replace(spring, damping=0.0) for spring in robot.springs)
    return dtc.build(replace(robot, springs=springs, damping=Damping(), chambers=()))


@cache
def full() -> dtc.Model:
    """Three discs in space with everything: dampers, damping, three chambers, dead loads."""
    return dtc.build(random_robot(np.random.default_rng(3), 3), wrenches=(2, 3))


def full_theta() -> np.ndarray:
    """Its parameters with some dead load."""
    theta = full().theta0.copy()
    theta[full().theta_blocks["wrench"]] = np.random.default_rng(4).normal(size=12)
    return theta


def swift(model: dtc.Model) -> np.ndarray:
    """A bent pose in motion."""
    return np.concatenate([np.full(model.n_q, 0.3), np.full(model.n_x - model.n_q, 2.0)])


def cranked(actuator: str | dtc.Regulator = "direct") -> dtc.Model:
    """One disc that turns about a fixed axis, pushed by a chamber with a lever of 0.2 m."""
    disc = Disc(2.0, 0.1 * np.eye(3), area=0.5, centroid=np.array([0.0, 0.2, 0.0]))
    discs, chambers = (Disc(1.0, np.eye(3)), disc), (Chamber((1, 2)),)
    robot = Robot(discs, (Thread(0.5),), chambers=chambers, gravity=0.0)
    return dtc.build(robot, chart="hinge", actuator=actuator)


@cache
def pendulum() -> dtc.Model:
    """One link under gravity, hanging at coordinate zero."""
    discs = (Disc(1.0, np.eye(3)), Disc(2.0, 0.1 * np.eye(3)))
    return dtc.build(Robot(discs, (Thread(0.5),), up=np.array([0.0, 0.0, -1.0])), chart="hinge")
