"""Charts: the coordinates of a segment, and conversion of poses and rates between them.

A chart is two words of axis letters, the thread's and the disc's (eq (1)):
R_thread = prod Rot(axis, q_t), t = A R_thread z, R_rel = A R_thread B R_disc. E, eq (3), holds the
rotation axes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np

from .errors import ChartError
from .kernels.axes import axes_at_end, head, tail, word_rotation
from .kernels.kinematics import Words
from .robot import Robot, Thread

# Residual above which a pose or a rate is not the chart's; poses are of order one.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Chart:
    """Coordinates of one segment.

    Attributes:
        name: the name `build` takes.
        words: axis letters of the thread's and the disc's rotations.
        coordinate_names: one for each letter.
        recentres: whether A and B may absorb the pose so that no pose is singular.
    """

    name: str
    words: Words
    coordinate_names: tuple[str, ...]
    recentres: bool = False


CHARTS = {
    chart.name: chart
    for chart in (
        Chart(
            "cardan",
            Words("xy", "xyz"),
            ("thread_x", "thread_y", "disc_x", "disc_y", "disc_z"),
            recentres=True,
        ),
        Chart("paper", Words("zx", "zxy"), ("alpha", "beta", "gamma", "psi", "phi")),
        Chart("planar", Words("x", "x"), ("beta", "psi")),
        Chart("hinge", Words("x", ""), ("beta",)),
        Chart("ball", Words("", "xyz"), ("disc_x", "disc_y", "disc_z")),
        Chart("rigid", Words("", ""), ()),
    )
}


def charts_of(chart: str | Sequence[str], n_segments: int) -> tuple[Chart, ...]:
    """One chart per segment from a name for all or a list of names.

    Raises:
        ChartError: an unknown name, or a list of the wrong length.
    """
    names = [chart] * n_segments if isinstance(chart, str) else list(chart)
    for name in names:
        if not isinstance(name, str) or name not in CHARTS:
            raise ChartError(f"chart: expected one of {', '.join(CHARTS)}, got {name!r}")
    if len(names) != n_segments:
        raise ChartError(f"chart: expected 1 or {n_segments} names, got {len(names)}")
    return tuple(CHARTS[name] for name in names)


def convert(
    robot: Robot,
    q: np.ndarray,
    qd: np.ndarray,
    source: str | Sequence[str],
    target: str | Sequence[str],
) -> tuple[np.ndarray, np.ndarray]:
    """The same poses and rates in another chart (both about the robot's own A, B).

    What must agree is each segment's R_rel, t and their rates; a thread's spin does not count.
    In `paper`, 0 <= beta <= pi, -pi < alpha <= pi, |psi| <= pi/2.

    Args:
        robot: the robot.
        q: coordinates in the source chart, shape (n_q,) [rad].
        qd: their rates, shape (n_q,) [rad/s].
        source: chart, or one per segment, of q and qd.
        target: chart, or one per segment, wanted.

    Returns:
        q and qd in the target chart.

    Raises:
        ChartError: wrong sizes, or a pose or rate that the target chart cannot represent.
    """
    charts = [charts_of(c, robot.n_discs - 1) for c in (source, target)]
    n_q = sum(c.words.n_q for c in charts[0])
    q, qd = np.asarray(q, dtype=float), np.asarray(qd, dtype=float)
    if q.shape != (n_q,) or qd.shape != (n_q,):
        raise ChartError(f"q, qd: expected shape ({n_q},), got {q.shape}, {qd.shape}")
    start, parts = 0, []
    for i, (old, new) in enumerate(zip(*charts, strict=True)):
        mine = slice(start, start + old.words.n_q)
        start = mine.stop
        if old is new:
            parts.append((q[mine], qd[mine]))
            continue
        thread = robot.threads[i]
        parts.append(convert_segment(i + 1, (thread, old), (thread, new), q[mine], qd[mine]))
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))  # type: ignore[return-value]


def rates_map(thread: Thread, words: Words, q: np.ndarray) -> np.ndarray:
    """G = [E; -[t]x E_thread]: relative angular velocity and t-dot in frame i, shape (6, n_q)."""
    R_t, R_d, thread_axes, disc_axes = _turned(words, q)
    T = thread.bend @ R_t
    thread_axes = T @ thread_axes
    E = np.hstack([thread_axes, T @ thread.twist @ R_d @ disc_axes])
    t_rate = np.hstack([np.cross(thread_axes.T, T[:, 2]).T, np.zeros_like(disc_axes)])
    return np.vstack([E, t_rate])


def pose_of(thread: Thread, words: Words, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R_rel, shape (3, 3), and t, shape (3,), of a segment."""
    R_t, R_d, _, _ = _turned(words, q)
    T = thread.bend @ R_t
    return T @ thread.twist @ R_d, T[:, 2]


def coordinates_of(thread: Thread, words: Words, R_rel: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Coordinates whose pose is nearest in the chart, exact where the chart has the pose."""
    q_t = _thread_angles(words.thread, thread.bend.T @ t)
    R_t = _turned(Words(words.thread, ""), q_t)[0]
    S = thread.twist.T @ R_t.T @ thread.bend.T @ R_rel
    return np.concatenate([q_t, _disc_angles(words.disc, S)])


def convert_segment(
    number: int,
    source: tuple[Thread, Chart],
    target: tuple[Thread, Chart],
    q: np.ndarray,
    qd: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """One segment's pose and rates in another chart, or about another A and B.

    Args:
        number: the segment's number from 1, for the message.
        source: thread (its A, B) and chart of q and qd.
        target: thread and chart wanted.
        q: the segment's coordinates in the source [rad].
        qd: their rates [rad/s].

    Returns:
        q and qd in the target chart, angles in their principal range.

    Raises:
        ChartError: a pose or rate that the target chart cannot represent.
    """
    (thread, old), (other, new) = source, target
    R_rel, t = pose_of(thread, old.words, q)
    q_new = coordinates_of(other, new.words, R_rel, t)
    R_new, t_new = pose_of(other, new.words, q_new)
    off = max(np.abs(R_new - R_rel).max(), np.abs(t_new - t).max())
    if off > TOLERANCE:
        raise ChartError(
            f"segment {number}: chart {new.name} cannot represent the pose (off by {off:.1e})"
        )
    wanted = rates_map(thread, old.words, q) @ qd
    G = rates_map(other, new.words, q_new)
    qd_new = np.linalg.lstsq(G, wanted, rcond=1e-10)[0] if new.words.n_q else np.zeros(0)
    off = np.abs(G @ qd_new - wanted).max()
    if off > TOLERANCE * max(1.0, np.abs(wanted).max()):
        raise ChartError(
            f"segment {number}: chart {new.name} cannot represent the rates (off by {off:.1e})"
        )
    return q_new, qd_new


def _turned(words: Words, q: np.ndarray) -> tuple[np.ndarray, ...]:
    """R_thread, R_disc and the axes of each word in its end frame, shape (3, n)."""
    return tuple(value.full() for value in _turns(words).call([q]))


@cache
def _turns(words: Words) -> ca.Function:
    q = ca.SX.sym("q", words.n_q)
    k = len(words.thread)
    c, s = ca.cos(q), ca.sin(q)
    thread, disc = (head(c, k), head(s, k)), (tail(c, k), tail(s, k))
    rotations = word_rotation(words.thread, *thread), word_rotation(words.disc, *disc)
    axes = axes_at_end(words.thread, *thread), axes_at_end(words.disc, *disc)
    return ca.Function("turns", [q], [ca.densify(value) for value in (*rotations, *axes)])


def _thread_angles(word: str, t: np.ndarray) -> np.ndarray:
    """Angles of a thread word from the direction t = R z."""
    if word == "xy":
        return np.array([np.arctan2(-t[1], t[2]), np.arctan2(t[0], np.hypot(t[1], t[2]))])
    if word == "zx":
        off_axis = np.hypot(t[0], t[1])
        alpha = np.arctan2(t[0], -t[1]) if off_axis > 0 else 0.0
        return np.array([alpha, np.arctan2(off_axis, t[2])])
    return np.array([np.arctan2(-t[1], t[2])] * len(word))


def _disc_angles(word: str, S: np.ndarray) -> np.ndarray:
    """Angles of a disc word from its rotation."""
    if word == "xyz":
        e = np.arctan2(S[0, 2], np.hypot(S[1, 2], S[2, 2]))
        return np.array([np.arctan2(-S[1, 2], S[2, 2]), e, np.arctan2(-S[0, 1], S[0, 0])])
    if word == "zxy":
        psi = np.arctan2(S[2, 1], np.hypot(S[2, 0], S[2, 2]))
        return np.array([np.arctan2(-S[0, 1], S[1, 1]), psi, np.arctan2(-S[2, 0], S[2, 2])])
    return np.array([np.arctan2(S[2, 1], S[1, 1])] * len(word))
