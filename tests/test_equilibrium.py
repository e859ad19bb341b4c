"""Where robots rest, against closed forms, published poses, and long damped simulations."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from moving import DOWN, UP, scene_model
from oracles.robots import random_robot
from scipy.optimize import brentq
from test_exact_cases import G, links
from test_seed_equilibria import EQUILIBRIA

import dtcasadi as dtc
from dtcasadi.errors import StaticsError
from dtcasadi.presets import rim
from dtcasadi.robot import Damping, Disc, Robot, Spring, Thread
from dtcasadi.statics import stability
from dtcasadi.statics.loads import LoadPath
from dtcasadi.statics.search import Mode, Search, search_of


@cache
def pendulum() -> dtc.Model:
    """2 kg on 0.7 m, hanging along z at zero."""
    return dtc.build(links([2.0], 0.7, 0.3), chart="hinge")


@pytest.mark.parametrize("share", [0.0, 0.3, -0.9, 0.999])
def test_pendulum_held_by_a_torque(share):
    """M g l sin(q) = tau, and the frequency about it, sqrt(m g l cos(q) / (m l^2 + I))."""
    weight = 2.0 * G * 0.7
    found = dtc.equilibrium(pendulum(), tau=[share * weight])
    assert found.stable and found.kind == "stable"
    assert found.q[0] == pytest.approx(np.arcsin(share), abs=1e-13 / np.cos(np.arcsin(share)))
    frequency = np.sqrt(weight * np.cos(found.q[0]) / (2.0 * 0.7**2 + 0.3))
    assert found.frequencies == pytest.approx([frequency], rel=1e-9)


def test_no_equilibrium_is_said_and_has_no_pose():
    """A torque above m g l turns the pendulum for ever."""
    found = dtc.equilibrium(pendulum(), tau=[1.2 * 2.0 * G * 0.7])
    assert not found.success and not found.stable and found.stability is None
    assert found.status != "found" and found.message.startswith("no equilibrium found")
    assert np.all(np.isnan(found.q)) and found.kind == "none"
    assert found.residual > 0.1 * found.load
    assert found.message.endswith("the loads can be balanced up to 0.833 of them")  # 1 / 1.2
    with pytest.raises(StaticsError, match="expected an equilibrium, got: no equilibrium found"):
        _ = found.frequencies


def test_standing_pendulum_is_found_from_a_guess_and_left_without_one():
    found = dtc.equilibrium(pendulum(), guess=[np.pi - 0.2])
    assert found.success and found.kind == "divergence" and not found.stable
    assert found.q[0] == pytest.approx(np.pi, abs=1e-12)
    rate = np.sqrt(2.0 * G * 0.7 / (2.0 * 0.7**2 + 0.3))
    assert found.eigenvalues == pytest.approx([rate, -rate], rel=1e-9)
    up = dtc.build(replace(pendulum().robot, up=[0, 0, 1]), chart="hinge")  # stands at zero
    left = dtc.equilibrium(up)
    assert left.stable and abs(left.q[0]) == pytest.approx(np.pi, abs=1e-12)


def test_double_pendulum_swings_at_the_textbook_frequencies():
    """Equal links: omega^2 = (2 -+ sqrt 2) g/l."""
    model = dtc.build(links([1.5, 1.5], 0.4, 1e-9), chart="hinge")
    found = dtc.equilibrium(model)
    expected = np.sqrt((2 + np.array([-1, 1]) * np.sqrt(2)) * G / 0.4)
    # The inertia of 1e-9 adds 1e-9 / (1.5 * 0.16) to 1.
    assert found.frequencies == pytest.approx(expected, rel=1e-7)
    ratio = found.mode_shapes[1] / found.mode_shapes[0]  # of the relative angles
    assert ratio + 1 == pytest.approx([np.sqrt(2), -np.sqrt(2)], rel=1e-6)


def one_spring(stiffness: float, scale: float = 1.0) -> Robot:
    """A horizontal link that a spring across its joint holds up, in a size of choice."""
    discs = (Disc(1.0, np.eye(3) * 1e-3 * scale**2), Disc(0.8, np.eye(3) * 1e-3 * scale**2))
    spring = Spring((1, 2), [0, 0.3 * scale, 0], [0, 0.2 * scale, 0], stiffness / scale)
    return Robot(discs, (Thread(0.5 * scale),), (spring,), up=[0, 1, 0], gravity=G)


@pytest.mark.parametrize("scale", [0.03, 1.0, 300.0])
def test_link_on_a_spring(scale):
    """The scalar balance of moments, solved by bracketing; the same pose in every size."""
    stiffness, half = 90.0, 0.5

    def moment(angle: float) -> float:
        # A turn about x takes z to (0, -sin, cos) and y to (0, cos, sin).
        tip = np.array([-0.5 * np.sin(angle), 0.5 * np.cos(angle)])
        arm = 0.2 * np.array([np.cos(angle), np.sin(angle)])
        end = tip + arm - np.array([0.3, 0.0])
        length, rest = np.linalg.norm(end), np.hypot(0.1, 0.5)
        rate = np.array([-tip[1] - arm[1], tip[0] + arm[0]])
        return stiffness * (length - rest) * end @ rate / length - 0.8 * G * half * np.cos(angle)

    expected = brentq(moment, 0.01, 1.5, xtol=1e-14)
    found = dtc.equilibrium(dtc.build(one_spring(stiffness, scale), chart="hinge"))
    assert found.stable, found.message
    assert found.q[0] == pytest.approx(expected, abs=1e-12)
    # 0.8 kg on 0.5 m by 9.81: the moment grows with the size.
    assert found.load == pytest.approx(2 * 0.8 * G * half * scale * np.cos(expected), rel=1e-6)


@pytest.mark.parametrize("pressure", EQUILIBRIA)
def test_published_poses_from_a_cold_start(pressure):
    """The planar robot with up = +y; the poses are those of the other test, found differently."""
    found = dtc.equilibrium(scene_model(UP), pressure)
    expected, digit = EQUILIBRIA[pressure]
    assert found.kind == "stable"
    turns = np.round((found.q - expected) / (2 * np.pi)) * 2 * np.pi
    np.testing.assert_allclose(found.q - turns, expected, rtol=0, atol=1.01 * digit)


def test_the_scene_of_the_paper_from_a_cold_start():
    expected = (-1.2107, 1.2308, -1.0029, 1.1753, -0.5933, 1.5081)
    found = dtc.equilibrium(scene_model(DOWN), 12.0)
    np.testing.assert_allclose(found.q, expected, rtol=0, atol=1e-4)  # digits cut off
    assert found.iterations < 20 and found.residual < 1e-12 * found.load


def test_space_and_plane_rest_alike():
    plane = dtc.equilibrium(scene_model(DOWN), 12.0)
    space = dtc.equilibrium(scene_model(DOWN, chart="cardan"), 12.0)
    assert space.stable
    for one, other in zip(plane.poses, space.poses, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_flutter_above_the_critical_pressure():
    found = dtc.equilibrium(scene_model(DOWN), 14.0)
    assert found.success and found.kind == "flutter"
    assert found.eigenvalues[0].real > 0 and abs(found.eigenvalues[0].imag) > 0.01


def test_damped_motion_comes_to_the_same_rest():
    found = dtc.equilibrium(scene_model(DOWN), 12.0)
    run = dtc.simulate(scene_model(DOWN), np.zeros(12), pressure=12.0, t_end=250.0)
    # The slowest mode, -0.051 1/s, leaves exp(-12.8).
    np.testing.assert_allclose(run.q[:, -1], found.q, atol=1e-5)


@cache
def sideways() -> dtc.Model:
    """Links in space that fall along x, where the chart's own singularity lies."""
    robot = links([0.5, 0.3, 0.4], 0.3, 0.01, damping=Damping(0.1, 0.1, 0.1, 0.1))
    return dtc.build(replace(robot, up=[-1.0, 0.02, 0.0]))


def test_charts_recentre_on_the_way():
    """The chain ends straight down, beyond the 45 degrees of its first chart."""
    found = dtc.equilibrium(sideways())
    assert found.success and found.recentrings >= 1
    down = -sideways().robot.up
    np.testing.assert_allclose(
        np.diff(found.poses[1], axis=0), 0.3 * np.tile(down, (3, 1)), atol=1e-9
    )
    assert np.linalg.cond(found.stability.M) < 1e4
    assert found.thread_tension == pytest.approx(np.array([1.2, 0.7, 0.4]) * G, rel=1e-9)
    again = dtc.equilibrium(sideways(), guess=found)
    np.testing.assert_allclose(again.poses[1], found.poses[1], atol=1e-9)


def test_a_pose_that_the_chart_cannot_hold():
    """Without pressure the paper's robot hangs where its own chart is singular."""
    model = scene_model(DOWN, chart="paper")
    found = dtc.equilibrium(model, 0.0)
    assert not found.success and found.status == "singular chart" and np.all(np.isnan(found.q))
    assert "at a singularity of chart paper" in found.message and "cardan" in found.message
    # Lifted, it is held well by the same chart, and rests where it does in the other.
    lifted = dtc.equilibrium(model, 12.0)
    other = dtc.equilibrium(scene_model(DOWN), 12.0)
    np.testing.assert_allclose(lifted.poses[1], other.poses[1], atol=1e-12)


def uncompiled(robot: Robot) -> dtc.Model:
    """A model whose equilibria are searched by the twin, with nothing to compile."""
    model = dtc.build(robot)
    model.once("search", lambda: Search(model, (), None))
    return model


@pytest.mark.parametrize("seed", range(6))
def test_balance_is_that_of_inverse_dynamics(seed):
    """Random robots in space: what is found balances in another recursion, and K is its slope."""
    model = uncompiled(random_robot(np.random.default_rng(seed), 3))
    found = dtc.equilibrium(model, 0.3)
    assert found.success, found.message
    still, step = np.zeros(model.n_q), 1e-6

    def needed(q: np.ndarray) -> np.ndarray:
        return np.array(
            model.inverse_dynamics(q, still, still, found.pressure, found.theta)
        ).ravel()

    assert np.max(np.abs(needed(found.q))) < 1e-11 * found.load
    assert found.stability is not None
    slopes = [
        (needed(found.q + step * e) - needed(found.q - step * e)) / (2 * step)
        for e in np.eye(model.n_q)
    ]
    K = found.stability.K
    # Central differences: step^2 of the third derivative and round-off / step.
    np.testing.assert_allclose(np.column_stack(slopes), K, atol=1e-7 * np.max(np.abs(K)))


@pytest.mark.parametrize("seed", range(4))
def test_a_stable_equilibrium_without_pressure_is_a_minimum_of_the_potential(seed):
    rng = np.random.default_rng(seed)
    model = uncompiled(random_robot(rng, 3))
    found = dtc.equilibrium(model)
    assert found.kind in ("stable", "neutral"), found.message
    lowest = float(model.potential_energy(found.q, found.theta))
    for push in 1e-3 * rng.normal(size=(40, model.n_q)):
        assert float(model.potential_energy(found.q + push, found.theta)) > lowest


def test_parallel_springs_leave_three_floppy_modes():
    """At rest, without loads: sideways both ways, and twist to first order."""
    points = [rim(1.0, angle) for angle in np.radians([90.0, 180.0, 270.0])]
    springs = tuple(Spring((1, 2), p, p, 3.0) for p in points)
    robot = Robot((Disc.hoop(1, 1), Disc.hoop(1, 1)), (Thread(1.0),), springs, gravity=0.0)
    found = dtc.equilibrium(dtc.build(robot))
    assert found.success and found.stable and found.kind == "neutral"
    assert found.floppy.shape == (5, 3)
    # Coordinates are thread x, y and disc x, y, z: a parallelogram turns the disc back.
    expected = np.array([[1, 0, -1, 0, 0], [0, 1, 0, -1, 0], [0, 0, 0, 0, 1.0]]).T
    overlap = np.linalg.lstsq(found.floppy, expected, rcond=None)[1]
    assert np.all(overlap < 1e-18)
    # From another pose the search comes to rest too, without running off along them.
    other = dtc.equilibrium(dtc.build(robot), guess=[0.2, -0.1, 0.1, 0.3, -0.4])
    assert other.success and np.max(np.abs(other.q)) < 1.0


@pytest.mark.parametrize("mode", list(Mode))
def test_native_and_twin_take_the_same_steps(mode):
    model = dtc.build(random_robot(np.random.default_rng(3), 3), wrenches=(2, 3))
    search = search_of(model)
    path = LoadPath.constant(np.full(model.n_u, 1.0), np.zeros(model.n_q), model.theta0)
    start = 0.3 * np.random.default_rng(1).normal(size=model.n_q)
    native, twin = (
        each.run(path, start, mode=mode) for each in (search, replace(search, library=None))
    )
    assert native.why is twin.why
    assert (native.iterations, native.recentrings) == (twin.iterations, twin.recentrings)
    np.testing.assert_allclose(native.q, twin.q, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"pressure": [1.0, 2.0]}, "pressure: expected finite numbers of shape (1), got"),
        ({"pressure": np.nan}, "pressure: expected a finite number, got nan"),
        ({"guess": [0.0]}, "guess: expected finite numbers of shape (6), got shape (1,)"),
        ({"tau": "x"}, "tau: expected finite numbers of shape (6), got 'x'"),
        ({"theta": [1.0]}, "theta: expected finite numbers of shape (0), got shape (1,)"),
    ],
)
def test_unusable_arguments(arguments, text):
    with pytest.raises(StaticsError) as error:
        dtc.equilibrium(scene_model(DOWN), **arguments)
    assert str(error.value).startswith(text)


@pytest.mark.parametrize("soft", [1.0, -1.0, 1e-7])
def test_slow_modes_beside_very_fast_ones(soft):
    """A mass on a spring, and a speck stiffly tied to it: 1e18 between the squared frequencies."""
    stiff, speck = 1e6, 1e-12
    K = np.array([[soft + stiff, -stiff], [-stiff, stiff]])
    small = stability(np.diag([1.0, speck]), np.zeros((2, 2)), K)
    # The product of both is soft * stiff / speck, their sum (soft + stiff) + stiff / speck.
    expected = np.array([soft, stiff / speck + stiff])
    # K holds soft + stiff, so to 1e-10 of the stiff one's size.
    assert small.squared_frequencies == pytest.approx(expected, rel=1e-9, abs=2e-10)
    assert small.stable == (soft > 0)
    shapes = small.mode_shapes
    assert shapes.T @ small.M @ shapes == pytest.approx(np.eye(2), abs=1e-6)
