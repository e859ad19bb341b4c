"""Equilibria under changing loads, against columns, arches and pendulums with closed forms."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from functools import cache

import numpy as np
import pytest
from moving import DOWN, scene_model
from scipy.optimize import brentq

import dtcasadi as dtc
from dtcasadi.errors import StaticsError
from dtcasadi.robot import Chamber, Damping, Disc, Robot, Spring, Thread

LINK, HALF, STIFF = 0.5, 0.1, 40.0
JOINT = 2 * STIFF * HALF**2  # two parallel springs, off the axis by HALF: c of each joint


def column(masses: list[float], damping: float = 0.0, directions: int = 2) -> Robot:
    """Links on joints with springs, straight along z without weight, pushed by a follower load."""
    discs = [Disc(mass, 1e-9 * np.eye(3), area=1.0) for mass in (1.0, *masses)]
    offsets = HALF * np.array([[0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0]])[:directions]
    n = len(masses)
    return Robot(
        discs,
        (Thread(LINK),) * n,
        [Spring((i, i + 1), p, p, STIFF) for i in range(1, n + 1) for p in offsets],
        (Chamber((1, n + 1)),),
        Damping(c_r=damping),
        gravity=0.0,
    )


def joint_moment(angle: float) -> float:
    """Exact moment of a joint's two springs against a turn."""
    moment = 0.0
    for a in (HALF, -HALF):
        end = np.array(
            [a * np.cos(angle) - LINK * np.sin(angle), a * np.sin(angle) + LINK * np.cos(angle)]
        )
        rate = np.array([-end[1], end[0]])
        gap = end - np.array([a, 0.0])
        length = np.linalg.norm(gap)
        moment += STIFF * (length - LINK) * gap @ rate / length
    return moment


@cache
def hinged(n: int) -> dtc.Model:
    return dtc.build(column([1.0] * n), chart="hinge", wrenches=[n + 1])


DEAD_LOAD = {"wrench": [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]}


@pytest.mark.parametrize("n", [1, 2, 5])
def test_euler_column_of_links(n):
    """Hencky's chain: V = c/2 sum q^2 - P l sum (1 - cos) buckles at 2 c/l (1 - cos(pi/(2n+1)))."""
    critical = 2 * JOINT / LINK * (1 - np.cos(np.pi / (2 * n + 1)))
    straight = dtc.branch(hinged(n), DEAD_LOAD, 0.0, 1.5 * critical, points=20)
    assert straight.success
    assert [event.kind for event in straight.events] == ["bifurcation"]
    event = straight.events[0]
    assert event.s == pytest.approx(critical, rel=1e-9)
    assert straight.stable.tolist() == (straight.s < critical).tolist()
    assert not event.equilibrium.stable or event.equilibrium.kind in ("neutral", "stable")
    # The links' absolute angles in the first mode are sin((2i - 1) pi / (2 (2n + 1)) ...).
    expected = np.sin(np.arange(1, n + 1) * np.pi / (2 * n + 1))
    turned = np.cumsum(event.shapes[:, 0])
    assert turned / turned[-1] == pytest.approx(expected / expected[-1], rel=1e-6)


def test_buckled_column_follows_its_own_branch():
    """One link: P l sin(q) = moment of the springs, on both sides, stable."""
    straight = dtc.branch(hinged(1), DEAD_LOAD, 0.0, 1.5 * JOINT / LINK, points=20)
    for side in (1, -1):
        bent = straight.switch(side=side)
        assert bent.success, bent.message
        angle = np.array([point.q[0] for point in bent.points[1:]])
        assert np.all(np.sign(angle) == side) and np.max(np.abs(angle)) > 0.5
        expected = [joint_moment(q) / (LINK * np.sin(q)) for q in angle]
        np.testing.assert_allclose(bent.s[1:], expected, rtol=1e-9, atol=1e-12)
        assert bent.s[0] == pytest.approx(JOINT / LINK, rel=1e-9)
        assert np.all(bent.stable[1:]) == (joint_moment(0.3) / np.sin(0.3) > JOINT)


def test_column_in_space_buckles_both_ways_at_once():
    """Ball joints, four springs each: twist has no stiffness all the way and disturbs nothing."""
    robot = column([1.0] * 3, directions=4)
    model = dtc.build(robot, chart=["ball", "ball", "rigid"], wrenches=[4])
    critical = 2 * JOINT / LINK * (1 - np.cos(np.pi / 5))
    straight = dtc.branch(model, DEAD_LOAD, 0.0, 1.2 * critical, points=10)
    assert straight.points[0].kind == "neutral" and straight.points[0].floppy.shape == (6, 2)
    assert [(event.kind, event.multiplicity) for event in straight.events] == [("bifurcation", 2)]
    assert straight.events[0].s == pytest.approx(critical, rel=1e-9)
    tips = []
    for shape in (0, 1):
        bent = straight.switch(shape=shape, points=10)
        assert bent.success, bent.message
        tips.append(bent.tips[5, :2])
        assert np.linalg.norm(tips[-1]) > 0.05
    across = abs(tips[0] @ tips[1]) / np.linalg.norm(tips[0]) / np.linalg.norm(tips[1])
    assert across < 1e-3


@pytest.mark.parametrize(
    ("damping", "critical", "rel"),
    # Without damping, Ziegler, Ing.-Archiv 20 (1952) 49; with equal dampers at both joints in the
    # limit of small ones, Herrmann, Jong, J. Appl. Mech. 32 (1965) 592: 1e-4 adds its square.
    [(0.0, 7 / 2 - np.sqrt(2), 1e-6), (1e-4, 41 / 28, 1e-6)],
)
def test_ziegler_column_flutters(damping, critical, rel):
    """Masses 2m and m, a compressive follower load: flutter, without any static bifurcation."""
    model = dtc.build(column([2.0, 1.0], damping), chart="hinge")
    load = critical * JOINT / LINK
    pushed = dtc.branch(model, "pressure", 0.0, -1.5 * load, points=20)
    assert [event.kind for event in pushed.events] == ["flutter"]
    assert -pushed.events[0].s == pytest.approx(load, rel=rel)
    assert pushed.points[-1].kind == "flutter" and np.all(pushed.points[-1].q == 0)


ARM, BASE, REST = 1.0, 1.6, 0.5


@cache
def toggle() -> dtc.Model:
    """A link that a spring to a point on its line holds off that line: it snaps through."""
    end = BASE * np.array([0.0, 0.0, 1.0])
    length = np.sqrt(ARM**2 + BASE**2 - 2 * ARM * BASE * np.cos(REST))
    discs = (Disc(1.0, 0.1 * np.eye(3)),) * 2
    spring = Spring((1, 2), end, [0, 0, 0], 50.0, rest_length=length)
    robot = Robot(discs, (Thread(ARM),), (spring,), damping=Damping(c_r=0.1), gravity=0.0)
    return dtc.build(robot, chart="hinge", wrenches=[2])


def toggle_load(angle: float | np.ndarray) -> np.ndarray:
    """Force along +y on the tip at (-sin, cos) ARM that holds the link at an angle."""
    length = np.sqrt(ARM**2 + BASE**2 - 2 * ARM * BASE * np.cos(angle))
    rest = np.sqrt(ARM**2 + BASE**2 - 2 * ARM * BASE * np.cos(REST))
    return -50.0 * (1 - rest / length) * BASE * np.tan(angle)


def snap() -> tuple[float, float]:
    """Angle and load at the limit point."""
    slope = lambda q: toggle_load(q + 1e-6) - toggle_load(q - 1e-6)  # noqa: E731
    angle = brentq(slope, 0.05, REST, xtol=1e-12)
    return angle, float(toggle_load(angle))


def test_arc_passes_a_snap_through_with_a_known_limit_load():
    angle, limit = snap()
    path = dtc.branch(
        toggle(), "wrench[2]", 0.0, 2 * limit, guess=[REST], back_to=-2 * limit, points=80
    )
    assert path.success, path.message
    assert [event.kind for event in path.events] == ["limit", "limit"]
    first, second = path.events
    # The slope of a difference quotient places the angle to 1e-9; the load is flat there.
    assert first.s == pytest.approx(limit, rel=1e-9)
    assert second.s == pytest.approx(-limit, rel=1e-9)
    assert first.equilibrium.q[0] == pytest.approx(angle, abs=1e-6)
    angles = np.array([point.q[0] for point in path.points])
    np.testing.assert_allclose(path.s, toggle_load(angles), atol=1e-9 * limit)
    assert np.all(np.diff(angles) < 0) and angles[-1] < -REST
    between = np.abs(angles) < angle
    assert path.stable.tolist() == (~between).tolist()
    assert between.sum() >= 5


def test_steps_end_at_the_limit_point_and_say_so():
    angle, limit = snap()
    path = dtc.branch(toggle(), "wrench[2]", 0.0, 2 * limit, guess=[REST], points=40, method="step")
    assert not path.success
    assert path.message.startswith("stopped at s = ") and "method='arc'" in path.message
    # The pose moves as the square root of what is missing: 1e-7 of the step is left.
    assert path.s[-1] == pytest.approx(limit, rel=1e-3) and path.s[-1] <= limit * (1 + 1e-12)
    assert all(point.q[0] > angle - 1e-3 for point in path.points)


def test_branch_without_a_first_point():
    torque = {"tau": [1.0]}
    model = dtc.build(column([1.0]), chart="hinge")
    path = dtc.branch(model, torque, 1e6, 2e6)
    assert not path.success and not path.points and not len(path.s)
    assert path.message.startswith("at s = 1e+06: no equilibrium found")


def test_onset_of_flutter_of_the_paper_s_robot():
    """At the pressure where the largest real part of `ode_jacobian` passes zero."""
    model = scene_model(DOWN)
    path = dtc.branch(model, "pressure", 12.0, 14.0, points=20)
    assert path.success and [event.kind for event in path.events] == ["flutter"]
    found = path.events[0]
    x = np.concatenate([found.equilibrium.q, np.zeros(6)])
    F_x = model.compiled("ode_jacobian")(x, [found.s], model.theta0).F_x
    worst = max(np.linalg.eigvals(F_x), key=lambda value: value.real)
    assert abs(worst.real) < 1e-8 and abs(worst.imag) > 0.05
    assert found.s == pytest.approx(13.8, abs=0.05)


def test_sweep_by_steps_is_a_sequence_of_equilibria():
    model = scene_model(DOWN, chart="cardan")
    path = dtc.branch(model, "pressure", 1.0, 12.0, points=11, method="step")
    np.testing.assert_allclose(path.s, np.arange(1.0, 13.0), rtol=1e-14)
    for s, point in zip(path.s, path.points, strict=True):
        assert point.pressure == pytest.approx([s])
        alone = dtc.equilibrium(model, s)
        np.testing.assert_allclose(point.poses[1], alone.poses[1], atol=1e-10)


def test_parameter_of_the_robot_and_charts_that_recentre():
    """A chain under gravity that turns from straight down to sideways: it hangs along gravity."""
    discs = [Disc(m, 0.01 * np.eye(3)) for m in (1.0, 0.5, 0.3)]
    robot = Robot(discs, (Thread(0.3),) * 2, damping=Damping(0.1, 0.1, 0.1, 0.1), up=[0, 0, -1])
    model = dtc.build(robot, parameters=["up"])
    path = dtc.branch(model, "up[1]", 0.0, -4.0, points=20)
    assert path.success and path.s[-1] == -4.0 and np.all(np.diff(path.s) < 0)
    frames = model.theta_blocks["frames"]
    assert any(np.any(p.theta[frames] != model.theta0[frames]) for p in path.points)
    for s, point in zip(path.s, path.points, strict=True):
        down = np.array([-s, 0, 1]) / np.hypot(s, 1)
        np.testing.assert_allclose(point.poses[1][-1], 0.6 * down, atol=1e-9)
        assert point.thread_tension == pytest.approx(
            np.array([0.8, 0.3]) * 9.81 * np.hypot(s, 1), rel=1e-8
        )


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("presure", 0, 1), "parameter: expected pressure, tau, an entry"),
        (("pressure[2]", 0, 1), "parameter: pressure: expected an integer from 1 to 1, got 2"),
        (("pressure", 0, 0), "stop: expected a value other than start, got 0"),
        (("pressure", 0, np.inf), "stop: expected a finite number, got inf"),
        (({"tau": [1.0]}, 0, 1), "tau: expected finite numbers of shape (6), got shape (1,)"),
        (({}, 0, 1), "parameter: expected a name, or changes by name, got {}"),
        ((3, 0, 1), "parameter: expected a name, or changes by name, got 3"),
    ],
)
def test_unusable_arguments(arguments, text):
    with pytest.raises(StaticsError) as error:
        dtc.branch(scene_model(DOWN), *arguments)
    assert str(error.value).startswith(text)


def test_switch_where_there_is_no_bifurcation():
    path = dtc.branch(scene_model(DOWN), "pressure", 1.0, 2.0, points=2)
    with pytest.raises(StaticsError, match="event: expected a bifurcation"):
        path.switch()
