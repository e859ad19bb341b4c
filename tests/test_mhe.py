"""The moving horizon estimator: bounds against another solver, its window, its arguments."""

from dataclasses import replace

import numpy as np
import pytest
from c_compilers import needs_compiler
from hanging import Still, hanging
from kalman import N_U, N, covariance, toy_plant
from linear_toy import LinearDiscrete
from scipy.optimize import least_squares, lsq_linear

from dtcasadi.errors import EstimationError
from estimators import EKF, MHE, ProcessNoise
from estimators.mhe import MovingEstimate

pytestmark = pytest.mark.filterwarnings("ignore::dtcasadi.compile.NoCompilerWarning")
BOUNDS = {"mass": ([2.5, -np.inf], [np.inf, 3.2]), "x2": (-0.5, 1.0)}


@pytest.fixture(scope="module")
def toy() -> LinearDiscrete:
    return toy_plant()


class Squares:
    """All of z_0 ... z_k from prior, motion and readings: one linear least-squares problem."""

    def __init__(self, toy: LinearDiscrete, mean: np.ndarray, P: np.ndarray, Q: np.ndarray):
        self.toy, self.Q, self.n, self.last = toy, Q, len(mean), 0
        self.rows: list[tuple[dict[int, np.ndarray], np.ndarray]] = []
        self.add({0: np.eye(self.n)}, mean, P)

    def add(self, parts: dict[int, np.ndarray], value: np.ndarray, P: np.ndarray) -> None:
        whiten = np.linalg.inv(np.linalg.cholesky(P))
        self.rows.append(({k: whiten @ part for k, part in parts.items()}, whiten @ value))

    def moved(self, u: np.ndarray) -> None:
        toy, k = self.toy, self.last
        F = np.block([[toy.F, toy.B[:, 2:]], [np.zeros((2, N)), np.eye(2)]])
        push = np.r_[toy.G @ u + toy.B[:, :2] @ toy.theta0[:2], np.zeros(2)]
        self.add({k: -F, k + 1: np.eye(self.n)}, push, self.Q)
        self.last += 1

    def read(self, y: np.ndarray) -> None:
        H_x, H_theta, R = self.toy.measured["pair"]
        kept = np.isfinite(y)
        H = np.hstack([H_x, H_theta[:, 2:]])[kept]
        value = (y - H_theta[:, :2] @ self.toy.theta0[:2])[kept]
        self.add({self.last: H}, value, R[np.ix_(kept, kept)])

    def solved(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """The path within the bounds, by SciPy's active-set method."""
        n, k = self.n, self.last + 1
        A = np.zeros((sum(len(value) for _, value in self.rows), n * k))
        row = 0
        for parts, value in self.rows:
            for step, part in parts.items():
                A[row : row + len(value), n * step : n * (step + 1)] = part
            row += len(value)
        b = np.concatenate([value for _, value in self.rows])
        sides = np.tile(lower, k), np.tile(upper, k)
        return lsq_linear(A, b, sides, method="bvls", tol=1e-14).x.reshape(k, n)


@pytest.mark.parametrize("machine", [pytest.param("compiled", marks=needs_compiler), "virtual"])
def test_within_bounds_it_is_the_least_squares_path(toy, rng, machine, monkeypatch):
    if machine == "virtual":
        for module in ("ekf", "mhe", "bounds"):
            monkeypatch.setattr(f"estimators.{module}.twin", lambda plain, source=None: plain)
    Q, P0, x0 = covariance(rng, N + 2), covariance(rng, N + 2), rng.normal(size=N)
    known = {"x0": x0, "P0": P0, "Q_w": Q, "augment": ("mass",)}
    mhe, ekf = MHE(toy, bounds=BOUNDS, window=12, **known), EKF(toy, **known)
    assert mhe._stage.function.is_a("External") == (machine == "compiled")
    est, free = mhe.start, ekf.start
    squares = Squares(toy, np.r_[x0, toy.theta0[2:]], P0, Q)
    lower, upper = np.full(N + 2, -np.inf), np.full(N + 2, np.inf)
    lower[[2, 5]], upper[[2, 6]] = (-0.5, 2.5), (1.0, 3.2)
    left, held = 0, 0
    for k in range(12):
        u, y = rng.normal(size=N_U), rng.normal(size=3)
        y[k % 5 : k % 5 + 1] = np.nan
        est, free = (f.update(f.predict(e, u), y, "pair", u) for f, e in ((mhe, est), (ekf, free)))
        squares.moved(u)
        squares.read(y)
        # Values of order 1; the twin without a compiler is an interior-point method.
        atol = 1e-8 if machine == "compiled" else 1e-6
        np.testing.assert_allclose(est.window.z, squares.solved(lower, upper), rtol=0, atol=atol)
        assert not est.failure and est.residual < atol
        z = np.r_[est.x, est.theta[2:]]
        assert np.all(lower <= z) and np.all(z <= upper)
        z = np.r_[free.x, free.theta[2:]]
        left += np.any(z < lower) or np.any(z > upper)
        held = max(held, est.active)
    assert left >= 3 and held >= 5


def test_a_force_that_can_only_push_is_found_nearer_the_truth(rng):
    """None acts; the filter without bounds believes in one that pulls half of the time."""
    discrete = hanging("planar")
    n, u, theta = len(discrete.state_names), np.zeros(0), discrete.theta0
    noise = ProcessNoise(state=1e-3, walk={"wrench": [0, 20, 0, 0, 0, 0]})
    known = {"P0": np.r_[np.full(n, 1e-4), 0, 4, np.zeros(4)], "augment": ("wrench",)}
    known |= {"x0": np.zeros(n), "Q_w": noise}
    mhe, ekf = MHE(discrete, bounds={"wrench[2]": (0.0, np.inf)}, **known), EKF(discrete, **known)
    x, est, free, pairs = np.zeros(n), mhe.start, ekf.start, []
    step, output = discrete.compiled("step"), discrete.sensors["tip"].output
    force = discrete.theta_blocks["wrench"].start + 1
    for _ in range(80):
        x = step(x, u, theta)[0]
        y = np.array(output(x, u, theta)).ravel() + 0.01 * rng.normal(size=3)
        est, free = (f.update(f.predict(e, u), y, "tip", u) for f, e in ((mhe, est), (ekf, free)))
        assert not est.failure and est.residual < 1e-8
        # A path of forces: from multipliers, exact to round-off of values of order 1.
        assert est.theta[force] >= 0 and est.window.z[:, n + 1].min() >= -1e-9
        pairs.append((est.theta[force], free.theta[force]))
    bounded, unbounded = np.array(pairs).T
    assert unbounded.min() < -0.1
    assert np.sqrt(np.mean(bounded**2)) < np.sqrt(np.mean(unbounded**2))


def test_what_is_known_exactly_stays_known_within_bounds(toy, rng):
    """A constant parameter has the same value at every step: rows of rank one."""
    P0 = np.r_[np.ones(N), 1.0, 0.0]
    known = {"x0": np.zeros(N), "P0": P0, "Q_w": np.r_[np.ones(N), 0, 0], "augment": ("mass",)}
    mhe = MHE(toy, bounds={"mass[1]": (1.9, 2.1), "mass[2]": (0.0, 5.0)}, window=8, **known)
    est, u = mhe.start, np.zeros(N_U)
    for _ in range(30):
        est = mhe.update(mhe.predict(est, u), 3 * rng.normal(size=3), "pair", u)
        assert not est.failure and est.residual < 1e-6
        assert 1.9 <= est.theta[2] <= 2.1 and est.theta[3] == toy.theta0[3]
        np.testing.assert_allclose(est.window.z[:, 5], est.theta[2], rtol=0, atol=1e-7)


def test_a_bound_that_contradicts_what_is_known_exactly_is_a_failure(toy, rng):
    known = {"x0": np.zeros(N), "P0": np.ones(N), "Q_w": np.ones(N), "augment": ("mass",)}
    mhe = MHE(toy, bounds={"mass[1]": (9.0, 10.0)}, window=2, **known)
    est = mhe.update(mhe.start, rng.normal(size=3), "pair", np.zeros(N_U))
    assert "the bounds contradict each other or what is known exactly" in est.failure
    assert est.x is mhe.start.x and est.failed == 1


def test_re_centring_starts_the_window_anew(monkeypatch):
    """An angle beyond 45 degrees: the prediction about the old centre, through the map T."""
    monkeypatch.setenv("DTCASADI_CC", "none")
    discrete = hanging("cardan")
    n = len(discrete.state_names)
    x0 = np.zeros(n)
    x0[1] = 0.9
    mhe = MHE(discrete, x0=x0, P0=np.full(n, 1e-3), Q_w=np.full(n, 1e-4))
    moved = mhe.predict(mhe.start, np.zeros(0))
    ekf = EKF(discrete, x0=x0, P0=np.full(n, 1e-3), Q_w=np.full(n, 1e-4))
    expected = ekf.predict(ekf.start, np.zeros(0))
    assert moved.recentred == 1 and len(moved.window) == 1
    np.testing.assert_array_equal(moved.window.mean, expected.x)
    np.testing.assert_array_equal(moved.window.P, expected.P)
    np.testing.assert_array_equal(moved.theta, expected.theta)
    again = mhe.update(moved, [0.0, 0.2, 0.5], "tip", np.zeros(0))
    assert not again.failure and again.used == 3
    mhe._ekf.discrete = Still(discrete)
    assert len(mhe.predict(mhe.start, np.zeros(0)).window) == 2


def test_a_window_that_cannot_be_solved_starts_anew(toy, rng):
    mhe = MHE(toy, x0=np.zeros(N), P0=np.ones(N), Q_w=np.ones(N), window=3)
    u = np.zeros(N_U)
    est = mhe.predict(mhe.predict(mhe.start, u), u)
    z = est.window.z.copy()
    z[1] = np.nan
    broken = est.replaced(window=replace(est.window, z=z))
    after = mhe.update(broken, rng.normal(size=3), "pair", u)
    assert "update with pair" in after.failure and after.failed == 1
    assert after.x is broken.x and after.P is broken.P and len(after.window) == 1
    healed = mhe.update(after, rng.normal(size=3), "pair", u)
    assert not healed.failure and isinstance(healed, MovingEstimate)


def test_on_a_curved_model_it_goes_to_the_most_likely_path(rng):
    """Gauss-Newton steps until nothing changes, against SciPy's, from values 0.3 rad off."""
    discrete = hanging("planar")
    n, steps, u, theta = len(discrete.state_names), 6, np.zeros(0), discrete.theta0
    Q = np.full(n, 1e-3)
    known = {"x0": np.full(n, 0.3), "P0": np.full(n, 0.1), "Q_w": Q}
    mhe, readings = MHE(discrete, iterations=20, **known), []
    est, step, output = mhe.start, discrete.compiled("step"), discrete.sensors["tip"].output

    def read(x: np.ndarray) -> np.ndarray:
        return np.array(output(x, u, theta)).ravel()

    x = np.zeros(n)
    for _ in range(steps):
        x = step(x, u, theta)[0]
        readings.append(read(x) + 0.01 * rng.normal(size=3))
        est = mhe.update(mhe.predict(est, u), readings[-1], "tip", u)

    def residuals(path: np.ndarray) -> np.ndarray:
        z = path.reshape(-1, n)
        parts = [(z[0] - 0.3) / np.sqrt(0.1)]
        for k in range(steps):
            parts.append((z[k + 1] - step(z[k], u, theta)[0]) / np.sqrt(Q))
            parts.append((readings[k] - read(z[k + 1])) / 0.01)
        return np.concatenate(parts)

    found = least_squares(residuals, np.full(n * (steps + 1), 0.3), xtol=1e-14, ftol=1e-14)
    # Differences of 1e-8 for SciPy's derivatives.
    np.testing.assert_allclose(est.window.z.ravel(), found.x, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"window": 0}, "window: expected an integer from 1 to 1000"),
        ({"iterations": 0}, "iterations: expected an integer from 1 to 20"),
        ({"bounds": {"x9": (0, 1)}}, "bounds: expected names out of x0, x1, .*, got 'x9'"),
        ({"bounds": {"x1": 3.0}}, r"bounds\['x1'\]: expected a pair \(lower, upper\)"),
        ({"bounds": {"x1": (1, 0)}}, r"bounds\['x1'\]: expected lower bounds up to the upper ones"),
        ({"bounds": {f"x{k}": (0, 1) for k in range(N)}, "window": 30}, "expected at most 128"),
        ({"x0": np.zeros(3)}, r"x0: expected finite numbers of shape \(5\)"),
    ],
)
def test_wrong_arguments_are_named(toy, change, line):
    good = {"x0": np.zeros(N), "P0": np.ones(N), "Q_w": np.ones(N)}
    with pytest.raises(EstimationError, match=line):
        MHE(toy, **{**good, **change})


def test_an_estimate_of_another_filter_is_refused(toy):
    known = {"x0": np.zeros(N), "P0": np.ones(N), "Q_w": np.ones(N)}
    mhe, ekf = MHE(toy, **known), EKF(toy, **known)
    with pytest.raises(EstimationError, match="est: expected an estimate of this estimator"):
        mhe.predict(ekf.start, np.zeros(N_U))
