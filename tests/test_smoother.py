"""The fixed-interval smoother: Rauch-Tung-Striebel, the best estimate from all readings."""

import numpy as np
import pytest
from kalman import N_U, N, covariance, toy_plant
from linear_toy import LinearDiscrete

import dtcasadi as dtc
from dtcasadi.logs import Log
from dtcasadi.sensors import Orientation
from estimators import EKF
from estimators.runner import track
from estimators.smoother import backwards, smoothed

STEPS = 30


@pytest.fixture(scope="module")
def toy() -> LinearDiscrete:
    return toy_plant()


@pytest.fixture(scope="module")
def log(toy) -> Log:
    """Both sensors, gaps, and rows that arrived out of order."""
    rng = np.random.default_rng(3)
    t = toy.step_s * np.arange(STEPS + 1)
    channels = {f"{name}.y{k}": rng.normal(size=len(t)) for name, k in PORTS}
    channels["one.y0"][::3] = np.nan
    channels["pair.y1"][5] = np.nan
    channels |= {f"command{k + 1}": rng.normal(size=len(t)) for k in range(N_U)}
    return Log(t, channels, dict.fromkeys(channels, ""))


PORTS = [("pair", 0), ("pair", 1), ("pair", 2), ("one", 0)]


def least_squares(toy: LinearDiscrete, ekf: EKF, Q: np.ndarray, log: Log) -> tuple:
    """Every z_k at once, from all readings, process noise and start: one linear problem."""
    F = np.block([[toy.F, toy.B[:, 2:]], [np.zeros((2, N)), np.eye(2)]])
    n, rows, right = N + 2, [], []

    def add(parts: dict[int, np.ndarray], value: np.ndarray, P: np.ndarray) -> None:
        whiten = np.linalg.inv(np.linalg.cholesky(P))
        row = np.zeros((len(value), n * (STEPS + 1)))
        for k, block in parts.items():
            row[:, n * k : n * (k + 1)] = block
        rows.append(whiten @ row)
        right.append(whiten @ value)

    start = np.concatenate([ekf.start.x, ekf.start.theta[2:]])
    add({0: np.eye(n)}, start, ekf.start.P)
    for k in range(STEPS + 1):
        u = np.array([log.channels[f"command{i + 1}"][k] for i in range(N_U)])
        if k < STEPS:
            push = np.r_[toy.G @ u + toy.B[:, :2] @ toy.theta0[:2], np.zeros(2)]
            add({k: -F, k + 1: np.eye(n)}, push, Q)
        for name, (H_x, H_theta, R) in toy.measured.items():
            y = np.array([log.channels[f"{name}.y{i}"][k] for i in range(len(H_x))])
            kept = np.isfinite(y)
            if kept.any():
                known = H_theta[:, :2] @ toy.theta0[:2]
                H = np.hstack([H_x, H_theta[:, 2:]])
                add({k: H[kept]}, (y - known)[kept], R[np.ix_(kept, kept)])
    A, b = np.vstack(rows), np.concatenate(right)
    P = np.linalg.inv(A.T @ A)
    return (P @ (A.T @ b)).reshape(-1, n), P.reshape(STEPS + 1, n, STEPS + 1, n)


def test_it_is_the_least_squares_solution_of_the_whole_log(toy, log, rng):
    Q, P0 = covariance(rng, N + 2), covariance(rng, N + 2)
    ekf = EKF(toy, x0=rng.normal(size=N), P0=P0, Q_w=Q, augment=("mass",))
    found = smoothed(ekf, log)
    z, P = least_squares(toy, ekf, Q, log)
    assert len(found.estimates) == STEPS + 1
    for k, est in enumerate(found.estimates):
        # 1e-10 of values of order 1, as the normal equations have a condition of about 1e4.
        mine = np.concatenate([est.x, est.theta[2:]])
        np.testing.assert_allclose(mine, z[k], rtol=0, atol=1e-10)
        np.testing.assert_allclose(est.P, P[k, :, k], rtol=0, atol=1e-10)
    filtered = track(ekf, log)
    assert np.trace(found.estimates[3].P) < 0.9 * np.trace(filtered.estimates[3].P)


def test_late_rows_count_at_their_instants(toy, log, rng):
    ekf = EKF(toy, x0=rng.normal(size=N), P0=np.ones(N), Q_w=np.ones(N))
    order = np.arange(STEPS + 1)
    order[10:14] = order[10:14][::-1]
    late = Log(log.t[order], {c: v[order] for c, v in log.channels.items()}, log.units)
    one, other = smoothed(ekf, log), smoothed(ekf, late)
    for a, b in zip(one.estimates, other.estimates, strict=True):
        np.testing.assert_array_equal(a.x, b.x)


def test_what_is_known_exactly_stays_known(toy, log):
    """Zero variances: no division by them, and no other estimates."""
    P0 = np.r_[np.ones(N), 0.0, 0.0]
    ekf = EKF(toy, x0=np.zeros(N), P0=P0, Q_w=np.ones(N), augment=("mass",))
    plain = EKF(toy, x0=np.zeros(N), P0=np.ones(N), Q_w=np.ones(N))
    pairs = zip(smoothed(ekf, log).estimates, smoothed(plain, log).estimates, strict=True)
    for est, expected in pairs:
        assert np.array_equal(est.theta, toy.theta0)
        np.testing.assert_allclose(est.x, expected.x, rtol=0, atol=1e-10)


@pytest.mark.filterwarnings("ignore::dtcasadi.compile.NoCompilerWarning")
def test_smoothing_goes_through_a_re_centring(monkeypatch):
    """A disc that turns past 45 degrees, seen at the end only: the start is found from there.

    Rates are almost exactly known, so the smoothed directions have the final error all along.
    """
    monkeypatch.setenv("DTCASADI_CC", "none")
    disc = dtc.Disc.hoop(1.0, 0.2)
    robot = dtc.Robot((disc, disc), (dtc.Thread(0.5),), gravity=0.0)
    sensor = Orientation(name="way", disc=2, noise=1e-3)
    model = dtc.build(robot, chart="cardan")
    discrete = model.discrete(0.01, method="euler", sensors=(sensor,))
    n = model.n_q
    x0 = np.zeros(2 * n)
    x0[1], x0[n + 1] = 0.6, 3.0  # the thread swings round, the disc with it
    true, theta, path = x0.copy(), discrete.theta0, []
    for _ in range(16):
        path.append((true, theta))
        true = np.array(discrete.step(true, [], theta)[0]).ravel()
        true, theta, _ = discrete.recentre(true, theta)
    off = np.r_[0.0, 0.05, np.zeros(2 * n - 2)]
    P0 = np.r_[np.full(n, 0.01), np.full(n, 1e-10)]
    ekf = EKF(discrete, x0=x0 + off, P0=P0, Q_w=np.full(2 * n, 1e-12))
    t = 0.01 * np.arange(16)
    output = discrete.sensors["way"].output
    last = np.array(output(*[path[-1][0], [], path[-1][1]])).ravel()
    names = [f"way.{channel}" for channel, _ in discrete.sensors["way"].channels]
    channels = {name: np.r_[np.full(15, np.nan), y] for name, y in zip(names, last, strict=True)}
    units = {f"way.{channel}": unit for channel, unit in discrete.sensors["way"].channels}
    filtered = track(ekf, Log(t, channels, units))
    assert filtered.last.recentred == 1
    found = backwards(ekf, filtered)

    def turned(x: np.ndarray, theta: np.ndarray) -> np.ndarray:
        return np.array(model.poses(x[:n], theta)[0])[:, 3:]

    before, after = (
        [
            np.linalg.norm(turned(e.x, e.theta) - turned(*p))
            for e, p in zip(f.estimates, path, strict=True)
        ]
        for f in (filtered, found)
    )
    assert before[0] > 0.06 and after[0] < 0.05 * before[0]
    assert max(after) < 0.05 * before[0]
