"""Largest stable steps as the map measures them, against eigenvalues and stability functions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.bench.motions import EnergyMeter, model_of, problem_of
from dtcasadi.bench.stability_runs import fixed_run, step_grid
from dtcasadi.integrators import ONE_STEP
from dtcasadi.integrators.package import Package
from dtcasadi.integrators.stability import stability_limit


@cache
def near_rest() -> tuple[dtc.Scene, dtc.Model, float]:
    """The paper's robot a thousandth of a radian from its rest at 12, and its bound on energy.

    There the motion is linear but for a millionth, and every mode decays.
    """
    seed = dtc.load_scene("seed_four_disc")
    model = model_of(seed)
    rest = dtc.equilibrium(model, 12.0)
    assert rest.kind == "stable"
    q = rest.q + 1e-3 * np.cos(np.arange(model.n_q))
    scene = replace(seed, q0=q, qd0=np.zeros(model.n_q), t_end=10.0)
    run = dtc.simulate(scene, rtol=1e-8, atol=1e-12)
    energies = [EnergyMeter(model)(x, model.theta0) for x in run.x.T]
    floor = min(energy.potential for energy in energies)
    return scene, model, floor + 2 * (max(map(sum, energies)) - floor)


@pytest.mark.parametrize("name", ["euler", "heun", "rk4", "dopri5", "tsit5"])
def test_measured_limits_are_the_predicted_ones(name):
    """Within one step of the grid: just beyond the limit a mode may grow too slowly to show."""
    scene, model, most = near_rest()
    method = Package(ONE_STEP[name], fixed=True)
    method.prepare(model)
    grid = step_grid(0.1, 1e-4)
    measured = next(
        k for k, h in enumerate(grid) if fixed_run(scene, model, method, h, most).end is not None
    )
    limit = stability_limit(problem_of(scene, model), ONE_STEP[name])
    predicted = next(k for k, h in enumerate(grid) if h <= limit)
    assert abs(measured - predicted) <= 1, (grid[measured], limit)
    assert 0 < predicted < len(grid) - 1


@pytest.mark.parametrize("name", ["ros1", "rodas4"])
def test_a_stable_methods_have_no_limit(name):
    scene, model, most = near_rest()
    assert stability_limit(problem_of(scene, model), ONE_STEP[name]) == np.inf
    method = Package(ONE_STEP[name], fixed=True)
    method.prepare(model)
    assert fixed_run(scene, model, method, 1.0, most).end is not None
