"""The problem of identification: a discrete model, its free parameters, experiments, nodes.

    min  sum_k || L^-1 (h(x_k, u_k, theta) - y_k) ||^2 + priors      x_{k+1} = f(x_k, u_k, theta)

with R_v = L L^T. The unknowns are the parameters and the states at the nodes of multiple shooting
(Bock 1983, "Recent advances in parameter identification techniques for ODE"): between nodes the
model runs, at each node the motion has to go on without a jump.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..bound import Bound
from ..compile import twin
from ..errors import IdentificationError
from ..measuring import Sensor
from ..waist import Discrete
from .data import Data, Experiment, Wanted, gridded, sensors_in
from .parameters import Parameter, parameters_of, theta_of
from .settings import Settings


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be solved, compiled.

    Attributes:
        discrete: the model.
        parameters: what is free.
        theta0: all parameters with the free ones at their start, shape (n_theta,).
        data: the experiments.
        nodes: steps of the shooting nodes of each, the first 0.
        sensors: names of those that are read.
        names: channels, as logs have them.
        units: of the channels.
        R_v: covariance of a reading of all channels.
        settings: how to search.
        step: x, u, theta -> x_next, F_x, F_theta of the free entries, status.
        read: x, u, theta -> y, H_x, H_theta of the free entries.
        entries: the free entries of theta.
        spread: how far states may be from where a run arrives, when nodes follow the data, (n_x,).
        build_s: time it took to build, compilation included [s].
    """

    discrete: Discrete
    parameters: tuple[Parameter, ...]
    theta0: np.ndarray
    data: tuple[Data, ...]
    nodes: tuple[tuple[int, ...], ...]
    sensors: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    R_v: np.ndarray
    settings: Settings
    step: Bound
    read: Bound
    entries: tuple[int, ...]
    spread: np.ndarray
    build_s: float

    @property
    def n_x(self) -> int:
        """Number of states."""
        return len(self.discrete.state_names)

    @property
    def n_p(self) -> int:
        """Number of free parameters."""
        return len(self.parameters)

    @property
    def recentres(self) -> bool:
        """Whether coordinates may be re-centred on the way."""
        return "frames" in self.discrete.theta_blocks

    def theta(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Theta at z, and the derivative of its free entries for z, shape (n_free, n_p)."""
        theta, S = theta_of(self.parameters, self.theta0, z)
        return theta, S[list(self.entries)]


def build(
    discrete: Discrete,
    experiments: Sequence[Experiment],
    free: Sequence[str],
    *,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
    settings: Settings | None = None,
    spread: Any = 1.0,
) -> Problem:
    """Check, compile and put the data on the model's steps.

    Args:
        discrete: the model with its sensors.
        experiments: logs and what is known of their first states.
        free: blocks of theta; `name[*]`: each number of one by itself.
        start: values to start at, by name.
        bounds: (lower, upper) by name.
        priors: (mean, standard deviation) by name.
        settings: how to search; default: `Settings()`.
        spread: how far states may be off where nodes follow the data, one number or (n_x,).

    Raises:
        IdentificationError: a setting that is not usable.
        LogError: a log that does not fit the model.
    """
    began = time.perf_counter()
    if isinstance(experiments, Experiment) or not experiments:
        got = "one" if experiments else "none"
        raise IdentificationError(f"experiments: expected a sequence of them, got {got}")
    settings = settings or Settings()
    options = {"start": start, "bounds": bounds, "priors": priors}
    parameters = parameters_of(discrete.theta0, discrete.theta_blocks, free, **options)
    used = sensors_in(tuple(discrete.sensors.values()), [each.log for each in experiments])
    wanted = wanted_of(discrete, used)
    sensor, n_x = wanted.sensor, wanted.n_x
    data = tuple(gridded(experiment, wanted) for experiment in experiments)
    theta0, _ = theta_of(parameters, discrete.theta0, np.zeros(len(parameters)))
    entries = tuple(sorted({entry for each in parameters for entry in each.entries}))
    return Problem(
        discrete=discrete,
        parameters=parameters,
        theta0=theta0,
        data=data,
        nodes=tuple(node_steps(each.n, settings.nodes) for each in data),
        sensors=used,
        names=wanted.names,
        units=tuple(unit for _, unit in sensor.channels),
        R_v=np.asarray(sensor.R_v),
        settings=settings,
        step=_compiled(_step, discrete, entries),
        read=_compiled(_read, sensor, entries),
        entries=entries,
        spread=np.array(np.broadcast_to(np.asarray(spread, dtype=float), (n_x,))),
        build_s=time.perf_counter() - began,
    )


def wanted_of(discrete: Discrete, sensors: Sequence[str]) -> Wanted:
    """What the model asks of a log, reading some of its sensors."""
    sensor = discrete.together(sensors)
    each = [(name, channel) for name in sensors for channel, _ in discrete.sensors[name].channels]
    names = tuple(f"{name}.{channel}" for name, channel in each)
    sizes = discrete.linearize_checked.size1_in("u"), len(discrete.state_names)
    return Wanted(discrete.step_s, sensor, names, *sizes, _command_unit(discrete))


def node_steps(n: int, count: int) -> tuple[int, ...]:
    """Steps of the nodes, evenly spread, the first 0 and none at the end."""
    return tuple(sorted({round(k * n / count) for k in range(min(count, n))}))


def _command_unit(discrete: Discrete) -> str | None:
    """The unit of a robot's commands; None where the model does not tell."""
    model = getattr(discrete, "model", None)
    if model is None:
        return None
    return "Pa" if model.actuator.command == "pressure" else ""


def _compiled(make: Any, owner: Any, entries: tuple[int, ...]) -> Bound:
    plain, native = (make(owner, entries, native=native) for native in (False, True))
    matrices = {name for name in plain.name_out() if name[0] in "FH"}
    return Bound(twin(plain, source=native), matrices=matrices)


def _step(discrete: Discrete, entries: tuple[int, ...], *, native: bool) -> ca.Function:
    """The step with derivatives for x and the free entries of theta only."""
    name = "linearize_checked"
    source = discrete.native(name) if native else discrete.linearize_checked
    ports = [ca.MX.sym(port, source.size1_in(port)) for port in source.name_in()]
    # Inlined, so that derivatives nobody asks for are not computed.
    x_next, F_x, _, F_theta, status = source.call(ports, True, False)
    outputs = {"x_next": x_next, "F_x": F_x, "F_theta": F_theta[:, list(entries)], "status": status}
    return _function("identify_step", ports, source.name_in(), outputs)


def _read(sensor: Sensor, entries: tuple[int, ...], *, native: bool) -> ca.Function:
    """The readings with derivatives for x and the free entries of theta."""
    source = sensor.native if native else sensor.linearize
    ports = [ca.MX.sym(port, source.size1_in(port)) for port in source.name_in()]
    y, H_x, H_theta = source.call(ports, True, False)
    outputs = {"y": y, "H_x": H_x, "H_theta": H_theta[:, list(entries)]}
    return _function("identify_read", ports, source.name_in(), outputs)


def _function(name: str, ports: list, names: list[str], outputs: dict[str, Any]) -> ca.Function:
    values = [ca.densify(value) for value in outputs.values()]
    return ca.Function(name, ports, values, names, [*outputs], {"cse": True})
