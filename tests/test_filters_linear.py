"""EKF, UKF and MHE on a linear toy: each is the Kalman filter, and takes the same faults."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from faults import faulty
from kalman import N_U, Kalman, N, covariance, toy_plant
from linear_toy import LinearDiscrete

from estimators import EKF, MHE, UKF, ProcessNoise
from estimators.runner import Filter
from estimators.ukf import serial

Make = Callable[..., Filter]
ALL: dict[str, Make] = {
    "ekf": EKF,
    "ukf": partial(UKF, many=serial),
    "mhe": partial(MHE, window=5),
}
# A window that slides for most of the run, and one that never is full.
KINDS = ALL | {
    "ukf, near": partial(UKF, many=serial, distance=0.5),
    "ukf, cautious": partial(UKF, many=serial, caution=2),
    "mhe, long": partial(MHE, window=80),
    "mhe, twice": partial(MHE, window=5, iterations=2),
    "mhe, cautious": partial(MHE, window=5, caution=2),
}


@pytest.fixture(scope="module")
def toy() -> LinearDiscrete:
    return toy_plant()


@pytest.fixture(params=ALL)
def make(request: pytest.FixtureRequest) -> Make:
    return ALL[request.param]


@pytest.mark.parametrize("machine", ["compiled", "virtual"])
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_the_kalman_filter_on_a_linear_model(toy, rng, kind, machine, monkeypatch):
    if machine == "virtual":
        for module in ("ekf", "mhe", "clouds", "ukf"):
            monkeypatch.setattr(f"estimators.{module}.twin", lambda plain, source=None: plain)
    Q, P0, x0 = covariance(rng, N + 2), covariance(rng, N + 2), rng.normal(size=N)
    made = KINDS[kind](toy, x0=x0, P0=P0, Q_w=Q, augment=("mass",))
    plain, est = Kalman(toy, Q), made.start
    z, P = np.concatenate([x0, toy.theta0[2:]]), P0
    for k in range(50):
        u = rng.normal(size=N_U)
        est = made.predict(est, u)
        z, P = plain.predict(z, P, u)
        names = (["pair"], ["one"], ["pair", "one"])[k % 3]
        y = rng.normal(size=sum(len(toy.measured[name][0]) for name in names))
        if k % 5 == 0:
            y[0] = np.nan
        est = made.update(est, y, names, u)
        z, P, nis = plain.update(z, P, y, names)
        # 1e-10 of values of order 1: fifty steps of round-off in two formulas.
        np.testing.assert_allclose(np.concatenate([est.x, est.theta[2:]]), z, rtol=0, atol=1e-10)
        np.testing.assert_allclose(est.P, P, rtol=0, atol=1e-10)
        assert abs(est.nis - nis) < 1e-9 * max(1, nis)
    assert est.skipped == 10 and not est.failure


def test_a_second_reading_at_the_same_instant_counts_as_well(toy, rng, make):
    Q, P0, u = covariance(rng, N), covariance(rng, N), np.zeros(N_U)
    made, plain = make(toy, x0=np.zeros(N), P0=P0, Q_w=Q), Kalman(toy, np.zeros((N + 2, N + 2)))
    plain.Q[:N, :N] = Q
    est, z, P = made.start, np.r_[np.zeros(N), toy.theta0[2:]], np.zeros((N + 2, N + 2))
    P[:N, :N] = P0
    for _ in range(8):
        for name in ("pair", "one", "pair", "pair"):
            y = rng.normal(size=len(toy.measured[name][0]))
            est = made.update(est, y, name, u)
            z, P, _ = plain.update(z, P, y, [name])
        np.testing.assert_allclose(est.x, z[:N], rtol=0, atol=1e-10)
        est = made.predict(est, u)
        z, P = plain.predict(z, P, u)


def test_noise_of_forces_enters_as_a_push_held_over_the_step(toy, make):
    # The toy's block `wrench` has the size of a whole one only in this copy.
    seen = {"one": (np.ones((1, N)), np.zeros((1, 6)), np.eye(1))}
    six = LinearDiscrete(
        toy.F, toy.G, np.ones((N, 6)) * np.arange(6), seen, np.zeros(6), {"wrench": slice(0, 6)}
    )
    noise = ProcessNoise(force=2.0, state=0.5, walk={"wrench": [1, 2, 3, 4, 5, 6]})
    made = make(six, x0=np.zeros(N), P0=np.zeros(N), Q_w=noise, augment=("wrench",))
    P = made.predict(made.start, np.zeros(N_U)).P
    h, G = six.step_s, six.B[:, :3]
    np.testing.assert_allclose(P[:N, :N], 4 / h * G @ G.T + 0.25 * h * np.eye(N), rtol=1e-13)
    np.testing.assert_allclose(np.diag(P)[N:], h * np.arange(1, 7) ** 2, rtol=1e-13)


def test_a_measurement_with_no_number_changes_nothing(toy, rng, make):
    made = make(toy, x0=np.zeros(N), P0=covariance(rng, N), Q_w=np.ones(N))
    for bad in (np.nan, np.inf, -np.inf):
        est = made.update(made.start, np.full(3, bad), "pair", np.zeros(N_U))
        np.testing.assert_array_equal(est.x, made.start.x)
        np.testing.assert_allclose(est.P, made.start.P, rtol=1e-13, atol=1e-13)
        assert est.skipped == 3 and est.used == 0 and est.nis == 0


def test_the_gate_refuses_an_outlier_and_counts_it(toy, make):
    made = make(toy, x0=np.zeros(N), P0=np.full(N, 0.01), Q_w=np.ones(N), gate=1e-4)
    u = np.zeros(N_U)
    expected = toy.measured["pair"][1] @ toy.theta0
    far = made.update(made.start, expected + 100.0, "pair", u)
    assert far.gated == 1 and not far.believed
    np.testing.assert_array_equal(far.x, made.start.x)
    np.testing.assert_array_equal(far.P, made.start.P)
    near = made.update(far, expected, "pair", u)
    assert near.gated == 1 and near.believed and np.trace(near.P) < np.trace(far.P)


def steady(made: Any, rng: np.random.Generator, steps: int) -> None:
    est = made.start
    for k in range(steps):
        est = made.predict(est, rng.normal(size=N_U))
        for _ in range(0 if rng.random() < 0.1 else 2 if rng.random() < 0.1 else 1):
            est = made.update(est, faulty(rng, 3), "pair", np.zeros(N_U))
        if k % 100 == 0:
            np.testing.assert_allclose(est.P, est.P.T, rtol=1e-12)
            np.linalg.cholesky(est.P)
        assert not est.failure and np.all(np.isfinite(est.x))


@pytest.mark.parametrize(
    ("kind", "steps"),
    [
        ("ekf", 3000),
        ("ukf", 300),
        ("mhe", 300),
        pytest.param("ekf", 1_000_000, marks=pytest.mark.slow),
        pytest.param("ukf", 100_000, marks=pytest.mark.slow),
        pytest.param("mhe", 100_000, marks=pytest.mark.slow),
    ],
)
def test_the_covariance_stays_positive_definite_through_faults(toy, rng, kind, steps):
    vague, sure = np.full(N + 2, 1e8), np.full(N + 2, 1e-12)
    steady(ALL[kind](toy, x0=np.zeros(N), P0=vague, Q_w=sure, augment=("mass",)), rng, steps)


def test_a_step_that_is_not_finite_says_so_and_keeps_the_estimate(toy, make):
    made = make(toy, x0=np.zeros(N), P0=np.ones(N), Q_w=np.ones(N))
    est = made.predict(made.start, np.array([np.nan, 0.0]))
    assert "did not converge" in est.failure and est.failed == 1
    assert est.x is made.start.x and est.P is made.start.P
    assert not made.predict(est, np.zeros(N_U)).failure
