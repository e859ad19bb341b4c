"""Empirical Gramians against the linear one, and sets of sensors whose answer is known."""

import numpy as np
import pytest
from kalman import N_U, N, toy_plant
from linear_toy import LinearDiscrete

import dtcasadi as dtc
from dtcasadi.errors import EstimationError
from dtcasadi.sensors import IMU, Coordinates, Marker, PressureSensor
from estimators.observability import Motion, gramians
from estimators.sensor_sets import adding_nothing, every_set, judged, smallest
from estimators.ukf import serial


def still(discrete, x0: np.ndarray, u: np.ndarray, n: int) -> Motion:
    """The motion from x0 under a constant command."""
    theta, rows = discrete.theta0, [x0]
    for _ in range(n):
        rows.append(np.array(discrete.step(rows[-1], u, theta)[0]).ravel())
    return Motion(np.array(rows), np.tile(theta, (n + 1, 1)), np.tile(u, (n + 1, 1)))


def test_it_is_the_textbooks_gramian_on_a_linear_model():
    """sum (H F^k)^T R^-1 H F^k over the window, theta's entries as states that stay."""
    toy = toy_plant()
    P0 = np.r_[np.linspace(0.5, 2.0, N), 0.3, 0.0]
    motion = still(toy, np.ones(N), np.ones(N_U), 12)
    found = gramians(toy, motion, P0=P0, augment=("mass",), windows=2, many=serial)
    F = np.block([[toy.F, toy.B[:, 2:]], [np.zeros((2, N)), np.eye(2)]])
    scale = np.sqrt(P0)
    for name, (H_x, H_theta, R) in toy.measured.items():
        H, W, power = np.hstack([H_x, H_theta[:, 2:]]), 0.0, np.eye(N + 2)
        for _ in range(6):
            W = W + (H @ power).T @ np.linalg.solve(R, H @ power)
            power = F @ power
        expected = (scale[:, None] * W * scale)[:-1, :-1]  # the last is known exactly
        for part in found.parts[name]:
            np.testing.assert_allclose(part, expected, rtol=1e-9, atol=1e-9 * expected.max())
    assert found.names[-1] == "mass[1]" and found.starts == (0, 6) and found.steps == 6


def test_figures_of_a_set_follow_from_its_gramian():
    toy = LinearDiscrete(
        np.eye(2),
        np.zeros((2, 1)),
        np.zeros((2, 0)),
        {
            "a": (np.array([[2.0, 0.0]]), np.zeros((1, 0)), np.eye(1)),
            "b": (np.array([[0.0, 0.5]]), np.zeros((1, 0)), np.eye(1)),
            "a_again": (np.array([[1e-3, 0.0]]), np.zeros((1, 0)), np.eye(1)),
        },
        np.zeros(0),
        {},
    )
    motion = still(toy, np.zeros(2), np.zeros(1), 4)
    found = gramians(toy, motion, P0=[1.0, 1.0], windows=1, many=serial)
    alone, both = judged(found, ("a",)), judged(found, ("a", "b"))
    assert alone.least == 0 and alone.condition == np.inf and alone.directions == (("x1",),)
    # Four samples: information 4 * 2^2 and 4 * 0.5^2.
    assert both.least == pytest.approx(1.0) and both.condition == pytest.approx(16.0)
    assert both.left == pytest.approx([17**-0.5, 2**-0.5])
    assert both.bits == pytest.approx((np.log2(17) + 1) / 2)
    sets = every_set(found, 1.01)
    best = smallest(sets, 1.01)
    assert best is not None and best.sensors == ("a", "b") and smallest(sets, 0.5) is None
    assert adding_nothing(sets) == ("a_again",) and len(sets) == 7


def robot(*, springs: bool) -> dtc.Robot:
    disc = dtc.Disc.hoop(1.0, 0.2)
    points = [dtc.presets.rim(0.2, angle) for angle in (np.pi / 2, np.pi, 3 * np.pi / 2)]
    posts = tuple(dtc.Spring((1, 2), p, p, stiffness=100.0, damping=2.0) for p in points)
    chambers = (dtc.Chamber((1, 2)),)
    up = np.array([0.0, 0.0, -1.0])
    return dtc.Robot((disc, disc), (dtc.Thread(0.5),), posts if springs else (), chambers, up=up)


def test_a_gyroscope_alone_does_not_see_yaw():
    """A disc on a thread, hanging free: nothing but the turn about the vertical leaves its rates.

    With the coordinates read as well all is seen.
    """
    gyroscope = IMU(name="gyro", disc=2, noise=[0.01] * 3 + [1e6] * 3)
    angles = Coordinates(name="angles", noise=0.01)
    bob = dtc.Disc(1.0, np.diag([0.02, 0.03, 0.01]), centre_of_mass=[0.0, 0.0, 0.2])
    hung = dtc.Robot((bob, bob), (dtc.Thread(0.5),), up=np.array([0.0, 0.0, -1.0]))
    model = dtc.build(hung, chart="cardan")
    discrete = model.discrete(0.02, method="rk4", sensors=(gyroscope, angles))
    n = model.n_q
    x0 = np.r_[0.2, 0.1, 0.2, -0.1, 0.0, np.zeros(n)]
    P0 = np.r_[np.full(n, 0.01), np.full(n, 0.25)]
    motion = still(discrete, x0, np.zeros(0), 50)
    # The direction bends with the coordinates: steps off it are wrong by their square.
    found = gramians(discrete, motion, P0=P0, windows=1, distance=1e-3, many=serial)
    seen, both = judged(found, ("gyro",)), judged(found, ("gyro", "angles"))
    # Turning everything about the vertical: near a straight pose the disc's last angle.
    assert seen.directions[0] == ("disc_z_1",), seen.directions
    assert seen.least < 1e-6 and seen.condition > 1e8
    assert both.sees_all(1.0) and not both.directions


def test_one_inertial_sensor_suffices_in_the_plane_and_a_gauge_adds_nothing():
    """Springs and gravity tie all angles to accelerations; the pressure is the command."""
    sensors = (
        IMU(name="chip", disc=2, noise=0.02),
        PressureSensor(name="gauge", noise=10.0),
        Marker(name="camera", disc=2, noise=0.01),
    )
    model = dtc.build(robot(springs=True), chart="planar")
    discrete = model.discrete(0.02, method="rk4", sensors=sensors)
    n = model.n_q
    motion = still(discrete, np.r_[0.1, 0.2, np.zeros(n)], np.array([5.0]), 60)
    P0 = np.r_[np.full(n, 0.01), np.full(n, 0.25)]
    found = gramians(discrete, motion, P0=P0, windows=2, many=serial)
    sets = every_set(found)
    best = smallest(sets)
    assert best is not None and best.sensors == ("chip",)
    assert np.all(found.parts["gauge"] == 0) and adding_nothing(sets) == ("gauge",)


def test_arguments_that_cannot_be_used_are_named():
    toy = toy_plant()
    motion = still(toy, np.ones(N), np.ones(N_U), 4)
    with pytest.raises(EstimationError, match="windows: expected an integer from 1 to 4, got 5"):
        gramians(toy, motion, P0=np.ones(N), windows=5, many=serial)
    with pytest.raises(EstimationError, match="P0: expected variances that are not all zero"):
        gramians(toy, motion, P0=np.zeros(N), many=serial)
    fast = Motion(motion.x * 1e200, motion.theta, motion.u)
    with pytest.raises(EstimationError, match="a run beside the motion is not finite in step 0"):
        gramians(toy, fast, P0=np.ones(N), many=serial)
