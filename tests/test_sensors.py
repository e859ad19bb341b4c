"""Sensors: readings against the model's other Functions, derivatives against differences."""

from itertools import pairwise

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.errors import ModelError
from dtcasadi.presets import rim, seed_four_disc
from dtcasadi.sensors import IMU, Lengths, Marker, Orientation, PressureSensor

CHIP = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
PLACE, POINT = np.array([0.1, 0.7, -0.2]), np.array([0.0, 2.0, 0.3])
SPANS = (((1, rim(1.0, np.pi)), (3, rim(1.0, 1.0))), ((2, np.zeros(3)), (4, np.zeros(3))))
SENSORS = (
    PressureSensor(name="air", noise=0.1),
    IMU(name="chip", disc=4, position=PLACE, orientation=CHIP, noise=0.01, biases=True),
    Marker(name="tip", disc=4, point=POINT, noise=1e-3),
    Orientation(name="pose", disc=3, noise=0.02),
    Lengths(name="strings", spans=SPANS, noise=1e-3),
)


@pytest.fixture(scope="module")
def model() -> dtc.Model:
    return dtc.build(seed_four_disc(), actuator="regulator", wrenches=(4,))


@pytest.fixture(scope="module")
def discrete(model):
    return model.discrete(0.01, method="ros1", exact=False, sensors=SENSORS)


@pytest.fixture
def point(model, discrete, rng):
    theta = discrete.theta0.copy()
    theta[discrete.theta_blocks["wrench"]] = rng.normal(size=6)
    theta[discrete.theta_blocks["chip.bias"]] = rng.normal(size=6)
    return 0.4 * rng.normal(size=model.n_x), np.array([9.0]), theta


def read(discrete, name, x, u, theta):
    return discrete.sensors[name].output(x, u, theta).full()[:, 0]


@pytest.mark.parametrize("name", [sensor.name for sensor in SENSORS])
def test_derivatives_are_those_of_the_readings(discrete, point, name):
    x, u, theta = point
    _, H_x, H_theta = (part.full() for part in discrete.sensors[name].linearize(x, u, theta))
    frames = discrete.theta_blocks["frames"]
    for H, k, value in ((H_x, 0, x), (H_theta, 2, theta)):
        for j in range(len(value)):
            if k == 2 and j < frames.stop:
                assert not H[:, j].any()
                continue
            arguments, step = [x, u, theta], np.zeros(len(value))
            step[j] = 1e-6
            ends = []
            for sign in (1, -1):
                arguments[k] = value + sign * step
                ends.append(read(discrete, name, *arguments))
            difference = (ends[0] - ends[1]) / 2e-6
            # Central differences at 1e-6: round-off 1e-10 of readings of up to 1e3.
            np.testing.assert_allclose(H[:, j], difference, rtol=2e-6, atol=2e-6)


def test_marker_orientation_and_lengths_follow_the_poses(model, discrete, point):
    x, u, theta = point
    R, r = (part.full() for part in model.poses(x[: model.n_q], theta[: len(model.theta0)]))
    turn = [R[:, 3 * i : 3 * i + 3] for i in range(4)]
    np.testing.assert_allclose(read(discrete, "tip", *point), r[:, 3] + turn[3] @ POINT, atol=1e-13)
    pose = read(discrete, "pose", *point).reshape(3, 3, order="F")
    np.testing.assert_allclose(pose, turn[2], atol=1e-13)
    expected = [
        np.linalg.norm(r[:, b - 1] + turn[b - 1] @ pb - r[:, a - 1] - turn[a - 1] @ pa)
        for (a, pa), (b, pb) in SPANS
    ]
    np.testing.assert_allclose(read(discrete, "strings", *point), expected, rtol=1e-13)
    assert read(discrete, "air", *point) == x[-1]


def test_an_imu_feels_what_the_path_of_its_chip_says(model, discrete, point):
    # Rotation and place of the chip along the motion, differentiated twice by differences.
    x, u, theta = point
    own = theta[: len(model.theta0)]
    n, h = model.n_q, 2e-4
    ode = model.ode

    def at(t):
        # The motion near t = 0 to third order: q + qd t + qdd t^2 / 2 + the slope of qdd t^3 / 6.
        xdot = ode(x, u, own).full()[:, 0]
        eps = 1e-6
        jerk = (ode(x + eps * xdot, u, own) - ode(x - eps * xdot, u, own)).full()[:, 0] / 2 / eps
        q = x[:n] + x[n : 2 * n] * t + xdot[n : 2 * n] * t**2 / 2 + jerk[n : 2 * n] * t**3 / 6
        R, r = (part.full() for part in model.poses(q, own))
        R = R[:, 9:]
        return R, r[:, 3] + R @ PLACE

    poses = [at(k * h) for k in (-2, -1, 0, 1, 2)]
    R = poses[2][0]
    # Fourth-order central differences.
    rate = sum(w * p[0] for w, p in zip((1, -8, 0, 8, -1), poses, strict=True)) / (12 * h)
    acc = sum(w * p[1] for w, p in zip((-1, 16, -30, 16, -1), poses, strict=True)) / (12 * h * h)
    spin = R.T @ rate
    w = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    felt = acc + model.robot.gravity * model.robot.up
    expected = np.concatenate([CHIP.T @ w, CHIP.T @ R.T @ felt])
    expected += theta[discrete.theta_blocks["chip.bias"]]
    # Differences: h^4 times sixth derivatives of up to 1e8 / 90, round-off 1e-15 / h^2.
    np.testing.assert_allclose(read(discrete, "chip", *point), expected, rtol=1e-5, atol=1e-5)


def test_an_imu_at_rest_feels_gravity_upwards():
    robot = dtc.Robot(
        (dtc.Disc.hoop(1.0, 1.0),) * 2, (dtc.Thread(1.0),), up=np.array([0.0, 0.0, -1.0])
    )
    model = dtc.build(robot, chart="ball")
    discrete = model.discrete(0.01, sensors=(IMU(name="root", disc=1, noise=1.0),))
    y = read(discrete, "root", np.zeros(model.n_x), np.zeros(0), discrete.theta0)
    np.testing.assert_allclose(y, [0, 0, 0, 0, 0, -robot.gravity], atol=1e-14)


def test_sensors_read_together_read_the_same(discrete, point):
    names = ("chip", "tip", "air")
    together = discrete.together(names).linearize(*point)
    alone = [discrete.sensors[name].linearize(*point) for name in names]
    for k in range(3):
        stacked = np.vstack([part[k].full() for part in alone])
        np.testing.assert_allclose(together[k].full(), stacked, rtol=1e-13, atol=1e-12)
    assert discrete.together(names).channels[6] == ("tip.x", "m")


def test_biases_leave_the_step_and_recentring_alone(model, discrete, point):
    x, u, theta = point
    own = theta[: len(model.theta0)]
    plain = model.discrete(0.01, method="ros1", exact=False)
    for name in ("step", "linearize"):
        mine, theirs = getattr(discrete, name)(*point), getattr(plain, name)(x, u, own)
        np.testing.assert_array_equal(mine[0].full(), theirs[0].full())
    assert not discrete.linearize(*point)[3].full()[:, discrete.theta_blocks["chip.bias"]].any()
    x = x.copy()
    x[1] = 1.0
    _, new, _ = discrete.recentre(x, theta)
    np.testing.assert_array_equal(new[len(own) :], theta[len(own) :])
    assert not np.array_equal(new[: len(own)], own)


def test_lengths_have_a_slope_where_a_span_closes():
    # A span between one and the same point of a disc has length zero.
    at = np.zeros(3)
    spans = (((2, at), (2, at)),)
    model = dtc.build(seed_four_disc(), chart="hinge")
    discrete = model.discrete(
        0.01, method="euler", sensors=(Lengths(name="none", spans=spans, noise=1.0),)
    )
    parts = discrete.sensors["none"].linearize(np.zeros(model.n_x), [0.0], discrete.theta0)
    assert all(np.isfinite(part.full()).all() for part in parts)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: Marker(name="Tip", disc=2, noise=1.0), "sensor 'Tip': name: expected lower-case"),
        (lambda: Marker(name="t", disc=2, noise=0.0), "noise: expected a finite positive number"),
        (lambda: Marker(name="t", disc=2, noise=[1, 2]), "noise: expected finite numbers of shape"),
        (lambda: Marker(name="t", disc=2, noise=1, dropout=1), "dropout: expected a share below 1"),
        (lambda: Marker(name="t", disc=2, noise=1, period_s=0), "period_s: expected a finite pos"),
        (
            lambda: IMU(name="t", disc=2, noise=1, orientation=2 * CHIP),
            "orientation: expected a rot",
        ),
        (lambda: Lengths(name="t", noise=1, spans=(1,)), "spans: expected"),
    ],
)
def test_wrong_fields_are_named(make, line):
    with pytest.raises(ModelError, match=line.replace("(", r"\(")):
        make()


@pytest.mark.parametrize(
    ("sensors", "line"),
    [
        ((Marker(name="a", disc=9, noise=1),), "disc: expected an integer from 1 to 4, got 9"),
        ((Marker(name="a", disc=2, noise=1),) * 2, "expected different names, got 'a' twice"),
        (("tip",), "expected values of dtcasadi.sensors"),
        (
            (PressureSensor(name="a", chambers=(2,), noise=1),),
            "chambers: expected an integer from 1 to 1",
        ),
    ],
)
def test_sensors_that_a_model_cannot_have(sensors, line):
    with pytest.raises(ModelError, match=line):
        dtc.build(seed_four_disc(), chart="hinge").discrete(0.01, sensors=sensors)


def test_names_are_the_ones_given(discrete):
    assert list(discrete.sensors) == [sensor.name for sensor in SENSORS]
    with pytest.raises(ModelError, match="sensor: expected one of air, chip"):
        discrete.together(["chip", "nose"])
    units = [unit for _, unit in discrete.sensors["chip"].channels]
    assert all(a == b for a, b in pairwise(units[:3])) and units[3:] == ["m/s^2"] * 3
