"""Sensors of a model as Functions with derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from .actuation import observed
from .errors import ModelError
from .graphs import OPTIONS, Graphs
from .integrators.step import At, Plant, first_order
from .integrators.steppers import plant_in
from .sampled import Sampled, Seen

if TYPE_CHECKING:
    from .model import Model


@dataclass(frozen=True, eq=False)
class Sensor:
    """One sensor, or several read at the same instant, of a `DiscreteModel`.

    Attributes:
        name: its name, or the names joined by `+`.
        output: Function x (n_x,), u (n_u,), theta (n_theta,) -> y (n_y,).
        linearize: Function x, u, theta -> y, H_x (n_y, n_x), H_theta (n_y, n_theta), zero for the
            block `frames`.
        native: the same with hand-written C kernels inside, for code generation only.
        R_v: covariance of the noise, shape (n_y, n_y).
        channels: name and unit of each entry of y.
        period_s: time between samples [s]; None: every step.
        latency_s: delay of a sample [s].
        dropout: share of the samples that get lost.
    """

    name: str
    output: ca.Function
    linearize: ca.Function
    native: ca.Function
    R_v: np.ndarray
    channels: tuple[tuple[str, str], ...]
    period_s: float | None = None
    latency_s: float = 0.0
    dropout: float = 0.0

    @property
    def n_y(self) -> int:
        """Number of readings."""
        return len(self.channels)


class Layout(NamedTuple):
    """Theta of a discrete model: the model's, then the biases of its sensors."""

    n_model: int
    blocks: Mapping[str, slice]
    values: np.ndarray

    @property
    def n(self) -> int:
        """Length of all of theta."""
        return len(self.values)


def layout_of(model: Model, sensors: Sequence[Sampled]) -> Layout:
    """Where the biases of the sensors lie behind a model's theta.

    Raises:
        ModelError: two sensors of one name, a sensor that the robot cannot have, or no sensor.
    """
    theta0 = model.theta0
    all_blocks, size = dict(model.theta_blocks), len(theta0)
    names = []
    for sensor in sensors:
        if not isinstance(sensor, Sampled):
            raise ModelError(f"sensors: expected values of dtcasadi.sensors, got {sensor!r}")
        if sensor.name in names:
            raise ModelError(f"sensors: expected different names, got {sensor.name!r} twice")
        sensor.check(model.robot)
        names.append(sensor.name)
        if sensor.n_bias:
            all_blocks[f"{sensor.name}.bias"] = slice(size, size + sensor.n_bias)
            size += sensor.n_bias
    values = np.concatenate([theta0, np.zeros(size - len(theta0))])
    values.flags.writeable = False
    return Layout(len(theta0), all_blocks, values)


class Measured(NamedTuple):
    """The Functions of readings taken together."""

    output: ca.Function
    linearize: ca.Function


def measured(g: Graphs, plant: Plant, sensors: Sequence[Sampled], layout: Layout) -> Measured:
    """Readings and their derivatives at x, u, theta.

    The readings' own derivatives, for (q, qd, qdd, pressure, theta), are those of the recursion
    along the chain; qdd and its derivatives come from the state equation.
    """
    reading = _reading(g, sensors)
    sym = plant.kind.sym
    x, u = sym("x", g.x.shape[0]), sym("u", g.u.shape[0])
    theta = sym("theta", layout.n)
    own, _ = ca.vertsplit(theta, [0, layout.n_model, layout.n])
    at = At(x, u, type(x)(u.shape[0], 1), type(x)(1, 1), own)
    values, slopes = _at_state(g, plant, at, reading)
    bias, by_bias = _biases(theta, sensors, layout, plant)
    ports, names = [x, u, theta], ["x", "u", "theta"]
    y = ca.densify(values + bias)
    H_x, H_theta = slopes
    n_frames = g.n_frames
    H_theta = ca.horzcat(plant.kind(y.shape[0], n_frames), H_theta, by_bias)
    blocks = [y, ca.densify(H_x), ca.densify(H_theta)]
    output = ca.Function("output", ports, [y], names, ["y"], OPTIONS)
    linearize = ca.Function("sensor", ports, blocks, names, ["y", "H_x", "H_theta"], OPTIONS)
    return Measured(output, linearize)


def _reading(g: Graphs, sensors: Sequence[Sampled]) -> ca.Function:
    """Values and their derivatives at (q, qd, qdd, pressure, theta)."""
    seen = Seen(g.chain, g.q, g.qd, g.qdd, g.pressure)
    y = ca.vertcat(*(sensor.reading(seen) for sensor in sensors))
    ports = [g.q, g.qd, g.qdd, g.pressure, g.theta]
    columns = [ca.jacobian(y, port) for port in ports[:4]]
    columns.append(ca.jacobian(y, g.theta)[:, g.n_frames :])
    return ca.Function("reading", ports, [y, *columns], OPTIONS)


def _at_state(
    g: Graphs, plant: Plant, at: At, reading: ca.Function
) -> tuple[ca.MX, tuple[ca.MX, ca.MX]]:
    """Values, and derivatives for x and for theta behind `frames`."""
    q, qd, _ = ca.vertsplit(at.x, plant.sizes)
    n, n_z = plant.form.n_q, plant.form.n_z
    feels, gauges = reading.nnz_out(3) > 0, reading.nnz_out(4) > 0
    qdd = plant.ode(at.x, at.u, at.theta)[n : 2 * n] if feels else at.zeros(n)
    given = _pressure(g)(at.x, at.u, at.theta) if gauges else [at.zeros(at.u.shape[0])]
    y, by_q, by_v, by_a, by_p, by_theta = reading(q, qd, qdd, given[0], at.theta)
    H_x = ca.horzcat(by_q, by_v, at.zeros(y.shape[0], n_z))
    if gauges:
        H_x = H_x + ca.mtimes(by_p, given[1])
        by_theta = by_theta + ca.mtimes(by_p, given[2])
    if feels:
        F_x, rest = first_order(plant, at)
        H_x = H_x + ca.mtimes(by_a, F_x[n : 2 * n, :])
        by_theta = by_theta + ca.mtimes(by_a, rest[n:, at.u.shape[0] :][:n, :])
    return y, (H_x, by_theta)


def _pressure(g: Graphs) -> ca.Function:
    """Gauge pressures at x, u, theta, with their derivatives for x and theta behind `frames`."""
    q, qd, z = ca.vertsplit(g.x, [0, g.chain.n_q, 2 * g.chain.n_q, g.x.shape[0]])
    value = observed(g, q, qd, z, g.u)[0].pressure
    slopes = [ca.jacobian(value, g.x), ca.jacobian(value, g.theta)[:, g.n_frames :]]
    return ca.Function("gauge_pressure", [g.x, g.u, g.theta], [value, *slopes], OPTIONS)


def _biases(
    theta: ca.MX, sensors: Sequence[Sampled], layout: Layout, plant: Plant
) -> tuple[ca.MX, ca.DM]:
    """Bias of each reading, and its derivative for the biases in theta."""
    n_y = sum(len(sensor.channels) for sensor in sensors)
    slope, row = np.zeros((n_y, layout.n - layout.n_model)), 0
    for sensor in sensors:
        if sensor.n_bias:
            first = layout.blocks[f"{sensor.name}.bias"].start - layout.n_model
            for k in range(sensor.n_bias):
                slope[row + k, first + k] = 1
        row += len(sensor.channels)
    matrix = ca.sparsify(ca.DM(slope))
    _, biases = ca.vertsplit(theta, [0, layout.n_model, layout.n])
    return ca.mtimes(matrix, biases) if matrix.nnz() else plant.kind(n_y, 1), matrix


def plants_of(model: Model) -> tuple[Plant, Plant]:
    """The model's graphs in the forms steps are built from: with C kernels, and without."""
    return plant_in(model, native=True), plant_in(model, native=False)


def sensor_of(model: Model, sensors: Sequence[Sampled], layout: Layout) -> Sensor:
    """Sensors of a model read together, as one."""
    pairs = zip(model.graphs, plants_of(model), strict=True)
    native, plain = (measured(*pair, sensors, layout) for pair in pairs)
    alone = len(sensors) == 1
    prefix = [""] if alone else [f"{sensor.name}." for sensor in sensors]
    R_v = np.array(ca.diagcat(*(ca.DM(sensor.R_v) for sensor in sensors)))
    R_v.flags.writeable = False
    return Sensor(
        name="+".join(sensor.name for sensor in sensors),
        output=plain.output,
        linearize=plain.linearize,
        native=native.linearize,
        R_v=R_v,
        channels=tuple(
            (first + channel, unit)
            for first, sensor in zip(prefix, sensors, strict=True)
            for channel, unit in sensor.channels
        ),
        period_s=sensors[0].period_s,
        latency_s=sensors[0].latency_s,
        dropout=sensors[0].dropout,
    )
