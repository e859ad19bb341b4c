r"""The parameter-varying observer of Bui and Schultz: linear observers, scheduled by pressure.

Bui and Schultz, A Semilinear Parameter-Varying Observer Method for Fabric-Reinforced Soft Robots
(Frontiers in Robotics and AI 8, 2021, 749591) estimate coordinates, rates and contact force of this
very model with a set of linear observers, one for each range of pressures, inflating and deflating
apart. Their tables of sensors, breakpoints and gains are not at hand; chosen here instead:

- subsystems: the discrete model linearized where it rests, at evenly spaced pressures;
- readings: compared with the sensors' own equations h, not with linear ones;
- gains: the steady Kalman filter of each subsystem (discrete Riccati equation), the contact force
  a random walk;
- between two points the subsystems' outputs are weighted linearly, and the estimate is held in
  absolute coordinates, so that nothing jumps when the pressure passes a point;
- hysteresis: on the inflating branch the robot rests where it would at `amplitude` less pressure,
  on the deflating one where it would at as much more. Which one it is on is a number b that needs
  no look back, the play operator

  .. math:: b' = \min(1, \max(-1, b + \Delta p / width))

  (Visintin, Differential Models of Hysteresis, section III.2): 1 inflating, -1 deflating, and the
  branches are weighted by (1 + b) / 2 and (1 - b) / 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dtcasadi import checks
from dtcasadi.bound import Bound
from dtcasadi.codegen import Exposed, exposed
from dtcasadi.compile import bind
from dtcasadi.waist import Discrete

from .augmented import layout_of, noise_of, pushed_by
from .base import Estimate, ProcessNoise, chance, names_of, refusal
from .operating import OperatingPoints
from .scheduled import Tables, correction, covariance, prediction
from .steps import limits_of
from .subsystems import Linearizer


@dataclass(frozen=True, eq=False)
class ScheduledEstimate(Estimate):
    """An estimate that also knows which subsystems are in force.

    Attributes:
        schedule: place of the pressure along the operating points, from 0 to 1, and branch from
            -1 (deflating) to 1 (inflating), shape (2,).
    """

    schedule: np.ndarray = field(default_factory=lambda: np.zeros(2))


class SPV:
    r"""Observer with gains scheduled by pressure, for x and for any blocks of theta.

    .. math:: x' = \sum_j w_j (A_j (z; u) + c_j),\quad
        z \leftarrow z + \sum_j w_j K_j (y - h(z, u))

    With the weights w_j of the operating points next to the measured pressure. P of its estimates
    is the subsystems' steady covariance, weighted alike. The same verbs as `EKF`.

    Attributes:
        discrete: the model, without hysteresis.
        points: the operating points.
        start: the estimate at the beginning.
        names: one name for each estimated number, shape (n_z,).
    """

    def __init__(
        self,
        discrete: Discrete,
        points: OperatingPoints,
        *,
        x0: Sequence[float] | np.ndarray,
        Q_w: ProcessNoise | Sequence[float] | np.ndarray,
        augment: Sequence[str] = (),
        gauge: str | None = None,
        width: float = 0.1,
        gate: float | None = None,
    ):
        """Linearize at every point and find the gains.

        Args:
            discrete: the model with its sensors.
            points: where it rests, in the coordinates of the model's own centres.
            x0: states at the beginning, shape (n_x,).
            Q_w: process noise, as of `EKF`.
            augment: blocks of theta to estimate besides x.
            gauge: the sensor whose readings, one for each command, schedule the subsystems;
                default: the command does.
            width: change of pressure, as a share of the points' range, that leads from the middle
                between the branches to one of them; larger than the noise of the gauge.
            gate: chance that a good measurement is refused as an outlier; None: every one is
                believed.

        Raises:
            EstimationError: an argument cannot be used, or a subsystem has no steady filter.
        """
        self.discrete, self.points = discrete, points
        layout = layout_of(discrete, augment)
        self.names = layout.names
        n_u = discrete.linearize.size1_in("u")
        if points.x.shape[2] != layout.n_x or points.commands.shape[1] != n_u:
            expected = f"operating points with {layout.n_x} states and {n_u} commands"
            raise refusal("points", expected, f"{points.x.shape[2]}, {points.commands.shape[1]}")
        if not discrete.sensors:
            raise refusal("discrete.sensors", "at least one sensor", "none")
        if gauge is not None and len(_sensor(discrete, gauge).channels) != n_u:
            raise refusal("gauge", f"a sensor of {n_u} pressures", repr(gauge))
        width = checks.number("width", width, positive=True, error=refusal)
        self._gate = chance(gate)
        theta = np.array(discrete.theta0)
        Q, noise = noise_of(discrete, layout, augment, Q_w)
        linearizer = Linearizer(discrete, layout, theta, Q, pushed_by(discrete, noise))
        rows = zip(points.x, points.felt, strict=True)
        subsystems = [
            [linearizer.at(*each) for each in zip(*row, points.commands, strict=True)]
            for row in rows
        ]
        self._tables = Tables(discrete, layout, points, subsystems, width, gauge)
        self._functions = {"predict": prediction(self._tables)}
        self._covariances = {"": bind(covariance(self._tables, None))}
        self._bound: dict[str, Bound] = {}
        x0 = checks.array("x0", x0, (layout.n_x,), error=refusal)
        schedule = np.zeros(2)
        self.start = ScheduledEstimate(x0, self._covariance("", schedule), theta, schedule=schedule)

    def predict(self, est: Estimate, u: Sequence[float] | np.ndarray) -> ScheduledEstimate:
        """The estimate a step later, under the command u.

        A step to what is not finite leaves the estimate, and says so in `failure`.

        Raises:
            ModelError: an array of a wrong shape.
            EstimationError: the estimate of another filter.
        """
        est = _own(est)
        x, schedule = self._compiled("predict")(est.x, est.theta, est.schedule, u)
        if not (np.all(np.isfinite(x)) and np.all(np.isfinite(schedule))):
            return _scheduled(est.failing("predict: the step did not lead to finite states"))
        P = self._covariance("", schedule)
        return _scheduled(est.replaced(x=x, P=P, schedule=schedule, failure=""))

    def update(
        self,
        est: Estimate,
        y: Sequence[float] | np.ndarray,
        sensor: str | Sequence[str],
        u: Sequence[float] | np.ndarray,
    ) -> ScheduledEstimate:
        """The estimate with a measurement taken in; see `EKF.update`.

        Readings that are not finite are left out and counted; several sensors are taken one after
        the other, `nis` and `used` are their sums.

        Raises:
            ModelError: an unknown sensor, or an array of a wrong shape.
            EstimationError: the estimate of another filter.
        """
        est = _own(est)
        names = names_of(sensor)
        sizes = [len(_sensor(self.discrete, name).channels) for name in names]
        parts = np.split(np.asarray(y, dtype=float), np.cumsum(sizes)[:-1])
        before, nis, used, believed = est.gated, 0.0, 0, True
        for name, part in zip(names, parts, strict=True):
            est = self._taken(est, part, name, u)
            if est.failure:
                return est
            nis, used, believed = nis + est.nis, used + est.used, believed and est.believed
        gated = before + (est.gated > before)
        return _scheduled(est.replaced(nis=nis, used=used, believed=believed, gated=gated))

    def functions(self, *sensors: str) -> dict[str, Exposed]:
        """For `dtcasadi.export_c`: predict, covariance, update_<sensor>.

        Args:
            sensors: names; default: each of the model's.
        """
        found = {"predict": exposed("predict", self._functions["predict"], title="a step later")}
        function = covariance(self._tables, None)
        found["covariance"] = exposed("covariance", function, title="the steady covariance")
        for sensor in sensors or tuple(self.discrete.sensors):
            name = f"update_{sensor}"
            found[name] = exposed(name, self._correction(sensor), title=f"with {sensor}")
        return found

    def _taken(
        self, est: ScheduledEstimate, y: np.ndarray, name: str, u: Sequence[float] | np.ndarray
    ) -> ScheduledEstimate:
        self._correction(name)
        ports = (est.x, est.theta, est.schedule, u, y)
        x, theta, schedule, nis, used, believed = self._compiled(name)(*ports)
        skipped = est.skipped + len(y) - int(used[0])
        if not np.all(np.isfinite(np.concatenate([x, theta, schedule]))):
            failure = f"update with {name}: the result is not finite"
            return _scheduled(est.failing(failure, skipped=skipped))
        fit: Mapping[str, Any] = {
            "nis": float(nis[0]), "used": int(used[0]), "believed": bool(believed[0]),
            "skipped": skipped, "failure": "",
        }  # fmt: skip
        if not fit["believed"]:
            return _scheduled(est.replaced(gated=est.gated + 1, **fit))
        P = self._covariance(name, schedule) if fit["used"] else est.P
        return _scheduled(est.replaced(x=x, P=P, theta=theta, schedule=schedule, **fit))

    def _correction(self, name: str) -> Any:
        if name not in self._functions:
            sensor = _sensor(self.discrete, name)
            limits = limits_of(self._gate, len(sensor.channels))
            self._functions[name] = correction(self._tables, name, limits)
        return self._functions[name]

    def _compiled(self, name: str) -> Bound:
        if name not in self._bound:
            self._bound[name] = bind(self._functions[name])
        return self._bound[name]

    def _covariance(self, name: str, schedule: np.ndarray) -> np.ndarray:
        if name not in self._covariances:
            self._covariances[name] = bind(covariance(self._tables, name))
        return self._covariances[name](schedule).reshape(2 * (len(self.names),))


def _sensor(discrete: Discrete, name: str) -> Any:
    return discrete.together((name,))


def _own(est: Estimate) -> ScheduledEstimate:
    if not isinstance(est, ScheduledEstimate):
        raise refusal("est", "an estimate of this observer", type(est).__name__)
    return est


def _scheduled(est: Estimate) -> ScheduledEstimate:
    assert isinstance(est, ScheduledEstimate)
    return est
