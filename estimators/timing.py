"""Time of a filter's step in compiled C, on the paper's four-disc robot: 30 states."""

from __future__ import annotations

import time
from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np

import dtcasadi as dtc
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.presets import seed_four_disc
from dtcasadi.sensors import Marker

from .base import ProcessNoise
from .covariance import predicted, updated
from .ekf import EKF
from .mhe import MHE, WINDOW, MovingEstimate
from .operating import operating_points
from .runner import Track
from .smoother import backwards
from .spv import SPV
from .ukf import UKF

STEP_S, PRESSURE = 0.005, 5.0
_PLACES = ((2, (0, 1, 0)), (3, (0, 1, 0)), (4, (0, 1, 0)), (4, (1, 1, 0)))
_CALLS, _REPEATS = 32, 60


class Case:
    """The robot with twelve measurements: four markers of three coordinates.

    Attributes:
        chart: its chart; `cardan` gives 30 states.
        wrench: whether a wrench on the last disc, 6 numbers, is estimated besides.
        method: of the step.
        exact: whether the step's derivative is exact.
    """

    def __init__(
        self, chart: str, *, wrench: bool = False, method: str = "ros2", exact: bool = False
    ):
        sensors = [
            Marker(name=f"m{k}", disc=disc, point=point, noise=0.01)
            for k, (disc, point) in enumerate(_PLACES, 1)
        ]
        model = dtc.build(seed_four_disc(), chart=chart, wrenches=(4,) if wrench else ())
        self.model, self.names = model, tuple(sensor.name for sensor in sensors)
        self.discrete = model.discrete(STEP_S, method=method, exact=exact, sensors=sensors)
        rest = dtc.equilibrium(model, PRESSURE)
        self.x = np.concatenate([rest.q, np.zeros(model.n_q)])
        self.u, self.theta = np.array([PRESSURE]), self.discrete.theta0
        self.augment = ("wrench",) if wrench else ()
        walk = {"wrench": 0.1} if wrench else {}
        self.noise = ProcessNoise(state=0.01, walk=walk)
        self.y = self.discrete.together(self.names).output(self.x, self.u, self.theta).full()[:, 0]

    def ekf(self) -> EKF:
        """The filter."""
        n_z = len(self.x) + 6 * len(self.augment)
        P0 = np.full(n_z, 1e-4)
        return EKF(self.discrete, x0=self.x, P0=P0, Q_w=self.noise, augment=self.augment)

    def ekf_us(self) -> dict[str, float]:
        """Time of predict and update [us], and of their parts."""
        ekf = self.ekf()
        n_x, n_z, n_y = len(self.x), len(ekf.names), len(self.y)
        functions = ekf.functions(self.names)
        predict, update = functions["predict"], functions["update_" + "_".join(self.names)]
        est = ekf.start
        x, u, theta = self.x, self.u, self.theta
        found = {
            "predict": us_per_call(predict.function, predict.source, x, est.P, u, theta),
            "update": us_per_call(update.function, update.source, x, est.P, u, theta, self.y),
        }
        name, sensor = "linearize_checked", self.discrete.together(self.names)
        native = self.discrete.native(name)
        found["linearization"] = us_per_call(self.discrete.plain(name), native, x, u, theta)
        found["sensors"] = us_per_call(sensor.linearize, sensor.native, x, u, theta)
        rng = np.random.default_rng(0)
        F, H = np.eye(n_x, n_z), rng.normal(size=(n_y, n_z))
        graphs = [
            _covariances(n_x, n_z, n_y, sensor.R_v, native=native) for native in (False, True)
        ]
        found["covariance"] = us_per_call(*graphs, F, est.P, H, np.zeros(n_y))
        found["us_per_step"] = found["predict"] + found["update"]
        return found

    def spv_us(self) -> float:
        """Time of predict and the four updates of the scheduled observer [us]."""
        points = operating_points(self.model, [PRESSURE], [1.6 * PRESSURE], n=5)
        spv = SPV(self.discrete, points, x0=self.x, Q_w=self.noise, augment=self.augment)
        functions = spv.functions()
        est, u = spv.start, self.u
        at, predict = (est.x, est.theta, est.schedule, u), functions["predict"]
        total = us_per_call(predict.function, predict.source, *at)
        for name, y in zip(self.names, np.split(self.y, len(self.names)), strict=True):
            update = functions[f"update_{name}"]
            total += us_per_call(update.function, update.source, *at, y)
        return total

    def ukf_us(self) -> float:
        """Time of predict and update of the unscented filter from Python, points on lanes [us]."""
        P0 = np.full(len(self.x) + 6 * len(self.augment), 1e-4)
        ukf = UKF(self.discrete, x0=self.x, P0=P0, Q_w=self.noise, augment=self.augment)

        def once() -> None:
            ukf.update(ukf.predict(ukf.start, self.u), self.y, self.names, self.u)

        return _least(once, 50)

    def mhe_us(self) -> float:
        """Time of predict and update of the moving horizon from Python, its window full [us]."""
        P0 = np.full(len(self.x) + 6 * len(self.augment), 1e-4)
        mhe = MHE(self.discrete, x0=self.x, P0=P0, Q_w=self.noise, augment=self.augment)
        est = mhe.start

        def stepped(est: MovingEstimate) -> MovingEstimate:
            return mhe.update(mhe.predict(est, self.u), self.y, self.names, self.u)

        for _ in range(WINDOW + 1):
            est = stepped(est)
        return _least(lambda: stepped(est), 50)

    def smoother_us(self) -> float:
        """Time of the smoother's way back for a step, from Python [us]."""
        ekf, n = self.ekf(), 20
        t, u = STEP_S * np.arange(n + 1), np.tile(self.u, (n + 1, 1))
        steady = Track(t, (ekf.start,) * (n + 1), u, ())
        return _least(lambda: backwards(ekf, steady), 5) / n

    def filterpy_us(self) -> float | None:
        """Time of filterpy's EKF on the same compiled step and sensors [us]; None without it."""
        try:
            make: Any = import_module("filterpy.kalman").ExtendedKalmanFilter
        except ImportError:
            return None
        sensor = self.discrete.together(self.names)
        step = self.discrete.compiled("linearize")
        read = Bound(twin(sensor.linearize, source=sensor.native), matrices={"H_x", "H_theta"})
        n_x = len(self.x)
        peer = make(n_x, len(self.y))
        peer.x, peer.P = self.x.copy(), 1e-4 * np.eye(n_x)
        peer.Q, peer.R = 1e-6 * np.eye(n_x), np.array(sensor.R_v)
        u, theta, y = self.u, self.theta, self.y

        def once() -> None:
            x_next, peer.F, _, _ = step(peer.x, u, theta)
            peer.predict()
            peer.x = x_next
            h, H, _ = read(peer.x, u, theta)
            peer.update(y, lambda _: H, lambda _: h)

        return _least(once, 50)


def _covariances(n_x: int, n_z: int, n_y: int, R: np.ndarray, *, native: bool) -> ca.Function:
    """Prediction and update of the covariance alone."""
    shapes = {"F": (n_x, n_z), "P": (n_z, n_z), "H": (n_y, n_z), "e": (n_y, 1)}
    F, P, H, e = (ca.MX.sym(name, *shape) for name, shape in shapes.items())
    P_next = predicted(F, ca.MX(n_x, 0), P, ca.MX(ca.DM.eye(n_z) * 1e-6), native=native)
    limits = np.full(n_y + 1, 1e300)
    found = updated(ca.MX(n_z, 1), P_next, e, H, ca.MX(ca.DM(R)), limits, native=native)
    outputs = [ca.densify(found.z), ca.densify(found.P)]
    return ca.Function("covariances", [F, P, H, e], outputs, [*shapes], ["z", "P_next"])


def us_per_call(plain: ca.Function, native: ca.Function | None, *arguments: Any) -> float:
    """Least time of a call of compiled C from a loop in C++ [us]."""
    many = twin(plain, source=native or plain).map(_CALLS)
    buffer, evaluate = many.buffer()
    kept: list[Any] = [np.tile(np.asarray(a, dtype=float).ravel("F"), _CALLS) for a in arguments]
    kept += [np.zeros(many.nnz_out(k)) for k in range(many.n_out())]
    for k, array in enumerate(kept):
        if k < len(arguments):
            buffer.set_arg(k, memoryview(array))
        else:
            buffer.set_res(k - len(arguments), memoryview(array))
    return _least(evaluate, _REPEATS) / _CALLS


def _least(call: Any, repeats: int) -> float:
    """Least time of a call [us]."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e6 * min(times)
