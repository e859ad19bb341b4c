"""The closed loop: a controller, any estimator, and a plant that is not the controller's model."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.errors import ControlError

from .base import Discrete
from .problem import refusal
from .stages import Stages


class Told(Protocol):
    """What a controller says of a step."""

    @property
    def plan(self) -> np.ndarray:
        """Commands ahead, shape (N, n_u)."""

    @property
    def states(self) -> np.ndarray:
        """Predicted states, shape (N + 1, n_x); zero without a prediction."""

    @property
    def text(self) -> str:
        """How it went, a line for people."""


class Controller(Protocol):
    """What can be run: `PressureMPC`, or another controller of the same function."""

    def step(self, estimate: Any, *, reference: Any = None) -> tuple[np.ndarray, Told]:
        """The next command, and what was found."""


class Estimator(Protocol):
    """What knows the state: an object with these functions, such as `estimators.EKF`."""

    @property
    def start(self) -> Any:
        """The estimate at the beginning, with `x` and `theta`."""

    @property
    def discrete(self) -> Any:
        """Its model: its step and its sensors."""

    def predict(self, est: Any, u: Any) -> Any:
        """The estimate a step later."""

    def update(self, est: Any, y: Any, sensor: Any, u: Any) -> Any:
        """The estimate with a measurement taken in."""


class Known(NamedTuple):
    """An estimate that is the truth."""

    x: np.ndarray
    theta: np.ndarray


@dataclass(frozen=True, eq=False)
class Plant:
    """What is controlled.

    Attributes:
        discrete: its model, in short steps, with the sensors that are tracked and measured.
        x0: states at the start.
        changes: time [s] -> block of theta -> its values then, such as an external load.
        delay_s: a command acts this long after it is given [s].
        u0: the command in force at the start, shape (n_u,) [Pa].
        seed: of the sensors' noise; None: they have none.
    """

    discrete: Discrete
    x0: np.ndarray
    u0: np.ndarray
    changes: Callable[[float], Mapping[str, Any]] = lambda t: {}
    delay_s: float = 0.0
    seed: int | None = 0


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop's log, at every call of the controller.

    Attributes:
        stages: the controller's problem.
        t: times, shape (n,) [s].
        y: true outputs, shape (n, n_r).
        reference: what they were to be, shape (n, n_r).
        u: commands, shape (n, n_u) [Pa].
        x: the plant's states, shape (n, n_x of the plant).
        theta: the plant's parameters, shape (n, n_theta of the plant).
        estimate: what the controller was given, one for each call.
        told: what it said.
        seconds: time of each call [s].
        predict: predicted outputs of a call's plan, by its number; see `predicted`.
    """

    stages: Stages
    t: np.ndarray
    y: np.ndarray
    reference: np.ndarray
    u: np.ndarray
    x: np.ndarray
    theta: np.ndarray
    estimate: tuple[Any, ...]
    told: tuple[Told, ...]
    seconds: np.ndarray
    u0: np.ndarray

    def predicted(self, k: int) -> np.ndarray | None:
        """Outputs of the plan of call k at its steps, shape (N + 1, n_r); None without a plan."""
        told, stages = self.told[k], self.stages
        if len(told.states) != stages.horizon + 1 or not np.any(told.states):
            return None
        none, theta = np.zeros(len(stages.channels)), self.estimate[k].theta
        return np.array([np.array(stages.residual(x, theta, none)).ravel() for x in told.states])

    @property
    def error(self) -> np.ndarray:
        """What is missing, y - reference, shape (n, n_r)."""
        return self.y - self.reference

    def rms(self, t_from: float = 0.0, t_to: float = np.inf) -> float:
        """Root of the mean square of |y - reference| over a span of time."""
        inside = (self.t >= t_from) & (self.t <= t_to)
        return float(np.sqrt(np.mean(np.sum(self.error[inside] ** 2, axis=1))))

    def steady(self, t_from: float, t_to: float) -> float:
        """|mean of y - reference| over a span of time: what integrates, not noise."""
        inside = (self.t >= t_from) & (self.t <= t_to)
        return float(np.linalg.norm(np.mean(self.error[inside], axis=0)))

    @property
    def violations(self) -> int:
        """Calls whose command was beyond a limit or a rate limit."""
        s = self.stages
        change = np.abs(np.diff(self.u, axis=0, prepend=self.u0[None]))
        span = np.maximum(np.abs(self.u), 1.0)
        slack = 1e-9 * span  # round-off of a sum of commands
        over = (self.u > s.upper[0] + slack) | (self.u < s.lower[0] - slack)
        return int(np.sum(np.any(over | (change > s.rate[0] + slack), axis=1)))

    @property
    def cost(self) -> float:
        """J of what happened: tracking and changes of the commands, with the first weights."""
        s = self.stages
        change = np.diff(self.u, axis=0, prepend=self.u0[None])
        tracked = np.sum(s.weight[0] * self.error**2)
        return float(tracked + np.sum(s.change[0] * change**2))


def closed_loop(
    controller: Controller,
    plant: Plant,
    stages: Stages,
    *,
    t_end: float,
    estimator: Estimator | None = None,
    measured: Sequence[str] | None = None,
) -> Loop:
    """Run a controller on a plant.

    Args:
        controller: called every step of the problem's model.
        plant: what is controlled; its step divides the estimator's, and that the controller's.
        stages: the problem: outputs and references.
        t_end: duration [s].
        estimator: what the controller is told the state by; None: it is told the plant's own, which
            then must be of the controller's model.
        measured: names of the estimator's sensors that are read; default: all.

    Raises:
        ControlError: steps that do not divide, a plant without an output, or one whose step fails.
    """
    return _Run(controller, plant, stages, estimator, measured).to(t_end)


class _Run:
    """A loop while it runs."""

    def __init__(
        self,
        controller: Controller,
        plant: Plant,
        stages: Stages,
        estimator: Estimator | None,
        measured: Sequence[str] | None,
    ):
        self._controller, self._plant, self._stages = controller, plant, stages
        self._estimator = estimator
        h = stages.discrete.step_s
        between = estimator.discrete.step_s if estimator else h
        self._calls = _ratio("estimator.step_s", h, between)
        self._steps = _ratio("plant.step_s", between, plant.discrete.step_s)
        self._between = between
        tracked = [term.output for term in stages.problem.tracking]
        wanted = list(estimator.discrete.sensors) if estimator and measured is None else measured
        self._measured = tuple(wanted or ()) if estimator else ()
        for name in (*tracked, *self._measured):
            if name not in plant.discrete.sensors:
                raise refusal("plant", f"a plant with the sensor {name!r}", "one without")
        names = dict.fromkeys((*tracked, *self._measured))
        sensors = plant.discrete.sensors
        self._read = {name: Bound(twin(sensors[name].output)) for name in names}
        self._step = Bound(twin(plant.discrete.step, source=plant.discrete.native("step")))
        self._rng = None if plant.seed is None else np.random.default_rng(plant.seed)
        self._late = round(plant.delay_s / plant.discrete.step_s)
        self._queue = [plant.u0] * self._late

    def to(self, t_end: float) -> Loop:
        """Run it."""
        plant, h = self._plant, self._stages.discrete.step_s
        x, theta = np.array(plant.x0, float), np.array(plant.discrete.theta0)
        u = np.array(plant.u0, dtype=float)
        acting = u
        est = self._estimator.start if self._estimator else None
        rows: list[tuple] = []
        for k in range(round(t_end / h) + 1):
            t = k * h
            theta = self._changed(theta, t)
            est = Known(x, theta) if self._estimator is None else self._seen(est, k, 0, x, theta, u)
            references = self._stages.references(t)
            start = time.perf_counter()
            u, told = self._controller.step(est, reference=references)
            seconds = time.perf_counter() - start
            y = self._outputs(x, acting, theta)
            rows.append((t, y, references[0], u, x, theta, est, told, seconds))
            for j in range(self._calls):
                if j:
                    est = self._seen(est, k, j, x, theta, u)
                x, theta, acting = self._advanced(x, theta, u, t + j * self._between)
                if self._estimator is not None:
                    est = self._estimator.predict(est, u)
        parts = list(zip(*rows, strict=True))
        times, y, reference, u_all, x_all, theta_all = (np.array(part) for part in parts[:6])
        return Loop(
            self._stages,
            t=times,
            y=y,
            reference=reference,
            u=u_all,
            x=x_all,
            theta=theta_all,
            estimate=parts[6],
            told=parts[7],
            seconds=np.array(parts[8]),
            u0=np.asarray(plant.u0, dtype=float),
        )

    def _advanced(
        self, x: np.ndarray, theta: np.ndarray, u: np.ndarray, t: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        acting = u
        for i in range(self._steps):
            theta = self._changed(theta, t + i * self._plant.discrete.step_s)
            self._queue.append(u)
            acting = self._queue.pop(0)
            x, status = self._step(x, acting, theta)
            if status[0] != 0 or not np.all(np.isfinite(x)):
                raise ControlError(f"plant: the step at {t:.6g} s is not finite or not converged")
            x, theta, _ = self._plant.discrete.recentre(x, theta)
        return x, theta, acting

    def _changed(self, theta: np.ndarray, t: float) -> np.ndarray:
        blocks = self._plant.discrete.theta_blocks
        for name, values in self._plant.changes(t).items():
            theta = theta.copy()
            theta[blocks[name]] = values
        return theta

    def _outputs(self, x: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """True values of the tracked channels."""
        parts = []
        for term, picked in self._stages.tracked:
            y = np.atleast_1d(self._read[term](x, u, theta))
            parts.append(y[picked])
        return np.concatenate([np.zeros(0), *parts])

    def _seen(
        self, est: Any, k: int, j: int, x: np.ndarray, theta: np.ndarray, u: np.ndarray
    ) -> Any:
        """The estimate with the samples of this instant."""
        assert self._estimator is not None
        now = k * self._calls + j
        for name in self._measured:
            sensor = self._estimator.discrete.sensors[name]
            every = round((sensor.period_s or self._between) / self._between) or 1
            if now % every:
                continue
            y = np.atleast_1d(self._read[name](x, u, theta))
            if self._rng is not None:
                y = y + self._rng.multivariate_normal(np.zeros(len(y)), sensor.R_v)
                if self._rng.random() < sensor.dropout:
                    continue
            est = self._estimator.update(est, y, name, u)
        return est


def _ratio(name: str, long: float, short: float) -> int:
    n = round(long / short)
    if n < 1 or abs(n * short - long) > 1e-9 * long:
        raise refusal(name, f"a step that divides {long:g} s", f"{short:g} s")
    return n
