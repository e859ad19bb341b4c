"""The extended Kalman filter: iterations and arguments; see `test_filters_linear.py`."""

import numpy as np
import pytest
from kalman import N_U, N, covariance, toy_plant
from linear_toy import LinearDiscrete

from dtcasadi.errors import EstimationError
from estimators import EKF, ProcessNoise


@pytest.fixture(scope="module")
def toy() -> LinearDiscrete:
    return toy_plant()


def test_more_iterations_change_nothing_on_a_linear_model(toy, rng):
    Q, P0, x0 = np.eye(N), covariance(rng, N), rng.normal(size=N)
    one, three = (EKF(toy, x0=x0, P0=P0, Q_w=Q, iterations=k) for k in (1, 3))
    y, u = rng.normal(size=3), np.zeros(N_U)
    a, b = (ekf.update(ekf.start, y, "pair", u) for ekf in (one, three))
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(a.P, b.P, rtol=0, atol=1e-12)


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
