"""Hard cases of every filter: re-centring, outlier bursts, gaps, a dead chip, an hour at rest."""

from dataclasses import replace

import numpy as np
import pytest
from at_rest import STEP, Readings, U, filters, planar

import dtcasadi as dtc
from dtcasadi.presets import seed_four_disc
from dtcasadi.robot import Damping
from dtcasadi.sensors import Marker
from estimators import EKF, MHE, UKF, ProcessNoise


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


@pytest.mark.parametrize(
    "kind",
    [EKF, pytest.param(UKF, marks=pytest.mark.slow), pytest.param(MHE, marks=pytest.mark.slow)],
)
def test_it_goes_on_when_the_coordinates_are_recentred(two_discs, kind):
    n = two_discs.model.n_q
    noise = ProcessNoise(state=np.r_[np.zeros(n), np.full(n, 0.1)])
    made = kind(two_discs, x0=np.zeros(2 * n), P0=np.full(2 * n, 0.01), Q_w=noise)
    step, rng, est = two_discs.compiled("step"), np.random.default_rng(0), made.start
    x, theta, u = np.r_[0.1 * np.ones(n), np.zeros(n)], two_discs.theta0, np.array([25.0])
    poses, moved = two_discs.model.poses, 0
    for _ in range(600):
        for name, sensor in two_discs.sensors.items():
            y = sensor.output(x, u, theta).full()[:, 0] + 0.01 * rng.normal(size=3)
            est = made.update(est, y, name, u)
        x = step(x, u, theta)[0]
        x, theta, T = two_discs.recentre(x, theta)
        moved += not np.array_equal(T, np.eye(2 * n))
        est = made.predict(est, u)
        assert not est.failure
        np.linalg.cholesky(est.P)
    assert moved >= 1 and est.recentred >= 1
    for mine, true in zip(poses(est.x[:n], est.theta), poses(x[:n], theta), strict=True):
        # Readings of 0.01 over 600 steps.
        np.testing.assert_allclose(np.array(mine), np.array(true), atol=0.02)


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        *((name, 400) for name in ("ekf", "spv", "ukf", "mhe")),
        *(pytest.param(name, 360_000, marks=pytest.mark.slow) for name in ("ekf", "spv")),
        *(pytest.param(name, 36_000, marks=pytest.mark.slow) for name in ("ukf", "mhe")),
    ],
)
def test_a_robot_at_rest_stays_where_it_is_through_faults(name, steps):
    """An hour, or a tenth of it; with gaps, outlier bursts and a chip that dies half way."""
    made = filters()[name]
    x, n = made.start.x, planar().model.n_q
    est, worst, readings = made.start, 0.0, Readings(x, steps)
    for read in readings:
        for sensor, y in read:
            est = made.update(est, y, sensor, U)
        est = made.predict(est, U)
        assert not est.failure
        worst = max(worst, float(np.max(np.abs(est.x[:n] - x[:n]))))
    assert est.skipped == readings.lost and est.gated >= readings.bursts
    # Of good readings a gate of 1e-6 refuses none in 400 steps, and a few in an hour.
    assert est.gated - readings.bursts <= 1 + steps // 10_000
    assert worst < 6 * float(np.max(np.sqrt(np.diag(made.start.P)[:n]))) + 0.05
    np.linalg.cholesky(est.P)
