"""The runner: samples late, lost or out of order give what samples in order give."""

import numpy as np
import pytest
from linear_toy import LinearDiscrete

from dtcasadi.errors import EstimationError, LogError
from dtcasadi.logs import Log
from estimators import EKF
from estimators.runner import Runner, track

F = np.array([[1.0, 0.1], [-0.3, 0.9]])


@pytest.fixture(scope="module")
def ekf() -> EKF:
    measured = {
        "place": (np.array([[1.0, 0.0]]), np.zeros((1, 0)), np.array([[0.1]])),
        "rate": (np.array([[0.0, 1.0]]), np.zeros((1, 0)), np.array([[0.2]])),
    }
    toy = LinearDiscrete(F, np.array([[0.0], [0.1]]), np.zeros((2, 0)), measured, np.zeros(0), {})
    return EKF(toy, x0=[1.0, 0.0], P0=[1.0, 1.0], Q_w=[0.01, 0.01])


def in_order(ekf: EKF, samples: list, u: np.ndarray) -> list:
    est, found = ekf.start, []
    for k, command in enumerate(u):
        for step, sensor, y in samples:
            if step == k:
                est = ekf.update(est, [y], sensor, [command])
        found.append(est)
        est = ekf.predict(est, [command])
    return found


def test_late_and_shuffled_samples_end_where_those_in_order_do(ekf, rng):
    n, lag = 40, 5
    u = rng.normal(size=n)
    samples = [(k, "place", rng.normal()) for k in range(0, n - lag, 2)]
    samples += [(k, "rate", rng.normal()) for k in range(1, n - lag, 3)]
    expected = in_order(ekf, samples, u)[-1]
    runner = Runner(ekf, latency_s=lag * 0.1)
    arrivals = [(step + rng.integers(0, lag + 1), step, sensor, y) for step, sensor, y in samples]
    for k in range(n):
        runner.command([u[k]])
        for at, step, sensor, y in rng.permutation(np.array(arrivals, dtype=object)):
            if at == k:
                assert runner.feed(step * 0.1, sensor, [y])
        est = runner.now()
        if k < n - 1:
            runner.advance()
    # The same operations in the same order.
    np.testing.assert_allclose(est.x, expected.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(est.P, expected.P, rtol=0, atol=1e-12)
    assert not runner.refused


def test_a_sample_older_than_the_latency_is_refused_with_its_time(ekf):
    runner = Runner(ekf, latency_s=0.2)
    for _ in range(5):
        runner.advance()
    before = runner.now()
    assert not runner.feed(0.2, "place", [9.0])
    assert runner.refused == [(0.2, "place")]
    np.testing.assert_array_equal(runner.now().x, before.x)
    assert runner.feed(0.3, "place", [9.0]) and not np.array_equal(runner.now().x, before.x)


def test_a_sample_from_the_future_is_an_error(ekf):
    with pytest.raises(EstimationError, match="place: expected a sample up to the present"):
        Runner(ekf).feed(1.0, "place", [0.0])
    with pytest.raises(EstimationError, match="expected a finite time"):
        Runner(ekf).feed(float("nan"), "place", [0.0])


def test_a_log_is_run_row_by_row(ekf, rng):
    n = 20
    u, y = rng.normal(size=n), rng.normal(size=n)
    y[1::2] = np.nan
    log = Log(
        0.1 * np.arange(n),
        {"command1": u, "place.y0": y},
        {"command1": "Pa", "place.y0": ""},
    )
    found = track(ekf, log)
    expected = in_order(ekf, [(k, "place", y[k]) for k in range(0, n, 2)], u)
    for a, b in zip(found.estimates, expected, strict=True):
        np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.u[:, 0], u)


def test_a_gap_too_long_to_run_through_is_named(ekf):
    readings = {"command1": np.zeros(3), "place.y0": np.zeros(3)}
    log = Log(np.array([0.0, 0.1, 2e4]), readings, {"command1": "", "place.y0": ""}, "x.csv")
    line = "x.csv: t: expected rows at most 100000 steps of 0.1 s apart, got none from 0.1 s to 2"
    with pytest.raises(LogError, match=line):
        track(ekf, log)
