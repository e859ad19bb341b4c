"""Hard scenes through `method="auto"`: each completes, without NaN, to 1e-6 of its own size.

The measure is the place of every disc at the end against SciPy's DOP853 at 1e-11, which does not
re-centre, over the robot's length. `rtol` (with a tenth of it as `atol`) is a tolerance per step;
what meets 1e-6 at the end is 1e-7 for smooth motions, and 1e-10 where a force jumps.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hard_robots import FOLD, HARD, Hard

import dtcasadi as dtc
from dtcasadi.recentring import unwound

SMOOTH, JUMPING = 1e-7, 1e-10
# In the plane and with few discs the steps compile in a second, else in up to a minute.
SCENES = ["folding", *(pytest.param(n, marks=pytest.mark.slow) for n in HARD if n != "folding")]


@cache
def scene(name: str) -> Hard:
    return HARD[name]()


@cache
def run(name: str, rtol: float, method: str = "auto") -> dtc.Run:
    model, x0, pressure, t_end = scene(name)
    options: dict[str, Any] = {"rtol": rtol, "atol": 0.1 * rtol}
    found = dtc.simulate(model, x0, pressure=pressure, t_end=t_end, method=method, **options)
    print(
        f"{name}: {found.message}; rtol {rtol:g}, {found.rejected} rejected, "
        f"{len(found.recentrings)} re-centrings, {found.wall_time:.3f} s"
    )
    return found


def places(found: dtc.Run, k: int) -> np.ndarray:
    """Origins of the discs at a step, over the robot's length, shape (n_discs, 3)."""
    return found.poses(np.array([k]))[1][0] / found.model.robot.length


@pytest.mark.parametrize("name", SCENES)
def test_auto_completes(name):
    found, exact = run(name, JUMPING if name == "folding" else SMOOTH), run(name, 1e-11, "DOP853")
    assert found.success and exact.success, found.message
    assert found.t[-1] == scene(name).t_end and np.all(np.isfinite(found.x))
    last = len(found.t) - 1
    error = np.max(np.abs(places(found, last) - places(exact, len(exact.t) - 1)))
    assert error < 1e-6
    assert np.max(np.abs(places(found, last) - places(found, 0))) > 0.1  # it has moved
    # Poses whose coordinates are anywhere: no condition of M near one that would cost digits.
    assert np.max(found.condition) < 1e9


@pytest.mark.parametrize("name", SCENES)
def test_auto_completes_at_its_default_tolerance(name):
    """With 1e-6 a step the energy balance closes to 1e-3 at the jumps, to 1e-6 elsewhere."""
    found = run(name, 1e-6)
    assert found.success and np.all(np.isfinite(found.x)), found.message
    energy = found.energy
    turned = max(np.ptp(energy[part]) for part in ("kinetic", "potential", "supplied"))
    share = np.max(np.abs(energy["residual"])) / turned
    assert share < (1e-3 if name == "folding" else 1e-6)


@pytest.mark.slow
def test_the_spin_has_no_end():
    """The first thread turns on and on, through many re-centrings."""
    found = run("endless_spin", SMOOTH)
    k = slice(None, None, 20)
    q, _ = unwound(found.model, found.x[:, k], found.thetas[:, k], "cardan")
    turns = np.ptp(q, axis=1) / (2 * np.pi)
    assert np.max(turns) > 3 and len(found.recentrings) > 10
    # Still turning at the end.
    assert np.max(np.abs(found.qd[:, -1])) > 0.1


@pytest.mark.slow
def test_the_coil_lets_its_energy_go():
    """Straight at first; it ends bent, at rest, in a pose that holds little, as Radau says."""
    found = run("pre_curved", SMOOTH)
    assert np.allclose(places(found, 0)[:, :2], 0, atol=1e-12)
    stored = found.energy["potential"]
    assert stored[-1] < 0.05 * stored[0] and found.energy["dissipated"][-1] > 0.9 * stored[0]
    assert found.energy["kinetic"][-1] < 0.01 * stored[0]
    # Some thousand steps with errors of 1e-7 of the states.
    assert abs(stored[-1] - run("pre_curved", SMOOTH, "Radau").energy["potential"][-1]) < 1e-5


def test_a_spring_of_length_zero_at_the_start():
    """Both ends in one point: no direction, no force, and no NaN."""
    hard = scene("folding")
    for beta, rate in ((FOLD, 0.0), (FOLD, 1.0)):
        found = dtc.simulate(hard.model, [beta, rate], t_end=1.0)
        assert found.success and np.all(np.isfinite(found.x))
    jacobian = np.array(hard.model.ode_jacobian([FOLD, 1.0], [], hard.model.theta0)[1])
    assert np.all(np.isfinite(jacobian))


@pytest.mark.parametrize("method", ["rk4", "gauss4", "rodas4", "radau5"])
def test_every_kind_of_step_passes_the_fold(method):
    """Their error estimates and Newton iterations meet the jump of the force, and get over it."""
    model, x0, _, t_end = scene("folding")
    found = dtc.simulate(model, x0, t_end=t_end, method=method, step_s=1e-3)
    assert found.success, found.message
    passed = np.count_nonzero(np.diff(np.sign(found.q[0] - FOLD)))
    assert passed >= 4
