"""Random faults of everything a controller is given, and whether it keeps its contract."""

from __future__ import annotations

import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.compile import twin

from .closed_loop import Known
from .mpc import PressureMPC
from .scenario import Experiment


def contract_kept(found: Experiment, steps: int, *, seed: int = 0) -> int:
    """How many of so many steps broke the contract: a finite command within limits and rates.

    Faults come in bursts: no estimate, one of NaN, zeros, infinity, far away or of a wrong shape; a
    reference that is missing, NaN, infinite or out of reach; parameters of NaN.

    Args:
        found: the experiment; its model is what moves.
        steps: number of steps.
        seed: of the faults.
    """
    s, rng = found.stages, np.random.default_rng(seed)
    mpc = PressureMPC(s.discrete, s.problem, u0=found.plant.u0)
    theta0 = s.discrete.theta0
    step = Bound(twin(s.discrete.step, source=s.discrete.native("step")))
    x, theta, u = np.zeros(s.n_x), theta0, np.asarray(found.plant.u0, dtype=float)
    good = s.references(0.0)
    broken, fault, left = 0, 0, 0
    for _ in range(steps):
        if left == 0:
            fault, left = int(rng.integers(0, 12)), int(rng.integers(1, 8))
        left -= 1
        estimate, reference = _given(fault, rng, x, theta, good)
        before = u
        u, info = mpc.step(estimate, reference=reference)
        slack = 1e-9 * (1 + np.abs(before))
        kept = np.all(np.isfinite(u)) and np.all(u <= s.upper[0] + slack)
        kept &= bool(np.all(u >= s.lower[0] - slack) and info.status.sentence)
        kept &= bool(np.all(np.abs(u - before) <= s.rate[0] + slack))
        broken += not kept
        moved, status = step(x, u if kept else before, theta)
        if status[0] == 0 and np.all(np.isfinite(moved)):
            x, theta, _ = s.discrete.recentre(moved, theta)
    return broken


def _given(
    fault: int, rng: np.random.Generator, x: np.ndarray, theta: np.ndarray, good: np.ndarray
) -> tuple[object, np.ndarray]:
    """What the controller is given under a fault; from 8 on there is none."""
    none = np.full_like(good, np.nan)
    cases: dict[int, tuple[object, np.ndarray]] = {
        0: (None, good),
        1: (Known(np.full_like(x, np.nan), theta), good),
        2: (Known(np.zeros_like(x), theta), good),
        3: (Known(np.where(rng.random(len(x)) < 0.2, np.inf, x), theta), good),
        4: (Known(x + rng.normal(size=len(x)) * 10, theta), good),
        5: (Known(x, theta), none),
        6: (Known(x, theta), good + rng.normal() * 100),
        7: (Known(x, np.full_like(theta, np.nan)), good),
    }
    return cases.get(fault, (Known(x, theta), good))
