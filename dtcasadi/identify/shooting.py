"""Running the model between shooting nodes: residuals, their derivatives, jumps at the nodes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .data import Data
from .problem import Problem
from .whiten import whitened


class Point(NamedTuple):
    """Where the search is.

    Attributes:
        z: parameters on their scales, shape (n_p,).
        nodes: states at the nodes of each experiment, shape (n_nodes, n_x).
        frames: A and B that each node's coordinates refer to, shape (n_nodes, n_frames).
    """

    z: np.ndarray
    nodes: tuple[np.ndarray, ...]
    frames: tuple[np.ndarray, ...]


class Stage(NamedTuple):
    """What happens from one node to the next, or to the end.

    Attributes:
        r: residuals h - y in standard deviations, one for each reading, shape (m,).
        J_s: their derivatives for the node's state, shape (m, n_x).
        J_p: for the parameters z, shape (m, n_p).
        X: derivative of the state at the end for that at the start, shape (n_x, n_x).
        G: for the parameters, shape (n_x, n_p).
        jump: state at the end less that of the next node, shape (n_x,); zero for the last stage.
        h: what the model reads at each step, NaN where nobody looked, shape (steps, n_y).
    """

    r: np.ndarray
    J_s: np.ndarray
    J_p: np.ndarray
    X: np.ndarray
    G: np.ndarray
    jump: np.ndarray
    h: np.ndarray


Stages = tuple[Stage, ...]


def shoot(problem: Problem, point: Point) -> tuple[Stages, ...] | None:
    """Run all experiments from their nodes; None where the model cannot go on."""
    theta, S = problem.theta(point.z)
    found = []
    for k, data in enumerate(problem.data):
        stages = []
        nodes, frames = point.nodes[k], point.frames[k]
        for j, span in enumerate(spans(problem, k)):
            run = _run(problem, data, nodes[j], _about(problem, theta, frames[j]), S, span)
            if run is None:
                return None
            stage, x, theta_end = run
            if j + 1 < len(nodes):
                if problem.recentres:
                    to = _about(problem, theta, frames[j + 1])
                    x, T = _carried(problem, x, theta_end, to)
                    stage = stage._replace(X=T @ stage.X, G=T @ stage.G)
                stage = stage._replace(jump=x - nodes[j + 1])
            stages.append(stage)
        found.append(tuple(stages))
    return tuple(found)


def simulated(problem: Problem, z: np.ndarray) -> Point | None:
    """The point whose nodes lie on the motion from x0; None where the model cannot go on."""
    return _chained(problem, z, None)


def followed(problem: Problem, z: np.ndarray, sigma: np.ndarray) -> Point | None:
    """The point whose nodes follow the readings.

    At each node the state that the model arrives with is corrected by one step of least squares on
    the readings up to the next node, with the deviations `sigma` about the arrival; so wrong
    parameters cannot carry the motion away from what was measured.
    """
    return _chained(problem, z, sigma)


def spans(problem: Problem, k: int) -> list[tuple[int, int]]:
    """First and last step of each stage of an experiment."""
    steps = (*problem.nodes[k], problem.data[k].n)
    return list(zip(steps[:-1], steps[1:], strict=True))


def _chained(problem: Problem, z: np.ndarray, sigma: np.ndarray | None) -> Point | None:
    theta, S = problem.theta(z)
    all_nodes, all_frames = [], []
    for k, data in enumerate(problem.data):
        x, about = data.x0, theta
        nodes, frames = [], []
        for j, span in enumerate(spans(problem, k)):
            run = _run(problem, data, x, about, S, span)
            if sigma is not None and run is not None:
                x = x + _correction(run[0], np.minimum(sigma, data.sigma) if j == 0 else sigma)
                run = _run(problem, data, x, about, S, span)
            if run is None:
                return None
            nodes.append(x)
            frames.append(about[_frames(problem)])
            _, x, about = run
        all_nodes.append(np.array(nodes))
        all_frames.append(np.array(frames))
    return Point(z, tuple(all_nodes), tuple(all_frames))


def _correction(stage: Stage, sigma: np.ndarray) -> np.ndarray:
    """Change of the node's state that fits the stage's readings, weighed against sigma."""
    A = np.vstack([stage.J_s * sigma, np.eye(len(sigma))])
    b = np.concatenate([-stage.r, np.zeros(len(sigma))])
    return sigma * np.linalg.lstsq(A, b, rcond=None)[0]


def _run(
    problem: Problem,
    data: Data,
    x: np.ndarray,
    theta: np.ndarray,
    S: np.ndarray,
    span: tuple[int, int],
) -> tuple[Stage, np.ndarray, np.ndarray] | None:
    """A stage, and the state and theta it ends with; None where a step failed."""
    n_x, n_p, n_y = problem.n_x, problem.n_p, len(problem.names)
    step, read, discrete = problem.step, problem.read, problem.discrete
    first, last = span
    closing = last == data.n  # the reading at the end has no stage of its own
    count = last - first + closing
    h = np.full((count, n_y), np.nan)
    J = np.zeros((count, n_y, n_x + n_p))
    V = np.hstack([np.eye(n_x), np.zeros((n_x, n_p))])  # derivative of x for the node and z
    for i in range(count):
        k = first + i
        if problem.recentres:
            if not np.all(np.isfinite(x)):
                return None
            x, theta, T = discrete.recentre(x, theta)
            V = T @ V
        if data.seen[k]:
            h[i], H_x, H_theta = read(x, data.u[k], theta)
            J[i] = H_x @ V
            J[i, :, n_x:] += H_theta @ S
        if k < last:
            x, F_x, F_theta, status = step(x, data.u[k], theta)
            if status[0]:
                return None
            V = F_x @ V
            V[:, n_x:] += F_theta @ S
    if not np.all(np.isfinite(V)):
        return None
    r, rows = whitened(h - data.y[first : first + count], J, problem.R_v)
    J_s, J_p = np.split(rows, [n_x], axis=1)
    X, G = np.split(V, [n_x], axis=1)
    return Stage(r, J_s, J_p, X, G, np.zeros(n_x), h), x, theta


def _frames(problem: Problem) -> slice:
    """Where A and B are in theta."""
    return problem.discrete.theta_blocks.get("frames", slice(0, 0))


def _about(problem: Problem, theta: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Theta with other A and B."""
    if not problem.recentres:
        return theta
    theta = theta.copy()
    theta[_frames(problem)] = frames
    return theta


def _carried(
    problem: Problem, x: np.ndarray, theta: np.ndarray, to: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A state about other centres, and the derivative of the change."""
    robot: Any = problem.discrete  # the only kind of model that has centres
    return robot.carried(x, theta, to)
