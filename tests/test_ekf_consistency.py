"""Filters on the four-disc robot: their covariance is that of their errors, and they recover."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.discrete import DiscreteModel
from dtcasadi.measuring import Sensor
from dtcasadi.presets import seed_four_disc
from dtcasadi.sensors import IMU, Marker, PressureSensor
from estimators import EKF, MHE, UKF
from estimators.consistency import nees_in_band

STEP = 0.005
SENSORS = (
    PressureSensor(name="air", noise=0.05),
    IMU(name="chip3", disc=3, noise=0.05),
    IMU(name="chip4", disc=4, noise=0.05),
    Marker(name="tip", disc=4, noise=0.01),
)
TOGETHER = ("air", "chip3", "chip4", "tip")


@pytest.fixture(scope="module")
def discrete() -> DiscreteModel:
    model = dtc.build(seed_four_disc(), chart="planar", actuator="regulator")
    return model.discrete(STEP, method="sdirk2", sensors=SENSORS)


def noise(n_q: int, n_z: int) -> np.ndarray:
    """Variances of a step: angles, rates, pressures."""
    return np.concatenate([np.full(n_q, 1e-8), np.full(n_q, 1e-5), np.full(n_z, 1e-4)])


def share_in_band(
    discrete: DiscreteModel, filtered: object, runs: int, steps: int, kind: Callable[..., Any] = EKF
) -> float:
    """Of runs and times; the truth moves by `discrete`, the filter has `filtered`."""
    model = discrete.model
    Q = noise(model.n_q, 1)
    # Small enough that the second-order terms of the readings, ruled out by theory, stay below
    # their noise: 0.02 rad squared times a radius of 1 m is 4e-4 of 1e-2 m.
    P0 = np.concatenate([np.full(model.n_q, 0.02), np.full(model.n_q, 0.02), [0.1]]) ** 2
    mean = np.concatenate([0.1 * np.ones(model.n_q), np.zeros(model.n_q), [9.0]])
    made = kind(filtered, x0=mean, P0=P0, Q_w=Q)
    case = {"mean": mean, "P0": P0, "Q": Q, "u": np.array([10.0]), "runs": runs, "steps": steps}
    return nees_in_band(made, discrete, TOGETHER, **case)  # type: ignore[arg-type]


def test_errors_are_as_large_as_the_covariance_says(discrete):
    # 0.95 is what theory expects; 12 runs of 40 correlated errors each scatter by about 0.02.
    assert share_in_band(discrete, discrete, 12, 40) >= 0.90


def test_a_window_that_moves_on_adds_up_no_bias(discrete):
    # Beyond a few windows: with readings linearized where the window has seen them, 0.6.
    assert share_in_band(discrete, discrete, 4, 150, MHE) >= 0.90


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind",
    [EKF, UKF, MHE, *(partial(each, caution=2) for each in (EKF, UKF, MHE))],
    ids=["ekf", "ukf", "mhe", "ekf, cautious", "ukf, cautious", "mhe, cautious"],
)
def test_errors_are_as_large_as_the_covariance_says_in_100_runs(discrete, kind):
    assert share_in_band(discrete, discrete, 100, 200, kind) >= 0.90


@dataclass(frozen=True, eq=False)
class Flipped:
    """The discrete model with one derivative's sign wrong."""

    true: DiscreteModel

    def __getattr__(self, name: str) -> object:
        return getattr(self.true, name)

    def together(self, names: tuple[str, ...]) -> Sensor:
        sensor = self.true.together(names)
        ports = [ca.MX.sym(n, sensor.linearize.size1_in(n)) for n in ("x", "u", "theta")]
        y, H_x, H_theta = sensor.linearize(*ports)
        signs = np.ones(self.true.model.n_x)
        signs[self.true.model.n_q + 2] = -1
        outputs, names_out = (
            [y, ca.mtimes(H_x, ca.diag(ca.DM(signs))), H_theta],
            ["y", "H_x", "H_theta"],
        )
        wrong = ca.Function("sensor", ports, outputs, ["x", "u", "theta"], names_out)
        return replace(sensor, linearize=wrong, native=wrong)


def test_a_derivative_of_the_wrong_sign_shows(discrete):
    # 0.95 with the right sign.
    assert share_in_band(discrete, Flipped(discrete), 4, 40) < 0.5


def test_it_starts_exactly_straight_and_survives_a_dead_sensor(discrete):
    model = discrete.model
    n = model.n_x
    ekf = EKF(discrete, x0=np.zeros(n), P0=np.full(n, 0.01), Q_w=noise(model.n_q, 1), gate=1e-6)
    x, est, u = np.zeros(n), ekf.start, np.array([5.0])
    step, theta = discrete.compiled("step"), discrete.theta0
    for k in range(400):
        for name in ("air", "tip", "chip4"):
            y = discrete.sensors[name].output(x, u, theta).full()[:, 0]
            if name == "chip4" and k > 100:
                y[:] = np.nan
            if name == "tip" and 200 <= k < 210:
                y += 50.0
            est = ekf.update(est, y, name, u)
        assert not est.failure
        x, est = step(x, u, theta)[0], ekf.predict(est, u)
    assert est.skipped == 6 * 299 and est.gated == 10
    np.linalg.cholesky(est.P)
    # Exact readings: what is left is the drift of the pressure within its noise.
    np.testing.assert_allclose(est.x[: model.n_q], x[: model.n_q], atol=5e-3)
