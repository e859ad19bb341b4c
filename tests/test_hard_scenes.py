"""Scenes on which explicit or single-chart simulations break down: `auto` completes each."""

import numpy as np
import pytest
from hard_robots import HARD

import dtcasadi as dtc

# Compiling 16 discs in space takes half a minute; the 64-disc chain a minute.
QUICK = ("folding",)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in HARD]
)
def test_auto_completes(name):
    """To rtol 1e-6 with a success, finite states, and a closed energy balance."""
    hard = HARD[name]()
    run = dtc.simulate(hard.model, hard.x0, pressure=hard.pressure, t_end=hard.t_end)
    assert run.success, run.message
    assert np.all(np.isfinite(run.x)) and run.t[-1] == hard.t_end
    turned = max(np.ptp(run.energy[k]) for k in ("kinetic", "potential", "supplied", "dissipated"))
    # Ten times the tolerance: a step's error adds up over the run. Where a spring folds through
    # zero length its force turns inside a step, which the balance's quadrature does not resolve.
    share = 1e-3 if name == "folding" else 1e-5
    assert np.max(np.abs(run.energy["residual"])) < share * turned
