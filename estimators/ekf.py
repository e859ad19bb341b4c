"""The extended Kalman filter of a discrete model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dtcasadi import checks
from dtcasadi.bound import Bound
from dtcasadi.codegen import Exposed, exposed
from dtcasadi.compile import twin
from dtcasadi.waist import Discrete

from .augmented import layout_of, noise_of, pushed_by, start_of
from .base import Estimate, ProcessNoise, chance, names_of, refusal
from .steps import Pair, Setting, Update, correction, limits_of, prediction


class EKF:
    r"""Extended Kalman filter for x and for any blocks of theta.

    .. math:: z = (x; \theta_{augment}),\quad z' = f(z, u) + w,\quad y = h(z, u) + v

    `predict` and `update` are pure functions of an `Estimate` (Simon, Optimal State Estimation,
    sections 13.2 and 13.3.2); one object serves any number of runs, one thread at a time. C code
    does the work, CasADi's virtual machine where there is no compiler.

    Attributes:
        discrete: the model.
        start: the estimate at the beginning.
        names: one name for each estimated number, shape (n_z,).
        free: entries of theta that are estimated.
    """

    def __init__(
        self,
        discrete: Discrete,
        *,
        x0: Sequence[float] | np.ndarray,
        P0: Sequence[float] | np.ndarray,
        Q_w: ProcessNoise | Sequence[float] | np.ndarray,
        augment: Sequence[str] = (),
        gate: float | None = None,
        iterations: int = 1,
        caution: int = 0,
        theta: np.ndarray | None = None,
    ):
        """Check, and build what predicts.

        Args:
            discrete: the model with its sensors.
            x0: states at the beginning, shape (n_x,).
            P0: their covariance, or its diagonal; of x, or of x and the estimated entries of
                theta, shape (n_z, n_z); given for x only, the others are known exactly.
            Q_w: process noise: `ProcessNoise`, or its covariance in a step or the diagonal of
                that, of x or of all n_z, in the coordinates of whatever centre is in force.
            augment: blocks of theta to estimate besides x.
            gate: chance that a good measurement is refused as an outlier, for example 1e-4; None:
                every one is believed.
            iterations: linearizations in an update; more than 1 is the iterated filter.
            caution: how often the noise of a measurement is raised by the square of what its
                linearization leaves out, h(z + dz) - h(z) - H dz, and the update done again; 2 or
                3 where the start may be far off and sensors are precise. Near the truth nothing is
                left out and nothing raised. Second-order filters estimate the same term from second
                derivatives (Simon, section 13.3.1).
            theta: parameters, the estimated ones at their first guess, shape (n_theta,); default:
                the model's own.

        Raises:
            EstimationError: an argument cannot be used; the text says what was expected.
        """
        self.discrete = discrete
        layout = layout_of(discrete, augment)
        self.names, self.free = layout.names, layout.free
        self.start = start_of(discrete, layout, x0, P0, theta)
        self._gate = chance(gate)
        self._iterations = checks.index("iterations", iterations, 1, 20, error=refusal)
        self._caution = checks.index("caution", caution, 0, 20, error=refusal)
        Q, noise = noise_of(discrete, layout, augment, Q_w)
        self._setting = Setting(discrete, layout.free, Q, *pushed_by(discrete, noise))
        self._predict = prediction(self._setting)
        self._bound: dict[Any, Bound] = {}
        self._pairs: dict[tuple[str, ...], Pair] = {}

    def predict(self, est: Estimate, u: Sequence[float] | np.ndarray) -> Estimate:
        """The estimate a step later, under the command u; re-centred where a coordinate asks.

        A step that fails leaves x, P and theta, and says so in `failure`.

        Raises:
            ModelError: an array of a wrong shape.
        """
        bound = self._compiled("predict", self._predict)
        x, P, status = bound(est.x, est.P, u, est.theta)
        if status[0] != 0 or not np.all(np.isfinite(np.diag(P))):
            return est.failing("predict: the step did not converge to finite states")
        x, theta, T = self.discrete.recentre(x, est.theta)
        if theta is est.theta or np.array_equal(theta, est.theta):
            return est.replaced(x=x, P=P, failure="")
        n = len(x)
        P[:n] = T @ P[:n]
        P[:, :n] = P[:, :n] @ T.T
        P = (P + P.T) / 2
        return est.replaced(x=x, P=P, theta=theta, failure="", recentred=est.recentred + 1)

    def update(
        self,
        est: Estimate,
        y: Sequence[float] | np.ndarray,
        sensor: str | Sequence[str],
        u: Sequence[float] | np.ndarray,
    ) -> Estimate:
        """The estimate with a measurement taken in.

        Readings that are not finite numbers are left out and counted in `skipped`; a measurement
        beyond the gate changes nothing and is counted in `gated`.

        Args:
            est: the estimate at the instant of the measurement.
            y: readings, shape (n_y,).
            sensor: what was read: a name, or several read at the same instant, their readings one
                after the other.
            u: command at the instant.

        Raises:
            ModelError: an unknown sensor, or an array of a wrong shape.
        """
        names = names_of(sensor)
        bound = self._compiled(names, self._correction(names))
        x, P, theta, nis, used, believed = bound(est.x, est.P, u, est.theta, y)
        skipped = est.skipped + len(np.atleast_1d(y)) - int(used[0])
        counts = {"nis": float(nis[0]), "used": int(used[0]), "believed": bool(believed[0])}
        if not (np.all(np.isfinite(x)) and np.all(np.isfinite(np.diag(P)))):
            failure = f"update with {'+'.join(names)}: the result is not finite"
            return est.failing(failure, skipped=skipped)
        if not counts["believed"]:
            return est.replaced(skipped=skipped, gated=est.gated + 1, failure="", **counts)
        return est.replaced(x=x, P=P, theta=theta, skipped=skipped, failure="", **counts)

    def functions(self, *sensors: str | Sequence[str]) -> dict[str, Exposed]:
        """Prediction and updates for `dtcasadi.export_c`: predict, update_<sensor>.

        Args:
            sensors: names, or tuples of names read at the same instant (update_<a>_<b>); default:
                each of the model's.
        """
        found = {"predict": exposed("predict", *self._predict, title="the estimate a step later")}
        for sensor in sensors or tuple(self.discrete.sensors):
            names = names_of(sensor)
            name, title = f"update_{'_'.join(names)}", f"the estimate with {' and '.join(names)}"
            found[name] = exposed(name, *self._correction(names), title=title)
        return found

    def _correction(self, names: tuple[str, ...]) -> Pair:
        if names not in self._pairs:
            sensor = self.discrete.together(names)
            how = Update(limits_of(self._gate, sensor.n_y), self._iterations, self._caution)
            name = f"update_{'_'.join(names)}"
            self._pairs[names] = correction(self._setting, sensor, how, name)
        return self._pairs[names]

    def _compiled(self, key: Any, pair: Pair) -> Bound:
        if key not in self._bound:
            function = twin(pair.plain, source=pair.native)
            self._bound[key] = Bound(function, matrices={"P", "P_next"})
        return self._bound[key]
