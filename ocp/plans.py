"""Plans to start from: what a model does under given commands, and several such starts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.compile import twin

from .nlp import Instance
from .solution import Solution
from .solvers import Solver
from .stages import Stages

Plan = tuple[np.ndarray, np.ndarray]


class Rollout:
    """A model's states under a plan of commands."""

    def __init__(self, stages: Stages):
        """Compile the step."""
        discrete = stages.discrete
        self._step = Bound(twin(discrete.step, source=discrete.native("step")))

    def __call__(self, x0: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """States, shape (N + 1, n_x); after a step that fails, the last good one."""
        rows = [np.asarray(x0, dtype=float)]
        good = True
        for command in u:
            if good:
                x, status = self._step(rows[-1], command, theta)
                good = status[0] == 0 and bool(np.all(np.isfinite(x)))
            rows.append(x if good else rows[-1])
        return np.array(rows)


def limited(stages: Stages, u: np.ndarray, u_now: np.ndarray) -> np.ndarray:
    """The nearest plan of commands within limits, rate limits and blocks, shape (N, n_u)."""
    found, last = np.empty((stages.horizon, stages.n_u)), np.asarray(u_now, dtype=float)
    for k in range(stages.horizon):
        if k and stages.block_of[k] == stages.block_of[k - 1]:
            found[k] = last
            continue
        near = np.clip(u[k], last - stages.rate[k], last + stages.rate[k])
        last = found[k] = np.clip(near, stages.lower[k], stages.upper[k])
    return found


def starts(stages: Stages, u_now: np.ndarray, n: int, seed: int = 0) -> Iterator[np.ndarray]:
    """Plans of commands: the one in force held, then the limits held, then random block plans."""
    N, m = stages.horizon, stages.n_u
    rng = np.random.default_rng(seed)
    lower, upper = stages.lower[0], stages.upper[0]
    low = np.where(np.isfinite(lower), lower, u_now)
    high = np.where(np.isfinite(upper), upper, u_now)
    constant = [np.asarray(u_now), high, low, (low + high) / 2]
    for k in range(n):
        if k < len(constant):
            rows = np.tile(constant[k], (N, 1))
        else:
            levels = rng.uniform(low, high, (int(rng.integers(2, 6)), m))
            rows = levels[np.minimum(np.arange(N) * len(levels) // N, len(levels) - 1)]
        yield limited(stages, rows, u_now)


def multi_start(
    solver: Solver, instance: Instance, *, n: int = 12, solves: int = 3, seed: int = 0
) -> tuple[Solution, list[Solution]]:
    """The best of several optima.

    Plans of commands are rolled out, which is cheap, and the best of them are solved from.

    Args:
        solver: of the program.
        instance: what holds now.
        n: number of plans.
        solves: number of solves.
        seed: of the random plans.

    Returns:
        The best solution, and all of them in the order of their starts.
    """
    stages = solver.nlp.stages
    roll, cost = Rollout(stages), Cost(stages)
    plans: list[tuple[float, int, Plan]] = []
    for u in starts(stages, instance.u_now, n, seed):
        x = roll(instance.x0, u, instance.theta)
        plans.append((cost(instance, x, u), len(plans), (x, u)))
    plans.sort(key=lambda entry: entry[:2])
    found = [solver(instance, plan) for _, _, plan in plans[:solves]]
    return min(found, key=lambda s: (not s.good, s.cost)), found


class Cost:
    """J of a plan by its definition, term by term."""

    def __init__(self, stages: Stages):
        """Compile the outputs."""
        self._stages = stages
        outputs = twin(stages.linearize, source=stages.native)
        self._outputs = Bound(outputs, matrices={"R_x", "G_x"})

    def __call__(self, instance: Instance, x: np.ndarray, u: np.ndarray) -> float:
        """J, with the slacks that the states need; inf where a state is not finite.

        Args:
            instance: what holds now.
            x: states, shape (N + 1, n_x).
            u: commands, shape (N, n_u).
        """
        s = self._stages
        if not np.all(np.isfinite(x)):
            return float("inf")
        change = np.diff(u, axis=0, prepend=[instance.u_now])
        J = np.sum(s.change * change**2) + np.sum(s.level * (u - instance.target_u) ** 2)
        for k in range(1, s.horizon + 1):
            found = self._outputs(x[k], instance.theta, instance.references[k])
            slack = np.maximum(found.g, 0.0)
            J += np.sum(s.weight[k] * found.r**2)
            J += np.sum(s.linear * slack + s.quadratic * slack**2)
        off = np.concatenate([x[-1] - instance.target_x, u[-1] - instance.target_u])
        return float(J + off @ instance.P @ off)
