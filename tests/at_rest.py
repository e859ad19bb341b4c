"""A robot at rest in the plane, watched by sensors with every fault: the case of long runs."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

import dtcasadi as dtc
from dtcasadi.discrete import DiscreteModel
from dtcasadi.presets import seed_four_disc
from dtcasadi.sensors import IMU, Marker, PressureSensor
from estimators import EKF, MHE, SPV, UKF, ProcessNoise, operating_points

STEP, U = 0.01, np.array([5.0])


@cache
def planar() -> DiscreteModel:
    """The seed's robot with a gauge, an inertial chip and a marker on the tip."""
    sensors = (
        PressureSensor(name="air", noise=0.05),
        IMU(name="chip", disc=4, noise=0.05),
        Marker(name="tip", disc=4, noise=0.01),
    )
    model = dtc.build(seed_four_disc(), chart="planar")
    return model.discrete(STEP, method="ros2", exact=False, sensors=sensors)


@cache
def filters() -> dict[str, Any]:
    """Every filter, at rest under the pressure U and exactly there."""
    discrete = planar()
    points = operating_points(discrete.model, [4.0], [6.0], n=3)
    n, x0 = discrete.model.n_q, points.x[0, 1]
    noise = ProcessNoise(state=np.r_[np.zeros(n), np.full(n, 0.1)])
    known: dict[str, Any] = {"x0": x0, "P0": np.full(2 * n, 1e-4), "Q_w": noise, "gate": 1e-6}
    return {
        "ekf": EKF(discrete, **known),
        "ukf": UKF(discrete, **known),
        "mhe": MHE(discrete, **known),
        "spv": SPV(discrete, points, x0=x0, Q_w=noise, gauge="air", gate=1e-6),
    }


@dataclass
class Readings:
    """Noisy readings of the robot at rest; gaps, outlier bursts, a chip that dies half way.

    Attributes:
        x: where it rests.
        steps: how long.
        lost: readings so far that are not numbers.
        bursts: readings so far of the tip that are far off.
    """

    x: np.ndarray
    steps: int
    lost: int = 0
    bursts: int = 0

    def __iter__(self) -> Iterator[list[tuple[str, np.ndarray]]]:
        discrete, rng = planar(), np.random.default_rng(1)
        given = (self.x, U, discrete.theta0)
        rest = {k: s.output(*given).full()[:, 0] for k, s in discrete.sensors.items()}
        sigma = {k: np.sqrt(np.diag(s.R_v)) for k, s in discrete.sensors.items()}
        for k in range(self.steps):
            read = []
            for sensor, expected in rest.items():
                y = expected + sigma[sensor] * rng.normal(size=len(expected))
                if sensor == "chip" and k >= self.steps // 2:
                    y[:] = np.nan
                if sensor == "tip" and k % 200 >= 190:
                    y, self.bursts = y + 50.0, self.bursts + 1
                if sensor == "tip" and k % 37 == 0:
                    y[1] = (np.nan, np.inf)[k % 2]
                self.lost += int(np.sum(~np.isfinite(y)))
                read.append((sensor, y))
            yield read
