"""Hard cases of both: re-centring, outlier bursts, gaps, a dead chip, an hour at rest."""

from dataclasses import replace

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.presets import seed_four_disc
from dtcasadi.robot import Damping
from dtcasadi.sensors import IMU, Marker, PressureSensor
from estimators import EKF, SPV, ProcessNoise, operating_points

STEP = 0.01


@pytest.fixture(scope="module")
def two_discs():
    """Two discs in space, whose only segment re-centres: bent by a couple of gravity and air."""
    robot = seed_four_disc()
    pairs = tuple(s for s in robot.springs if s.discs == (1, 2))
    chamber = replace(robot.chambers[0], discs=(1, 2), areas=None, centroids=None)
    robot = replace(
        robot, discs=(robot.discs[0], robot.discs[-1]), threads=robot.threads[:1],
        springs=pairs, chambers=(chamber,), damping=Damping(c_a=2.0, c_b=2.0, c_w=2.0),
    )  # fmt: skip
    model = dtc.build(robot)
    sensors = (
        Marker(name="tip", disc=2, noise=0.01),
        Marker(name="rim", disc=2, point=(0.5, 1, 0), noise=0.01),
    )
    return model.discrete(STEP, method="ros2", exact=False, sensors=sensors)


def test_it_goes_on_when_the_coordinates_are_recentred(two_discs):
    n = two_discs.model.n_q
    noise = ProcessNoise(state=np.r_[np.zeros(n), np.full(n, 0.1)])
    ekf = EKF(two_discs, x0=np.zeros(2 * n), P0=np.full(2 * n, 0.01), Q_w=noise)
    step, rng, est = two_discs.compiled("step"), np.random.default_rng(0), ekf.start
    x, theta, u = np.r_[0.1 * np.ones(n), np.zeros(n)], two_discs.theta0, np.array([25.0])
    poses, moved = two_discs.model.poses, 0
    for _ in range(600):
        for name, sensor in two_discs.sensors.items():
            y = sensor.output(x, u, theta).full()[:, 0] + 0.01 * rng.normal(size=3)
            est = ekf.update(est, y, name, u)
        x = step(x, u, theta)[0]
        x, theta, T = two_discs.recentre(x, theta)
        moved += not np.array_equal(T, np.eye(2 * n))
        est = ekf.predict(est, u)
        assert not est.failure
        np.linalg.cholesky(est.P)
    assert moved >= 1 and est.recentred >= 1
    for mine, true in zip(poses(est.x[:n], est.theta), poses(x[:n], theta), strict=True):
        # Readings of 0.01 over 600 steps.
        np.testing.assert_allclose(np.array(mine), np.array(true), atol=0.02)


@pytest.fixture(scope="module")
def planar():
    sensors = (
        PressureSensor(name="air", noise=0.05),
        IMU(name="chip", disc=4, noise=0.05),
        Marker(name="tip", disc=4, noise=0.01),
    )
    model = dtc.build(seed_four_disc(), chart="planar")
    return model.discrete(STEP, method="ros2", exact=False, sensors=sensors)


def filters(planar) -> dict:
    """Both, at rest under pressure 5 and exactly there."""
    points = operating_points(planar.model, [4.0], [6.0], n=3)
    n = planar.model.n_q
    given = {"x0": points.x[0, 1], "Q_w": ProcessNoise(state=np.r_[np.zeros(n), np.full(n, 0.1)])}
    return {
        "ekf": EKF(planar, P0=np.full(2 * n, 1e-4), gate=1e-6, **given),
        "spv": SPV(planar, points, gauge="air", gate=1e-6, **given),
    }


@pytest.mark.parametrize("name", ["ekf", "spv"])
@pytest.mark.parametrize("steps", [400, pytest.param(360_000, marks=pytest.mark.slow)])
def test_a_robot_at_rest_stays_where_it_is_through_faults(planar, name, steps):
    """The long one is an hour; with gaps, outlier bursts and a chip that dies half way."""
    made, rng = filters(planar)[name], np.random.default_rng(1)
    x, u, theta, n = made.start.x, np.array([5.0]), planar.theta0, planar.model.n_q
    rest = {k: s.output(x, u, theta).full()[:, 0] for k, s in planar.sensors.items()}
    sigma = {k: np.sqrt(np.diag(s.R_v)) for k, s in planar.sensors.items()}
    est, worst, lost, bursts = made.start, 0.0, 0, 0
    for k in range(steps):
        for sensor, expected in rest.items():
            y = expected + sigma[sensor] * rng.normal(size=len(expected))
            if sensor == "chip" and k >= steps // 2:
                y[:] = np.nan
            if sensor == "tip" and k % 200 >= 190:
                y, bursts = y + 50.0, bursts + 1
            if sensor == "tip" and k % 37 == 0:
                y[1] = np.nan
            lost += int(np.sum(~np.isfinite(y)))
            est = made.update(est, y, sensor, u)
        est = made.predict(est, u)
        assert not est.failure
        worst = max(worst, float(np.max(np.abs(est.x[:n] - x[:n]))))
    assert est.skipped == lost and est.gated >= bursts
    # Of good readings a gate of 1e-6 refuses none in 400 steps, and a few in an hour.
    assert est.gated - bursts <= 1 + steps // 10_000
    assert worst < 6 * float(np.max(np.sqrt(np.diag(made.start.P)[:n]))) + 0.05
    np.linalg.cholesky(est.P)
