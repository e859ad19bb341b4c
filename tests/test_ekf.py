"""The extended Kalman filter on a linear toy: the Kalman filter, faults, and its arguments."""

import numpy as np
import pytest
from faults import faulty
from kalman import N_U, Kalman, N, covariance, toy_plant
from linear_toy import LinearDiscrete

from dtcasadi.errors import EstimationError
from estimators import EKF, ProcessNoise


@pytest.fixture(scope="module")
def toy() -> LinearDiscrete:
    return toy_plant()


@pytest.mark.parametrize("machine", ["compiled", "virtual"])
def test_it_is_the_kalman_filter_on_a_linear_model(toy, rng, machine, monkeypatch):
    if machine == "virtual":
        monkeypatch.setattr("estimators.ekf.twin", lambda plain, source: plain)
    Q, P0 = covariance(rng, N + 2), covariance(rng, N + 2)
    x0 = rng.normal(size=N)
    ekf = EKF(toy, x0=x0, P0=P0, Q_w=Q, augment=("mass",))
    plain, est = Kalman(toy, Q), ekf.start
    z, P = np.concatenate([x0, toy.theta0[2:]]), P0
    for k in range(50):
        u = rng.normal(size=N_U)
        est = ekf.predict(est, u)
        z, P = plain.predict(z, P, u)
        names = (["pair"], ["one"], ["pair", "one"])[k % 3]
        y = rng.normal(size=sum(len(toy.measured[name][0]) for name in names))
        if k % 5 == 0:
            y[0] = np.nan
        est = ekf.update(est, y, names, u)
        z, P, nis = plain.update(z, P, y, names)
        # 1e-10 of values of order 1: fifty steps of round-off in two formulas.
        np.testing.assert_allclose(np.concatenate([est.x, est.theta[2:]]), z, rtol=0, atol=1e-10)
        np.testing.assert_allclose(est.P, P, rtol=0, atol=1e-10)
        assert abs(est.nis - nis) < 1e-9 * max(1, nis)
    assert est.skipped == 10 and not est.failure


def test_more_iterations_change_nothing_on_a_linear_model(toy, rng):
    Q, P0, x0 = np.eye(N), covariance(rng, N), rng.normal(size=N)
    one, three = (EKF(toy, x0=x0, P0=P0, Q_w=Q, iterations=k) for k in (1, 3))
    y, u = rng.normal(size=3), np.zeros(N_U)
    a, b = (ekf.update(ekf.start, y, "pair", u) for ekf in (one, three))
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(a.P, b.P, rtol=0, atol=1e-12)


def test_noise_of_forces_enters_as_a_push_held_over_the_step(toy):
    # The toy's block `wrench` has the size of a whole one only in this copy.
    six = LinearDiscrete(
        toy.F, toy.G, np.ones((N, 6)) * np.arange(6), {}, np.zeros(6), {"wrench": slice(0, 6)}
    )
    noise = ProcessNoise(force=2.0, state=0.5, walk={"wrench": [1, 2, 3, 4, 5, 6]})
    ekf = EKF(six, x0=np.zeros(N), P0=np.zeros(N), Q_w=noise, augment=("wrench",))
    P = ekf.predict(ekf.start, np.zeros(N_U)).P
    h, G = six.step_s, six.B[:, :3]
    np.testing.assert_allclose(P[:N, :N], 4 / h * G @ G.T + 0.25 * h * np.eye(N), rtol=1e-13)
    np.testing.assert_allclose(np.diag(P)[N:], h * np.arange(1, 7) ** 2, rtol=1e-13)


def test_a_measurement_with_no_number_changes_nothing(toy, rng):
    ekf = EKF(toy, x0=np.zeros(N), P0=covariance(rng, N), Q_w=np.ones(N))
    for bad in (np.nan, np.inf, -np.inf):
        est = ekf.update(ekf.start, np.full(3, bad), "pair", np.zeros(N_U))
        np.testing.assert_array_equal(est.x, ekf.start.x)
        np.testing.assert_allclose(est.P, ekf.start.P, rtol=1e-13, atol=1e-13)
        assert est.skipped == 3 and est.used == 0 and est.nis == 0


def test_the_gate_refuses_an_outlier_and_counts_it(toy, rng):
    ekf = EKF(toy, x0=np.zeros(N), P0=np.full(N, 0.01), Q_w=np.ones(N), gate=1e-4)
    u = np.zeros(N_U)
    expected = toy.measured["pair"][1] @ toy.theta0
    far = ekf.update(ekf.start, expected + 100.0, "pair", u)
    assert far.gated == 1 and not far.believed
    np.testing.assert_array_equal(far.x, ekf.start.x)
    np.testing.assert_array_equal(far.P, ekf.start.P)
    near = ekf.update(far, expected, "pair", u)
    assert near.gated == 1 and near.believed and np.trace(near.P) < np.trace(far.P)


def steady(toy: LinearDiscrete, rng: np.random.Generator, steps: int) -> None:
    ekf = EKF(
        toy, x0=np.zeros(N), P0=np.full(N + 2, 1e8), Q_w=np.full(N + 2, 1e-12), augment=("mass",)
    )
    est = ekf.start
    for k in range(steps):
        est = ekf.predict(est, rng.normal(size=N_U))
        for _ in range(0 if rng.random() < 0.1 else 2 if rng.random() < 0.1 else 1):
            est = ekf.update(est, faulty(rng, 3), "pair", np.zeros(N_U))
        if k % 100 == 0:
            assert np.array_equal(est.P, est.P.T)
            np.linalg.cholesky(est.P)
    assert not est.failure and np.all(np.isfinite(est.x))


def test_the_covariance_stays_positive_definite_through_faults(toy, rng):
    steady(toy, rng, 3000)


@pytest.mark.slow
def test_the_covariance_stays_positive_definite_for_a_million_steps(toy, rng):
    steady(toy, rng, 1_000_000)


def test_a_step_that_is_not_finite_says_so_and_keeps_the_estimate(toy):
    ekf = EKF(toy, x0=np.zeros(N), P0=np.ones(N), Q_w=np.ones(N))
    est = ekf.predict(ekf.start, np.array([np.nan, 0.0]))
    assert "did not converge" in est.failure and est.x is ekf.start.x and est.P is ekf.start.P
    assert not ekf.predict(est, np.zeros(N_U)).failure


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"x0": np.zeros(3)}, r"x0: expected finite numbers of shape \(5\), got shape \(3,\)"),
        ({"P0": -np.ones(N)}, "P0: expected a positive semidefinite matrix"),
        ({"P0": np.triu(np.ones((N, N)))}, "P0: expected a symmetric matrix"),
        ({"Q_w": ProcessNoise(walk={"mass": 1.0})}, "Q_w.walk: expected blocks named in augment"),
        ({"augment": ("mas",)}, "augment: expected names out of wrench, mass, got 'mas'"),
        ({"augment": "mass"}, "augment: expected a list of different names"),
        ({"gate": 2.0}, "gate: expected a chance between 0 and 1"),
        ({"iterations": 0}, "iterations: expected an integer from 1 to 20"),
    ],
)
def test_wrong_arguments_are_named(toy, change, line):
    good = {"x0": np.zeros(N), "P0": np.ones(N), "Q_w": np.ones(N)}
    with pytest.raises(EstimationError, match=line):
        EKF(toy, **{**good, **change})
