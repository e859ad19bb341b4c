"""Re-centring: A and B of a segment absorb its pose, so that no pose is singular.

For segments in the `cardan` chart (`xy|xyz`) of a model with physical damping, whose A, B are the
theta block `frames`. R_rel = A R_thread B R_disc is singular where the second thread angle b or the
middle disc angle e reaches 90 degrees. When one leaves 45 degrees,

    A' = A R_thread,   B' = B R_disc,   q' = 0,   qd' = D qd

keeps R_rel, the thread's direction t, the rate of t in frame i and the relative angular velocity;
the thread's spin, which moves no mass, passes into the disc's rates. The graph and its C stay the
same. Segments are counted from 0 here, from 1 in messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from .charts import Chart, charts_of, convert, convert_segment
from .errors import ChartError, ModelError
from .kernels.recentring import FRAMES, absorbed, chart_change, recentred

if TYPE_CHECKING:
    from .model import Model

# Half way to the singularity: within it cond(D) < 3.8, so M = D^T M' D has a condition at most 14
# times that of the re-centred M'. A disc that spins for ever re-centres at most 8 times a turn.
LIMIT = np.pi / 4
# |cos| or |sin| of a chart's middle angle, which is zero at its singularity. The paper's four-disc
# robot has cond(M) = 3e2 to 1.5e3 over its square: at 1e-3 up to 1.5e9, so that round-off in qdd,
# cond(M) 2e-16, comes up to a simulation's default tolerance of 1e-6; and with 1e2 of damping on
# each rate the fastest eigenvalue is -4e8 1/s.
THRESHOLD = 1e-3
# A run stops at this distance: cond(M) = 1e13, and of qdd's digits two or three are left.
NEAR = 1e-5
# Condition above which momenta are not mapped: their round-off would exceed 1e-6.
_SINGULAR = 1e10
_MIDDLE = {"xy": (1, np.cos), "zx": (1, np.sin), "xyz": (1, np.cos), "zxy": (1, np.cos)}


class Place(NamedTuple):
    """Where a segment that re-centres, counted from 0, is found in q and theta."""

    segment: int
    q: slice
    frames: slice


def places(charts: Sequence[Chart], theta_blocks: Mapping[str, slice]) -> tuple[Place, ...]:
    """The segments that re-centre, in the order of the block `frames`; see `Model.centres`."""
    if "frames" not in theta_blocks:
        return ()
    start, at, found = 0, theta_blocks["frames"].start, []
    for i, chart in enumerate(charts):
        stop = start + chart.words.n_q
        if chart.recentres:
            found.append(Place(i, slice(start, stop), slice(at, at + FRAMES)))
            at += FRAMES
        start = stop
    return tuple(found)


def guard_indices(model: Model) -> np.ndarray:
    """Entries of x to watch: |x[i]| > LIMIT asks for re-centring; two per segment, shape (m,)."""
    starts = [place.q.start for place in model.centres]
    return np.array([start + k for start in starts for k in (1, 3)], dtype=np.int64)


def singular_angles(model: Model) -> Iterator[tuple[int, np.ufunc]]:
    """Entries of x where the chart of a segment that cannot re-centre has a singularity.

    Yields:
        The entry's index, and np.cos or np.sin, which is zero there.
    """
    free, start = {place.segment for place in model.centres}, 0
    for i, chart in enumerate(model.charts):
        words = ((chart.words.thread, 0), (chart.words.disc, len(chart.words.thread)))
        for word, first in words:
            if i not in free and word in _MIDDLE:
                place, measure = _MIDDLE[word]
                yield start + first + place, measure
        start += chart.words.n_q


def off_centre(model: Model, x: np.ndarray) -> tuple[int, ...]:
    """Segments, from 0, whose second thread or middle disc angle has left LIMIT.

    An angle that is not finite is not off centre.
    """
    angles = np.abs(np.asarray(x, dtype=float)[guard_indices(model)])
    if not (angles > LIMIT).any():  # what all steps but a few end with
        return ()
    off = np.any(((angles > LIMIT) & np.isfinite(angles)).reshape(-1, 2), axis=1)
    return tuple(place.segment for place, is_off in zip(model.centres, off, strict=True) if is_off)


def recentre(
    model: Model, x: np.ndarray, theta: np.ndarray, segments: Iterable[int] | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same motion with some segments' coordinates at zero, and the map of a covariance.

    D is the Jacobian of the exact chart change at fixed A, B, A', B'. A' and B' are made orthogonal
    to round-off, R (3 - R^T R) / 2, so that the products of a long run do not drift.

    Args:
        model: the model.
        x: state [q; qd; actuator states], shape (n_x,).
        theta: parameters, shape (n_theta,).
        segments: segments from 0; default: those of `off_centre`.

    Returns:
        x and theta, new arrays where something changed, and T, shape (n_x, n_x): a covariance P of
        x becomes T P T^T. T holds [[D, 0], [d(D qd)/dq, D]] in the rows of (q, qd) of a re-centred
        segment and is the identity elsewhere.

    Raises:
        ChartError: a segment that cannot re-centre.
        ModelError: wrong shapes, or a state to re-centre that is not finite.
    """
    x, theta = np.asarray(x, dtype=float), np.asarray(theta, dtype=float)
    for name, value, size in (("x", x, model.n_x), ("theta", theta, len(model.theta0))):
        if value.shape != (size,):
            raise ModelError(f"{name}: expected shape ({size},), got {value.shape}")
    T = np.eye(model.n_x)
    wanted = off_centre(model, x) if segments is None else tuple(segments)
    if not wanted:
        return x, theta, T
    if not np.all(np.isfinite(x)):
        raise ModelError("x: expected finite numbers to re-centre")
    known = {place.segment: place for place in model.centres}
    x, theta = x.copy(), theta.copy()
    for segment in wanted:
        if segment not in known:
            raise ChartError(
                f"segment {segment + 1} cannot re-centre: that takes chart cardan and "
                'damping="physical"'
            )
        place = known[segment]
        q = place.q
        qd = slice(q.start + model.n_q, q.stop + model.n_q)
        frames = absorbed()(x[q], theta[place.frames])
        change = chart_change().call([x[q], x[qd], theta[place.frames], frames])
        D, cross = change[1].full(), change[2].full()
        theta[place.frames] = frames.full()[:, 0]
        x[q], x[qd] = 0.0, D @ x[qd]
        T[q, q], T[qd, qd], T[qd, q] = D, D, cross
    return x, theta, T


def carried(
    model: Model, x: np.ndarray, theta: np.ndarray, to: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A state in the coordinates about other centres: those of the theta `to`.

    Args:
        model: the model.
        x: state, shape (n_x,).
        theta: parameters its coordinates refer to, shape (n_theta,).
        to: parameters the new ones refer to, shape (n_theta,).

    Returns:
        The state, and its derivative for x, shape (n_x, n_x), in the rows of a segment whose
        centres differ as the T of `recentre`.
    """
    x, T = np.array(x, dtype=float), np.eye(model.n_x)
    for place in model.centres:
        q, frames = place.q, place.frames
        if np.array_equal(theta[frames], to[frames]):
            continue
        qd = slice(q.start + model.n_q, q.stop + model.n_q)
        q_new, D, cross = chart_change().call([x[q], x[qd], theta[frames], to[frames]])
        x[q], x[qd] = q_new.full()[:, 0], D.full() @ x[qd]
        T[q, q], T[qd, qd], T[qd, q] = D.full(), D.full(), cross.full()
    return x, T


def recentre_function(model: Model) -> ca.Function:
    """`recentre` as one graph, for programs without Python.

    Returns:
        x, theta -> x_next, theta_next, recentred (the number of segments that moved), D and cross,
        shape (5, 5 m): a 5 x 5 block for each of the m segments of `model.centres`, the D and
        d(D qd)/dq of `recentre`. T holds [[D, 0], [cross, D]] in the rows of a segment's (q, qd).
    """
    x, theta = ca.MX.sym("x", model.n_x), ca.MX.sym("theta", len(model.theta0))
    x_next, theta_next, count = ca.MX(x), ca.MX(theta), ca.MX(0)
    D, cross = [ca.MX(5, 0)], [ca.MX(5, 0)]
    for place in model.centres:
        q, rates = place.q, slice(place.q.start + model.n_q, place.q.stop + model.n_q)
        values = recentred(LIMIT)(x[q], x[rates], theta[place.frames])
        x_next[q], x_next[rates], theta_next[place.frames] = values[:3]
        D.append(values[3])
        cross.append(values[4])
        count = count + values[5]
    outputs = {"x_next": x_next, "theta_next": theta_next, "recentred": count}
    outputs |= {"D": ca.horzcat(*D), "cross": ca.horzcat(*cross)}
    return ca.Function("recentre", [x, theta], list(outputs.values()), ["x", "theta"], [*outputs])


def momentum_map(model: Model, T: np.ndarray) -> np.ndarray:
    """D^-T, shape (n_q, n_q), from the T of `recentre`: p' = D^-T p, tau' = D^-T tau.

    M' = D^-T M D^-1, so the kinetic energy p^T M^-1 p / 2 stays.

    Raises:
        ChartError: the pose that was left was singular; no momenta belong to it.
    """
    D = T[: model.n_q, : model.n_q]
    if model.n_q and np.linalg.cond(D) > _SINGULAR:
        raise ChartError("momenta: expected a pose that is not singular in the chart that was left")
    return np.linalg.inv(D).T


def regular(model: Model, x: np.ndarray, theta: np.ndarray) -> tuple[Model, np.ndarray, np.ndarray]:
    """The same robot and state with chart `cardan` wherever a chart in space cannot re-centre.

    The same physics: with physical damping and full velocity terms no acceleration depends on the
    chart.

    Returns:
        The model, its state and its parameters: those of theta, and A, B as the robot has them.

    Raises:
        ChartError: the damping or the velocity terms are tied to the chart, or no chart changes.
    """
    options = model.options
    old = [chart.name for chart in model.charts]
    new = ["cardan" if chart.words.thread == "zx" else chart.name for chart in model.charts]
    if options.damping != "physical" or options.velocity_terms != "full" or new == old:
        raise ChartError("chart: expected one that can change without changing the physics")
    other = model.rebuilt(charts_of(new, model.n_discs - 1))
    n = model.n_q
    state = np.concatenate([*convert(model.robot, x[:n], x[n : 2 * n], old, new), x[2 * n :]])
    parameters = other.theta0.copy()
    for name, block in model.theta_blocks.items():
        if name != "frames":
            parameters[other.theta_blocks[name]] = theta[block]
    return other, state, parameters


def unwound(
    model: Model, x: np.ndarray, theta: np.ndarray, chart: str | Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and rates in a chart of choice about the robot's own A and B.

    Independent of where the charts were re-centred, so a run can be shown in them. One state gives
    principal angles (of a segment whose chart and A, B are the wanted ones already: its own); the
    columns of a run are joined by whole turns.

    Args:
        model: the model.
        x: state, shape (n_x,), or one per column, (n_x, n).
        theta: its parameters, shape (n_theta,), or one per column, (n_theta, n).
        chart: chart, or one per segment, wanted.

    Returns:
        q [rad] and qd [rad/s], shape (n_q,) or (n_q, n) with the wanted chart's n_q.

    Raises:
        ChartError: an unknown chart, or a pose or rate that it cannot represent.
    """
    x, theta = np.asarray(x, dtype=float), np.asarray(theta, dtype=float)
    target = charts_of(chart, model.n_discs - 1)
    if x.ndim == 1:
        return _unwound(model, x, theta, target)
    thetas = theta.T if theta.ndim == 2 else [theta] * x.shape[1]
    columns = [_unwound(model, *pair, target) for pair in zip(x.T, thetas, strict=True)]
    q, qd = (np.array(part).T for part in zip(*columns, strict=True))
    return np.unwrap(q, axis=1), qd


def chart_limit(model: Model, x: np.ndarray) -> str | None:
    """A sentence when a segment that cannot re-centre is next to its chart's singularity.

    Distances: |cos| of the second thread angle of `xy` (cardan) and of the middle disc angle of
    `xyz` and `zxy` (paper: psi), |sin beta| of `zx` (paper).

    Returns:
        What is singular where, or None while every distance is at least THRESHOLD.
    """
    for k, measure in singular_angles(model):
        angle = float(x[k])
        distance = abs(float(measure(angle)))
        if distance < THRESHOLD:
            name, _, segment = model.coordinate_names[k].rpartition("_")
            chart = model.charts[int(segment) - 1].name
            return (
                f"segment {segment}: {name} = {angle:.6g} rad is at a singularity of chart {chart} "
                f"(|{measure.__name__}| = {distance:.1e})"
            )
    return None


def _unwound(
    model: Model, x: np.ndarray, theta: np.ndarray, target: Sequence[Chart]
) -> tuple[np.ndarray, np.ndarray]:
    """`unwound` of one state."""
    frames = {place.segment: theta[place.frames] for place in model.centres}
    start, n, parts = 0, model.n_q, []
    for i, (thread, old, new) in enumerate(
        zip(model.robot.threads, model.charts, target, strict=True)
    ):
        stop = start + old.words.n_q
        q, qd = x[start:stop], x[n + start : n + stop]
        start = stop
        source = thread
        if i in frames:
            A, B = (part.reshape(3, 3, order="F") for part in np.split(frames[i], 2))
            source = replace(thread, bend=A, twist=B)
        same = np.array_equal(source.bend, thread.bend) and np.array_equal(
            source.twist, thread.twist
        )
        if not (same and old is new):
            q, qd = convert_segment(i + 1, (source, old), (thread, new), q, qd)
        parts.append((q, qd))
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))  # type: ignore[return-value]
