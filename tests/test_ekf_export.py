"""Filters as exported C: the same numbers as in Python, step by step."""

import re

import numpy as np
import pytest
from c_compilers import needs_compiler
from exported import Library, built
from linear_toy import LinearDiscrete

import dtcasadi as dtc
from estimators import EKF, SPV, OperatingPoints

pytestmark = needs_compiler
N = 4


@pytest.fixture(scope="module")
def ekf() -> EKF:
    rng = np.random.default_rng(2)
    measured = {
        "a": (rng.normal(size=(3, N)), rng.normal(size=(3, 2)), np.diag([0.1, 0.2, 0.3])),
        "b": (rng.normal(size=(1, N)), np.zeros((1, 2)), np.eye(1)),
    }
    F = np.eye(N) + 0.1 * rng.normal(size=(N, N))
    toy = LinearDiscrete(
        F,
        rng.normal(size=(N, 1)),
        rng.normal(size=(N, 2)),
        measured,
        np.array([1.0, 2.0]),
        {"mass": slice(0, 2)},
    )
    P0, Q_w = np.full(N + 2, 0.5), np.full(N + 2, 0.01)
    return EKF(toy, x0=np.ones(N), P0=P0, Q_w=Q_w, augment=("mass",), gate=1e-3)


def test_the_exported_filter_gives_the_numbers_of_the_one_in_python(ekf, rng, tmp_path):
    exported = dtc.export_c(ekf.functions("a", ("a", "b")), tmp_path / "c", name="toy")
    library = Library(exported, built(exported, ["-O1", "-Wall", "-Werror"], tmp_path / "lib"))
    est = ekf.start
    x, P, theta = est.x, est.P, est.theta
    for k in range(30):
        u, both = rng.normal(size=1), k % 2
        y = rng.normal(size=4 if both else 3)
        if k % 7 == 0:
            y[1] = np.nan
        if k % 11 == 0:
            y += 100
        names, function = (("a", "b"), "update_a_b") if both else (("a",), "update_a")
        est = ekf.update(ekf.predict(est, u), y, names, u)
        status, (x, P) = library.call("predict", [x, P, u, theta])
        assert status == 0
        status, (x, P, theta, nis, used, believed) = library.call(function, [x, P, u, theta, y])
        assert status == 0
        # The same C at another optimization level: fused products round differently.
        np.testing.assert_allclose(x, est.x, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(P, est.P.ravel(), rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(theta, est.theta, rtol=1e-10, atol=1e-12)
        assert (used, bool(believed[0])) == (est.used, est.believed)
        np.testing.assert_allclose(nis, est.nis, rtol=1e-8)
    assert 3 <= est.gated < 30 and est.skipped == 5


def test_single_precision_is_measured_and_close(ekf, tmp_path):
    exported = dtc.export_c(ekf.functions(), tmp_path / "c", name="toy", single=True)
    readme = (exported.folder / "README.md").read_text()
    rows = re.findall(r"`(predict|update_\w+)` *\| *([\d.e+-]+) *\| *([\d.e+-]+)", readme)
    assert {name for name, *_ in rows} == {"predict", "update_a", "update_b"}
    # Covariances of condition up to some 1e2 times the round-off of 6e-8.
    assert all(float(worst) < 1e-4 for *_, worst in rows)


@pytest.fixture(scope="module")
def spv(ekf) -> SPV:
    """Two branches of three points, which a linear model may have anywhere."""
    rng = np.random.default_rng(4)
    commands = np.array([[0.0], [1.0], [3.0]])
    felt = np.array([commands - 0.5, commands + 0.5])
    points = OperatingPoints(commands, felt, rng.normal(size=(2, 3, N)))
    return SPV(
        ekf.discrete, points, x0=np.ones(N), Q_w=np.full(N + 2, 0.01), augment=("mass",),
        gauge="b", width=0.3, gate=1e-3,
    )  # fmt: skip


def test_the_exported_observer_gives_the_numbers_of_the_one_in_python(spv, rng, tmp_path):
    exported = dtc.export_c(spv.functions(), tmp_path / "c", name="toy")
    library = Library(exported, built(exported, ["-O1", "-Wall", "-Werror"], tmp_path / "lib"))
    est = spv.start
    x, theta, schedule = est.x, est.theta, est.schedule
    for k in range(40):
        u, name = rng.uniform(0, 3, size=1), "ab"[k % 2]
        y = rng.normal(size=3) if name == "a" else u
        y = y + 100 * (k % 11 == 0)
        if k % 7 == 0:
            y[0] = np.nan
        est = spv.update(spv.predict(est, u), y, name, u)
        status, (x, schedule) = library.call("predict", [x, theta, schedule, u])
        assert status == 0
        status, (x, theta, schedule, nis, used, believed) = library.call(
            f"update_{name}", [x, theta, schedule, u, y]
        )
        assert status == 0
        # The same C at another optimization level: fused products round differently.
        np.testing.assert_allclose(x, est.x, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(theta, est.theta, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(schedule, est.schedule, rtol=1e-12, atol=1e-14)
        assert (used, bool(believed[0])) == (est.used, est.believed)
        np.testing.assert_allclose(nis, est.nis, rtol=1e-8)
    status, (P,) = library.call("covariance", [schedule])
    np.testing.assert_allclose(P, spv.predict(est, u).P.ravel(), rtol=1e-10, atol=1e-14)
    assert est.gated >= 2 and est.skipped == 6 and abs(est.schedule[1]) <= 1
