"""Filters as exported C in single precision: long runs through faults, beside double precision."""

from pathlib import Path

import numpy as np
import pytest
from at_rest import Readings, U, filters
from c_compilers import needs_compiler
from exported import Library, built
from faults import faulty
from kalman import N_U, N, toy_plant

import dtcasadi as dtc
from dtcasadi.codegen import Exposed
from estimators import EKF

pytestmark = needs_compiler
EPS = float(np.finfo(np.float32).eps)
STEPS = [pytest.param(2000, id="short"), pytest.param(200_000, marks=pytest.mark.slow, id="long")]


def library_of(name: str, functions: dict[str, Exposed], folder: Path) -> Library:
    exported = dtc.export_c(functions, folder / "c", name=name, single=True)
    flags = ["-O1", "-Wall", "-Werror"]
    return Library(exported, built(exported, flags, folder / "lib"), single=True)


@pytest.fixture(scope="module")
def ekf(tmp_path_factory) -> Library:
    return library_of("ekf", filters()["ekf"].functions(), tmp_path_factory.mktemp("ekf"))


@pytest.fixture(scope="module")
def spv(tmp_path_factory) -> Library:
    return library_of("spv", filters()["spv"].functions(), tmp_path_factory.mktemp("spv"))


@pytest.mark.parametrize("steps", STEPS)
def test_the_filter_of_a_robot_stays_beside_the_one_in_double_precision(ekf, steps):
    made = filters()["ekf"]
    est, n = made.start, len(made.start.x)
    x, P, theta = est.x, est.P, est.theta
    for read in Readings(est.x, steps):
        for sensor, y in read:
            est = made.update(est, y, sensor, U)
            status, given = ekf.call(f"update_{sensor}", [x, P, U, theta, y])
            x, P, theta, _, used, believed = given
            assert (status, int(used[0]), bool(believed[0])) == (0, est.used, est.believed)
        est = made.predict(est, U)
        status, (x, P) = ekf.call("predict", [x, P, U, theta])
        square = P.reshape(n, n).astype(float)
        assert status == 0 and np.array_equal(square, square.T)
        np.linalg.cholesky(square)
        # Round-off of 1e-7 in coordinates of some 0.1 rad, through gains of order 1, is small
        # beside the deviations of 1e-3 rad; in P it grows by its condition of 5e3.
        assert np.all(np.abs(x - est.x) < 0.01 * est.sigma)
        assert np.max(np.abs(square - est.P)) < 5e3 * EPS * np.max(est.P)


@pytest.mark.parametrize("steps", STEPS)
def test_the_observer_stays_beside_the_one_in_double_precision(spv, steps):
    made = filters()["spv"]
    est = made.start
    x, theta, schedule = est.x, est.theta, est.schedule
    for read in Readings(est.x, steps):
        for sensor, y in read:
            est = made.update(est, y, sensor, U)
            status, given = spv.call(f"update_{sensor}", [x, theta, schedule, U, y])
            x, theta, schedule, _, used, believed = given
            assert (status, int(used[0]), bool(believed[0])) == (0, est.used, est.believed)
        est = made.predict(est, U)
        status, (x, schedule) = spv.call("predict", [x, theta, schedule, U])
        assert status == 0
        # A step is x' = A x + c with both near x: 1e-7 of it stays in each step, and what the
        # sensors hardly see is forgotten in some hundred steps only.
        assert np.all(np.abs(x - est.x) < 0.05 * est.sigma)
        # Place and branch are sums of differences of pressures.
        assert np.max(np.abs(schedule - est.schedule)) < 200 * EPS
    status, (P,) = spv.call("covariance", [schedule])
    assert status == 0 and np.max(np.abs(P - est.P.ravel())) < 10 * EPS * np.max(est.P)
    np.linalg.cholesky(P.reshape(est.P.shape).astype(float))


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize(("start", "walk"), [(1e4, 1e-8), (1e8, 1e-12)])
def test_the_covariance_stays_positive_definite_through_faults(rng, tmp_path, steps, start, walk):
    """Of the toy; the condition is up to 2e5 in one case, and in the other more than 1 / EPS."""
    toy = toy_plant()
    noise = {"P0": np.full(N + 2, start), "Q_w": np.full(N + 2, walk)}
    made = EKF(toy, x0=np.zeros(N), augment=("mass",), **noise)
    library = library_of("toy", made.functions("pair"), tmp_path)
    x, P, theta = made.start.x, made.start.P, made.start.theta
    for _ in range(steps):
        u = rng.normal(size=N_U)
        status, (x, P) = library.call("predict", [x, P, u, theta])
        covariances = [P]
        if rng.random() > 0.1:
            assert status == 0
            status, given = library.call("update_pair", [x, P, u, theta, faulty(rng, 3)])
            x, P, theta = given[:3]
            covariances.append(P)
        assert status == 0
        for square in (each.reshape(N + 2, N + 2).astype(float) for each in covariances):
            assert np.array_equal(square, square.T)
            values = np.linalg.eigvalsh(square)
            # A matrix of single-precision numbers has no smaller eigenvalue than its round-off.
            assert values[0] > (0 if start < 1e6 else -EPS * values[-1])
    assert np.all(np.isfinite(x)) and np.all(np.isfinite(theta))
