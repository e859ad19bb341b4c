"""The outputs of a problem: what is read of the state, and the functions of it that count."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from dtcasadi import checks
from dtcasadi.measuring import Sensor

from .base import Discrete
from .problem import Band, HalfSpace, Problem, Soft, refusal
from .rows import rows_of, weights_of

# |y - centre| has no slope at the centre; smoothed there within a nanometre.
_TINY = 1e-18


class Outputs:
    """The terms that read outputs, all sensors taken together so that they share what they can."""

    def __init__(self, discrete: Discrete, problem: Problem):
        self._discrete = discrete
        names = [term.output for term in (*problem.tracking, *problem.soft)]
        for kind, terms in (("tracking", problem.tracking), ("soft", problem.soft)):
            for i, term in enumerate(terms):
                _sensor(discrete, term.output, f"{kind}[{i + 1}].output")
        self._names = tuple(dict.fromkeys(names))
        sizes = [discrete.sensors[name].n_y for name in self._names]
        first = dict(zip(self._names, np.cumsum([0, *sizes]), strict=False))
        self._y = ca.SX.sym("y", sum(sizes))
        self._tracked: list[int] = []
        weights, channels = [], []
        N = problem.horizon
        for i, term in enumerate(problem.tracking):
            where = f"tracking[{i + 1}]"
            picked = picked_of(discrete, term.output, term.channels, f"{where}.channels")
            self._tracked += [int(first[term.output]) + k for k in picked]
            weights.append(weights_of(f"{where}.weight", term.weight, N + 1, len(picked)))
            channels += _labels(discrete, term.output, picked)
        self.weight = np.hstack(weights) if weights else np.zeros((N + 1, 0))
        if problem.terminal is not None:
            self.weight[-1] = 0.0
        self.channels = tuple(channels)
        self._limits: list[ca.SX] = []
        prices: list[tuple[float, float]] = []
        labels: list[tuple[str, str]] = []
        for i, limit in enumerate(problem.soft):
            where = f"soft[{i + 1}]"
            y = self._y[int(first[limit.output]) :][: discrete.sensors[limit.output].n_y]
            found, named = _inequality(discrete, limit, y, where)
            price = tuple(
                checks.number(f"{where}.{key}", value, nonnegative=True, error=refusal)
                for key, value in (("linear", limit.linear), ("quadratic", limit.quadratic))
            )
            if price[1] == 0:
                # Without curvature the slack is not unique where its price equals a multiplier.
                raise refusal(f"{where}.quadratic", "a positive price", 0)
            self._limits += found
            labels += named
            prices += [price] * len(found)  # type: ignore[list-item]
        self.limits = tuple(labels)
        self.linear = np.array([price[0] for price in prices])
        self.quadratic = np.array([price[1] for price in prices])

    def functions(self) -> dict[str, ca.Function]:
        """Residual, inequality and their derivatives for the state."""
        discrete = self._discrete
        x = ca.MX.sym("x", len(discrete.state_names))
        theta = ca.MX.sym("theta", len(discrete.theta0))
        reference = ca.MX.sym("reference", len(self._tracked))
        u = ca.MX(discrete.linearize.size1_in("u"), 1)
        g = ca.densify(ca.vertcat(ca.SX(0, 1), *self._limits))
        shape = ca.Function("shape", [self._y], [g, ca.densify(ca.jacobian(g, self._y))])
        ports, names = [x, theta, reference], ["x", "theta", "reference"]
        if not self._names:
            empty = [ca.MX(0, 1), ca.MX(0, x.shape[0])] * 2
            sides = {"plain": empty, "native": empty}
        else:
            sensor = discrete.together(self._names)
            sides = {}
            for key, function in (("plain", sensor.linearize), ("native", sensor.native)):
                y, H_x, _ = function(x, u, theta)
                value, slope = shape(y)
                rows = self._tracked
                sides[key] = [y[rows] - reference, H_x[rows, :], value, ca.mtimes(slope, H_x)]
        r, _, value, _ = sides["plain"]
        if self._names:
            y = discrete.together(self._names).output(x, u, theta)
            r, value = y[self._tracked] - reference, shape(y)[0]
        outputs = ["r", "R_x", "g", "G_x"]
        return {
            "residual": ca.Function("residual", ports, [r], names, ["r"]),
            "inequality": ca.Function("inequality", [x, theta], [value], ["x", "theta"], ["g"]),
            "linearize": ca.Function("outputs", ports, sides["plain"], names, outputs),
            "native": ca.Function("outputs", ports, sides["native"], names, outputs),
        }


def _inequality(
    discrete: Discrete, limit: Soft, y: ca.SX, where: str
) -> tuple[list[ca.SX], list[tuple[str, str]]]:
    """The entries of g of a soft limit, with names and units."""
    name = limit.output
    if isinstance(limit, Band):
        return _band(discrete, limit, y, where)
    if y.shape[0] != 3:
        raise refusal(f"{where}.output", "a sensor with three channels", f"{y.shape[0]}")
    if isinstance(limit, HalfSpace):
        normal = checks.unit(f"{where}.normal", limit.normal, error=refusal)
        offset = checks.number(f"{where}.offset", limit.offset, error=refusal)
        return [offset - ca.dot(ca.DM(normal), y)], [(f"{name} behind a plane", "m")]
    centre = checks.array(f"{where}.centre", limit.centre, (3,), error=refusal)
    radius = checks.number(f"{where}.radius", limit.radius, positive=True, error=refusal)
    distance = ca.sqrt(ca.sumsqr(y - ca.DM(centre)) + _TINY)
    return [radius - distance], [(f"{name} in a ball", "m")]


def _band(
    discrete: Discrete, band: Band, y: ca.SX, where: str
) -> tuple[list[ca.SX], list[tuple[str, str]]]:
    picked = picked_of(discrete, band.output, band.channels, f"{where}.channels")
    labels = _labels(discrete, band.output, picked)
    found, named = [], []
    for key, sign in (("lower", 1.0), ("upper", -1.0)):
        bounds = rows_of(f"{where}.{key}", getattr(band, key), 1, len(picked), finite=False)[0]
        for k, bound, (label, unit) in zip(picked, bounds, labels, strict=True):
            if np.isfinite(bound):
                found.append(sign * (bound - y[k]))
                named.append((f"{label} beyond {key}", unit))
    return found, named


def _sensor(discrete: Discrete, name: object, where: str) -> Sensor:
    """A sensor that can be an output: its reading must not feel the command directly."""
    if name not in discrete.sensors:
        expected = ", ".join(discrete.sensors) or "none: the model has no sensors"
        raise refusal(where, f"a sensor out of {expected}", checks.shown(name))
    sensor = discrete.sensors[name]  # type: ignore[index]
    if sensor.output.jac_sparsity(0, 1).nnz():
        raise refusal(where, "a sensor that depends on the state alone", f"{name!r}")
    return sensor


def picked_of(
    discrete: Discrete, output: str, channels: Sequence[str | int] | None, where: str
) -> list[int]:
    """Places of channels among a sensor's readings."""
    known = [name for name, _ in discrete.sensors[output].channels]
    if channels is None:
        return list(range(len(known)))
    if isinstance(channels, str | int):
        channels = (channels,)
    found = []
    for channel in channels:
        if isinstance(channel, str) and channel in known:
            found.append(known.index(channel))
        elif isinstance(channel, int) and 1 <= channel <= len(known):
            found.append(channel - 1)
        else:
            expected = f"names out of {', '.join(known)} or numbers from 1 to {len(known)}"
            raise refusal(where, expected, checks.shown(channel))
    if not found or len(set(found)) != len(found):
        raise refusal(where, "different channels", checks.shown(channels))
    return found


def _labels(discrete: Discrete, output: str, picked: Sequence[int]) -> list[tuple[str, str]]:
    channels = discrete.sensors[output].channels
    return [(f"{output}.{channels[k][0]}", channels[k][1]) for k in picked]
