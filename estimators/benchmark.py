"""What `dtcasadi bench estimators` measures: each estimator's errors, and its time for a step."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

import dtcasadi as dtc
from dtcasadi.discrete import DiscreteModel
from dtcasadi.presets import seed_four_disc
from dtcasadi.scene import Scene
from dtcasadi.sensors import IMU, Marker, PressureSensor

from .consistency import nees_in_band
from .ekf import EKF
from .mhe import MHE
from .operating import operating_points
from .registry import Choice
from .report import Result, Tip, result_of, tip_errors
from .runner import Filter
from .scenario import discrete_of, settings
from .spv import SPV
from .truth import Truth, moved, recorded
from .ukf import UKF

# Of the length: where a filter that started 0.3 rad off counts as converged, when it stays there.
CONVERGED = 0.01


def experiment(scene: Scene, choices: dict[str, Choice]) -> tuple[dict[str, Result], Tip, Truth]:
    """Every estimator on one simulated log of a scene."""
    truth, tip, discrete = moved(scene), Tip.of(scene), discrete_of(scene)
    log, results = recorded(scene, truth), {}
    for name, choice in choices.items():
        made = choice.build(scene, discrete)
        own = made.discrete
        assert isinstance(own, DiscreteModel)
        results[name] = result_of(choice.title, tip, own, choice.run(made, log))
    return results, tip, truth


def mismatch(choices: dict[str, Choice]) -> dict[str, dict[str, float]]:
    """Root mean square of tip error over length, from 1 s on, and of the force's error [N]."""
    results, tip, truth = experiment(dtc.load_scene("estimation/mismatch"), choices)
    found, late = {}, truth.t >= 1.0
    for name, result in results.items():
        error = tip_errors(result, tip, truth)[late]
        off = np.linalg.norm(result.force - truth.force, axis=1)[late]
        rms = [float(np.sqrt(np.mean(values**2))) for values in (error, off)]
        found[name] = {"tip_rmse_over_length": rms[0], "force_error": rms[1]}
    return found


def convergence(choices: dict[str, Choice], chart: str) -> dict[str, float | None]:
    """Time until the tip's error stays below 1 % of the length, from 0.3 rad off everywhere [s]."""
    scene = dtc.load_scene("estimation/tentacle")
    changes: dict[str, Any] = {"offset": 0.3, "angle_sigma": 0.3, "contact_force": np.zeros(3)}
    scene = replace(scene, estimation=replace(settings(scene), **changes), options={"chart": chart})
    results, tip, truth = experiment(scene, choices)
    found: dict[str, float | None] = {}
    for name, result in results.items():
        off = np.flatnonzero(tip_errors(result, tip, truth) > CONVERGED)
        last = int(off[-1]) if len(off) else 0
        found[name] = float(truth.t[last + 1]) if last + 1 < len(truth.t) else None
    return found


def consistency(choices: Iterable[str], runs: int, steps: int) -> dict[str, float]:
    """`nees_in_band` of filters by name on the four-disc robot in the plane; none of the smoother.

    Pressure, two inertial chips and a tip marker at 200 Hz; see `tests/test_ekf_consistency.py`.
    """
    sensors = (
        PressureSensor(name="air", noise=0.05),
        *(IMU(name=f"chip{disc}", disc=disc, noise=0.05) for disc in (3, 4)),
        Marker(name="tip", disc=4, noise=0.01),
    )
    model = dtc.build(seed_four_disc(), chart="planar", actuator="regulator")
    discrete = model.discrete(0.005, method="sdirk2", sensors=sensors)
    names, n = tuple(sensor.name for sensor in sensors), model.n_q
    Q = np.concatenate([np.full(n, 1e-8), np.full(n, 1e-5), [1e-4]])
    u = np.array([10.0])
    points = operating_points(model, [9.0], [11.0], n=3)
    near = points.x[0, 1]
    P0 = np.concatenate([np.full(n, 0.02), np.full(n, 0.02), [0.1]]) ** 2
    makes: dict[str, Callable[[], Filter]] = {
        "ekf": lambda: EKF(discrete, x0=near, P0=P0, Q_w=Q),
        "ukf": lambda: UKF(discrete, x0=near, P0=P0, Q_w=Q),
        "mhe": lambda: MHE(discrete, x0=near, P0=P0, Q_w=Q),
        "spv": lambda: SPV(discrete, points, x0=near, Q_w=Q, gauge="air"),
    }
    case: dict[str, Any] = {"mean": near, "Q": Q, "u": u, "runs": runs, "steps": steps}
    found = {}
    for name in [name for name in choices if name in makes]:
        made = makes[name]()
        # A steady filter knows its start as well as it will ever know.
        start = np.diag(made.start.P) if name == "spv" else P0
        found[name] = nees_in_band(made, discrete, names, P0=start, **case)
    return found
