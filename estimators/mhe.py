"""The moving horizon estimator of a discrete model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from dtcasadi import checks
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.waist import Discrete

from .augmented import layout_of, noise_of, pushed_by
from .base import Estimate, ProcessNoise, names_of, refusal
from .bounds import Bounded, limits_on
from .ekf import EKF
from .stage import stage
from .steps import Setting, raised_by
from .window import Passed, Window, backwards, stationarity

WINDOW = 20


@dataclass(frozen=True, eq=False)
class MovingEstimate(Estimate):
    """An estimate with the window it comes from.

    Attributes:
        window: the last steps; `window.z` are their estimates, from readings before and after.
        active: bounds that hold, over all steps of the window.
        residual: of the optimality conditions of the last least-squares problem, the largest, in
            standard deviations: stationarity, bounds, complementarity.
    """

    window: Window = field(default_factory=Window.empty)
    active: int = 0
    residual: float = 0.0


class _Step(NamedTuple):
    """The path after a Gauss-Newton step, the covariance of its end, and how it went."""

    z: np.ndarray
    P: np.ndarray
    active: int
    residual: float


class MHE:
    r"""Moving horizon estimator for x and for any blocks of theta, with bounds.

    At each measurement one Gauss-Newton step on the most likely path through the last `window`
    steps, from the path of the step before, moved on by a step (real-time iteration):

    .. math::
        \min\ |z_0 - \bar z|^2_{\bar P^{-1}} + \sum_k |w_k|^2_{Q^{-1}}
        + |y_k - h(z_k, u_k)|^2_{R^{-1}},\quad z_{k+1} = f(z_k, u_k) + w_k,\quad lo \le z_k \le up

    All steps are decision variables (multiple shooting), linearized where they are. Arrival cost:
    mean and covariance of the extended Kalman filter that saw what is older than the window, its
    readings linearized where they were predicted, its motion at the estimate from a whole window of
    later readings (Rao, Rawlings, Lee 2001; Rawlings, Mayne, Diehl, Model Predictive Control, 2nd
    ed., section 4.3). Without bounds the problem is solved by a Kalman filter forwards and its
    costates back (`estimators.window`): the work grows with the window's length, nothing is
    condensed, and P and Q may be singular. Where the result leaves the bounds, a quadratic program
    in as many unknowns as bounded numbers follows (`estimators.bounds`). On a linear model without
    bounds it is the Kalman filter.

    Verbs and arguments are those of `EKF`, which predicts and gates. P of an estimate is that of
    the problem without bounds. Bounds hold after each update with a finite reading, not in between.
    When the coordinates are re-centred the window starts anew, the prediction its arrival cost.

    Attributes:
        discrete: the model.
        start: the estimate at the beginning.
        names: one name for each estimated number, shape (n_z,).
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
        window: int = WINDOW,
        iterations: int = 1,
        caution: int = 0,
        bounds: Mapping[str, Any] | None = None,
        theta: np.ndarray | None = None,
    ):
        """Check, and build what goes over the window.

        Args:
            discrete: the model with its sensors.
            x0: states at the beginning, shape (n_x,).
            P0: their covariance, or its diagonal, as in `EKF`.
            Q_w: process noise, as in `EKF`.
            augment: blocks of theta to estimate besides x.
            gate: chance that a good measurement is refused as an outlier; None: all are believed.
            window: number of steps between the window's ends.
            iterations: Gauss-Newton steps at each measurement.
            caution: how often a Gauss-Newton step is done again with the noise of every reading in
                the window raised by the square of what its linearization left out, as in `EKF`;
                where that is below a tenth of the noise nothing is done again.
            bounds: name of a state, of an entry (`wrench[2]`) or of a block of theta -> (lower,
                upper), each one number or one for each entry; infinite: none.
            theta: parameters, shape (n_theta,); default: the model's own.

        Raises:
            EstimationError: an argument cannot be used; the text says what was expected.
        """
        if not discrete.sensors:
            raise refusal("discrete.sensors", "at least one sensor", "none")
        layout = layout_of(discrete, augment)
        known: dict[str, Any] = {"x0": x0, "P0": P0, "Q_w": Q_w, "augment": augment, "theta": theta}
        self._ekf = EKF(discrete, gate=gate, **known)
        self.discrete, self.names = discrete, layout.names
        self._free = np.array(layout.free, dtype=int)
        self._steps = checks.index("window", window, 1, 1000, error=refusal)
        self._iterations = checks.index("iterations", iterations, 1, 20, error=refusal)
        self._caution = checks.index("caution", caution, 0, 20, error=refusal)
        self._bounded = Bounded(limits_on(discrete, layout, bounds or {}), self._steps + 1)
        Q, noise = noise_of(discrete, layout, augment, Q_w)
        setting = Setting(discrete, layout.free, Q, *pushed_by(discrete, noise))
        sensors = discrete.together(tuple(discrete.sensors))
        self._R = np.array(sensors.R_v)
        self._output = Bound(twin(sensors.output))
        pair = stage(setting, sensors)
        self._stage = Bound(twin(pair.plain, source=pair.native), matrices=_MATRICES)
        ends = np.cumsum([0, *(s.n_y for s in discrete.sensors.values())])
        self._places = {
            name: np.arange(*ends[k : k + 2]) for k, name in enumerate(discrete.sensors)
        }
        self._n_u = discrete.linearize.size1_in("u")
        start = self._ekf.start
        self.start = MovingEstimate(**{**vars(start), "window": self._fresh(start)})

    def predict(self, est: Estimate, u: Sequence[float] | np.ndarray) -> MovingEstimate:
        """The estimate a step later, as in `EKF.predict`; the window moves on.

        Raises:
            ModelError: an array of a wrong shape.
            EstimationError: the estimate of another filter.
        """
        found = _own(self._ekf.predict(_own(est), u))
        if found.failure:
            return found
        if found.recentred > est.recentred:
            return _own(found.replaced(window=self._fresh(found), active=0))
        window = found.window
        if len(window) > self._steps:
            first = self._first(window, found.theta)
            if first.status[0] != 0 or not _finite(first.follow, first.P_next):
                return _own(found.replaced(window=self._fresh(found), active=0))
            window = window.later(first.follow, first.P_next)
        longer = window.longer(self._packed(found), np.asarray(u, dtype=float))
        return _own(found.replaced(window=longer))

    def update(
        self,
        est: Estimate,
        y: Sequence[float] | np.ndarray,
        sensor: str | Sequence[str],
        u: Sequence[float] | np.ndarray,
    ) -> MovingEstimate:
        """The estimate with a measurement taken in, as in `EKF.update`; the window is solved.

        Where that fails, x, P and theta stay, `failure` says why, and the window starts anew.

        Raises:
            ModelError: an unknown sensor, or an array of a wrong shape.
            EstimationError: the estimate of another filter.
        """
        est, names = _own(est), names_of(sensor)
        filtered = _own(self._ekf.update(est, y, sensor, u))
        if filtered.failure or not filtered.believed or not filtered.used:
            return filtered
        place = np.concatenate([self._places[name] for name in names])
        y, u = np.atleast_1d(np.asarray(y, dtype=float)), np.asarray(u, dtype=float)
        window = est.window.reading(y, place, u)
        step = self._improved(window, est.theta)
        for _ in range(self._iterations - 1):
            if not isinstance(step, str):
                step = self._improved(replace(window, z=step.z), est.theta)
        if isinstance(step, str):
            failure = f"update with {'+'.join(names)}: {step}"
            fresh = {"window": self._fresh(est), "active": 0}
            return _own(est.failing(failure, skipped=filtered.skipped, used=filtered.used, **fresh))
        window = replace(window, z=step.z)
        entry, lower, upper = self._bounded.limits
        z = window.z[-1].copy()
        z[entry] = np.clip(z[entry], lower, upper)
        theta = est.theta.copy()
        theta[self._free] = z[len(est.x) :]
        found = {"x": z[: len(est.x)], "P": step.P, "theta": theta, "window": window}
        return _own(filtered.replaced(active=step.active, residual=step.residual, **found))

    def _first(self, window: Window, theta: np.ndarray) -> Any:
        """What `stage.stage` gives at the first step of a window, which is going to leave it.

        Its readings are linearized where they were predicted. The estimate of the whole window has
        seen them: derivatives there go with their noise, a bias that adds up step by step to more
        than the covariance says. Only where the prediction was so far off that linearizing leaves
        out more than the noise, the whole window's estimate is taken.
        """
        z, ahead, mean, P = window.z[0], window.predicted[0], window.mean, window.P
        u, none = window.u[0], np.zeros(window.y.shape[1])
        early = replace(window, z=window.predicted)
        read = self._at(early, 0, mean - ahead, P, u, theta, none)
        left_out = self._beyond(ahead, z - ahead, window.u_read[0], read.H, theta) ** 2
        near = left_out <= np.diag(self._R) / window.count[0]
        if np.all(near | ~np.isfinite(window.y[0])) and _finite(read.d, read.P_d):
            mean, P = ahead + read.d, read.P_d
            window = replace(window, y=np.full_like(window.y, np.nan))
        return self._at(window, 0, mean - z, P, u, theta, none)

    def _improved(self, window: Window, theta: np.ndarray) -> _Step | str:
        """A Gauss-Newton step on a window, or why there is none."""
        passed = self._cautious(window, theta)
        if isinstance(passed, str):
            return passed
        free = backwards(passed)
        kept = self._bounded.kept(passed, free, window.z)
        if kept.failure:
            return kept.failure
        if not _finite(kept.d):
            return "the path is not finite"
        residual = max(kept.worst, stationarity(passed, free))
        return _Step(window.z + kept.d, passed.P_d[-1], kept.active, residual)

    def _cautious(self, window: Window, theta: np.ndarray) -> Passed | str:
        """The filter's pass with noise raised by what linearizing leaves out, if asked for."""
        raised, read = np.zeros(window.y.shape), np.isfinite(window.y)
        passed = self._passed(window, theta, raised)
        for _ in range(self._caution):
            if isinstance(passed, str):
                break
            left_out = np.where(read, self._left_out(window, passed, theta), 0.0)
            more = raised_by(left_out, np.diag(self._R), raised)
            if more is None:
                break
            raised = more
            passed = self._passed(window, theta, raised)
        return passed

    def _left_out(self, window: Window, passed: Passed, theta: np.ndarray) -> np.ndarray:
        """What linearizing the readings of every step leaves out, shape (k + 1, n_y)."""
        parts = zip(window.z, backwards(passed).d, window.u_read, passed.H, strict=True)
        return np.array([self._beyond(*part, theta) for part in parts])

    def _beyond(
        self, z: np.ndarray, d: np.ndarray, u: np.ndarray, H: np.ndarray, theta: np.ndarray
    ) -> np.ndarray:
        """h(z + d) - h(z) - H d, shape (n_y,)."""
        n, ends = len(self.discrete.state_names), []
        for at in (z, z + d):
            own = theta.copy()
            own[self._free] = at[n:]
            ends.append(self._output(at[:n], u, own))
        return np.asarray(ends[1] - ends[0] - H @ d)

    def _passed(self, window: Window, theta: np.ndarray, raised: np.ndarray) -> Passed | str:
        """The filter's pass over a window, or why there is none."""
        m, P, last = window.mean - window.z[0], window.P, len(window) - 1
        found = Passed([], [], [], [], [], [], [], [])
        for k in range(last + 1):
            u = window.u[k] if k < last else window.u_read[k]
            at = self._at(window, k, m, P, u, theta, raised[k])
            parts = (m, P, at.F, at.H, at.SH, at.Se, at.d, at.P_d)
            for kept, part in zip(found, parts, strict=True):
                kept.append(part)
            if not _finite(at.d, at.P_d):
                return "the readings' derivatives are not finite"
            if k < last:
                if at.status[0] != 0 or not _finite(at.follow, at.P_next):
                    return "a step of the window did not converge to finite states"
                m, P = at.follow - window.z[k + 1], at.P_next
        return found

    def _at(
        self,
        w: Window,
        k: int,
        m: np.ndarray,
        P: np.ndarray,
        u: np.ndarray,
        theta: np.ndarray,
        raised: np.ndarray,
    ) -> Any:
        """What `stage.stage` gives at step k, the variances of its readings raised."""
        R = self._R
        if raised.any():
            R = R + np.diag(raised)
        if np.any(w.count[k] > 1):
            share = 1 / np.sqrt(w.count[k])
            R = R * np.outer(share, share)
        return self._stage(w.z[k], m, P, u, w.u_read[k], theta, w.y[k], R)

    def _packed(self, est: Estimate) -> np.ndarray:
        return np.concatenate([est.x, est.theta[self._free]])

    def _fresh(self, est: Estimate) -> Window:
        """A window that starts at an estimate."""
        return Window.starting(self._packed(est), est.P, self._n_u, len(self._R))


_MATRICES = {"P", "R", "P_d", "F", "H", "SH", "P_next"}


def _finite(*arrays: np.ndarray) -> bool:
    # A sum is finite where its terms are, unless it overflows, which is no estimate either.
    return all(math.isfinite(array.sum()) for array in arrays)


def _own(est: Estimate) -> MovingEstimate:
    if not isinstance(est, MovingEstimate):
        raise refusal("est", "an estimate of this estimator", type(est).__name__)
    return est
