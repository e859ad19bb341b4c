"""The unscented filter: the Kalman filter on a linear model, its points, faults, re-centring."""

import numpy as np
import pytest
from c_compilers import needs_compiler
from hanging import Still, hanging
from kalman import N_U, N, covariance, toy_plant
from linear_toy import LinearDiscrete

from dtcasadi.errors import EstimationError
from estimators import UKF, ProcessNoise
from estimators.clouds import reading_cloud, step_cloud
from estimators.sigma import root_of, spread_out
from estimators.ukf import serial

pytestmark = [
    pytest.mark.filterwarnings("ignore::dtcasadi.compile.NoCompilerWarning"),
    pytest.mark.filterwarnings("ignore::dtcasadi.batch.OneByOneWarning"),
]


@pytest.fixture(scope="module")
def toy() -> LinearDiscrete:
    return toy_plant()


@pytest.mark.parametrize("machine", [pytest.param("compiled", marks=needs_compiler), "virtual"])
def test_the_transform_is_the_weighted_sums_of_the_textbook(rng, machine, monkeypatch):
    """Mean, covariance and update with the scaled weights, of points through a curved function."""
    if machine == "virtual":
        monkeypatch.setattr("estimators.clouds.twin", lambda plain, source=None: plain)
    n, h, Q, R = 4, 1.3, covariance(rng, 4), covariance(rng, 4)
    root, centre = np.linalg.cholesky(covariance(rng, n)), rng.normal(size=n)
    points = spread_out(centre, root, h)
    images = np.vstack([np.sin(points[:2]), points[2:] ** 2 * points[0]])
    alpha2 = h**2 / n
    w_mean, w_cov = np.full(2 * n + 1, 0.5 / h**2), np.full(2 * n + 1, 0.5 / h**2)
    w_mean[0] = 1 - n / h**2
    w_cov[0] = w_mean[0] + 1 - alpha2 + 2
    mean = images @ w_mean
    off = images - mean[:, None]
    spread = (off * w_cov) @ off.T
    clouds = step_cloud(n, n), reading_cloud(n, n, 4)
    assert all(each.function.is_a("External") == (machine == "compiled") for each in clouds)
    found = clouds[0](images.T, h, Q)
    np.testing.assert_allclose(found.mean, mean, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.P, spread + Q, rtol=0, atol=1e-12)
    cross, y = ((points - centre[:, None]) * w_cov) @ off.T, rng.normal(size=4)
    K, e = cross @ np.linalg.inv(spread + R), y - mean
    found = clouds[1](images.T, h, root, y, R)
    np.testing.assert_allclose(found.change, K @ e, rtol=0, atol=1e-12)
    P = root @ root.T - K @ (spread + R) @ K.T
    np.testing.assert_allclose(found.P, P, rtol=0, atol=1e-12)
    assert found.nis[0] == pytest.approx(e @ np.linalg.inv(spread + R) @ e, rel=1e-10)
    H = cross.T @ np.linalg.inv(root @ root.T)
    np.testing.assert_allclose(found.fit, mean + H @ K @ e, rtol=0, atol=1e-12)


def test_a_root_of_a_semidefinite_covariance():
    L = np.array([[1.0, 0, 0], [2, 1, 0], [0, 0, 0], [1, -1, 0]])
    root = root_of(L @ L.T)
    np.testing.assert_allclose(root @ root.T, L @ L.T, rtol=0, atol=1e-14)
    assert root.shape == (4, 3) and np.sum(np.any(root, axis=0)) == 2
    np.testing.assert_array_equal(root_of(np.zeros((3, 3))), np.zeros((3, 1)))


def test_caution_adds_what_the_line_through_the_points_left_out():
    """An update by hand, with the noise so raised, where a precise reading meets a wide start."""
    discrete = hanging("planar")
    n, tip, u, y = len(discrete.state_names), discrete.sensors["tip"], np.zeros(0), [0, 0.2, 0.5]
    known = {"x0": np.full(n, 0.3), "P0": np.full(n, 0.09), "Q_w": np.zeros(n), "many": serial}
    bold, once = (UKF(discrete, caution=caution, **known) for caution in (0, 1))
    first, found = (f.update(f.start, y, "tip", u) for f in (bold, once))

    def read(x: np.ndarray) -> np.ndarray:
        return tip.output(x, u, discrete.theta0).full()[:, 0]

    h = 3**0.5
    points = spread_out(np.full(n, 0.3), 0.3 * np.eye(n), h)
    seen = np.array([read(x) for x in points.T])
    centre, ahead, behind = seen[0], seen[1 : n + 1], seen[n + 1 :]
    D, bend = ((ahead - behind) / (2 * h)).T, ((ahead + behind - 2 * centre) / (2 * h)).T
    delta = bend.sum(axis=1) / h
    rest = np.column_stack([bend, delta * np.sqrt(2 - min(h**2 / n, 1))])
    noise = tip.R_v + rest @ rest.T
    line = centre + delta + D @ (first.x - 0.3) / 0.3
    left_out = read(first.x) - line
    assert np.max(np.abs(left_out)) > 3 * np.sqrt(np.diag(tip.R_v))[0]
    S = D @ D.T + noise + np.diag(left_out**2)
    change = 0.3 * D.T @ np.linalg.solve(S, np.array(y) - centre - delta)
    # The compiled readings and factors of values of order 1.
    np.testing.assert_allclose(found.x, 0.3 + change, rtol=0, atol=1e-10)
    assert found.nis == first.nis and found.believed


def test_a_square_bends_the_mean():
    """E[x^2] = m^2 + P of a Gaussian number, exactly."""
    m, P = 0.7, 0.3
    points = spread_out(np.array([m]), np.sqrt([[P]]), 3**0.5)
    found = step_cloud(1, 1)((points**2).T, 3**0.5, np.zeros((1, 1)))
    assert found.mean[0] == pytest.approx(m**2 + P, rel=1e-14)


@pytest.mark.parametrize("chart", ["planar", pytest.param("cardan", marks=pytest.mark.slow)])
def test_points_at_once_are_those_one_after_the_other(chart):
    discrete = hanging(chart)
    n = len(discrete.state_names)
    known = {
        "x0": np.full(n, 0.1),
        "P0": np.r_[np.full(n, 0.01), np.ones(3), np.zeros(3)],
        "Q_w": ProcessNoise(force=0.1, walk={"wrench": 0.1}),
        "augment": ("wrench",),
    }
    at_once, serially = UKF(discrete, **known), UKF(discrete, many=serial, **known)
    a, b = at_once.start, serially.start
    for k in range(5):
        a, b = (f.predict(e, []) for f, e in ((at_once, a), (serially, b)))
        y = [0.0, 0.2 + 0.01 * k, 0.5]
        a, b = (f.update(e, y, "tip", []) for f, e in ((at_once, a), (serially, b)))
    # Sines of SIMD lanes are within an ulp of the library's.
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(a.P, b.P, rtol=0, atol=1e-12)
    assert not a.failure and a.used == 3


def test_re_centring_maps_the_covariance():
    """An angle beyond 45 degrees: the prediction about the old centre, through the map T."""
    discrete = hanging("cardan")
    n = len(discrete.state_names)
    x0 = np.zeros(n)
    x0[1] = 0.9
    known = {"P0": np.full(n, 1e-3), "Q_w": np.full(n, 1e-4), "many": serial}
    ukf = UKF(discrete, x0=x0, **known)
    moved, u = ukf.predict(ukf.start, []), np.zeros(0)
    ukf.discrete = Still(discrete)
    stayed = ukf.predict(ukf.start, u)
    assert moved.recentred == 1 and stayed.recentred == 0
    x, theta, T = discrete.recentre(stayed.x, stayed.theta)
    assert np.array_equal(moved.theta, theta) and abs(moved.x[1]) < 1e-12
    np.testing.assert_allclose(moved.x, x, rtol=0, atol=1e-14)
    np.testing.assert_allclose(moved.P, T @ stayed.P @ T.T, rtol=0, atol=1e-14)


def test_a_gate_that_is_no_chance_is_refused(toy):
    with pytest.raises(EstimationError, match="gate: expected a chance between 0 and 1, got 2"):
        UKF(toy, x0=np.zeros(N), P0=np.ones(N), Q_w=np.ones(N), gate=2, many=serial)


def test_a_step_that_fails_leaves_the_estimate(toy):
    ukf = UKF(toy, x0=np.zeros(N), P0=np.ones(N), Q_w=np.ones(N), many=serial)
    start = ukf.start.replaced(x=np.full(N, 1e200))
    est = ukf.predict(start, np.zeros(N_U))
    assert est.failed == 1 and "did not converge" in est.failure
    assert np.array_equal(est.x, start.x)
