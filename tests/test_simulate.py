"""`dtcasadi.simulate`: methods agree, energy balances, both forms of the equations are one."""

import io
import sys
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from moving import TIGHT, free, full, full_theta, pendulum, seed, seed_x0, swift
from oracles.cases import numbers
from scipy.integrate import solve_ivp

import dtcasadi as dtc
from dtcasadi.errors import SimulationError

# Jumps and kinks between the steps of any round size.
RAMPS = dtc.Profile(np.array([0.0, 0.2971, 0.5513]), np.array([12.0, 20.0, 6.0]), "linear")
STEPS = dtc.Profile(RAMPS.times, RAMPS.values)


@cache
def reference(t_end: float, pressure: dtc.Profile = RAMPS) -> np.ndarray:
    """The seed robot's state by an explicit method of order 8 at 1e-12."""
    options: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    return dtc.simulate(seed(), seed_x0(), pressure=pressure, t_end=t_end, **options).x[:, -1]


@cache
def rest() -> np.ndarray:
    """The state it settles in."""
    return dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=600.0).x[:, -1]


@pytest.mark.parametrize(
    ("method", "step_s"),
    [
        ("auto", None),
        ("tsit5", None),
        ("rodas4", None),
        ("LSODA", None),
        ("Radau", None),
        ("rk4", 1e-3),
    ],
)
def test_methods_agree(method, step_s):
    start = {"x0": seed_x0(), "pressure": RAMPS, "t_end": 2.0, "rtol": 1e-9, "atol": 1e-11}
    run = dtc.simulate(seed(), **start, method=method, step_s=step_s)
    assert run.success and run.t[0] == 0 and run.t[-1] == 2.0
    # A thousand local errors of 1e-9 of coordinates near 1.
    assert np.max(np.abs(run.x[:, -1] - reference(2.0))) < 1e-6


def test_fixed_steps_are_taken_by_a_method_with_error_control():
    """Of equal size, and rodas4's error falls by 16 when they are halved."""
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 0.8, "method": "rodas4", "fixed": True}
    exact = reference(0.8, dtc.Profile.constant(12.0))
    errors = []
    for h in (0.005, 0.0025):
        run = dtc.simulate(seed(), **start, step_s=h)
        assert run.steps == round(0.8 / h) and run.rejected == 0
        errors.append(np.linalg.norm(run.x[:, -1] - exact))
    # The fastest mode, of 300 1/s, is not yet small beside the step; order 3 would give 8.
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.3)
    with pytest.raises(SimulationError, match="step_s: expected a step .* without error"):
        dtc.simulate(seed(), **start)
    with pytest.raises(SimulationError, match="method: expected one of .* for fixed steps"):
        dtc.simulate(seed(), **{**start, "method": "LSODA"}, step_s=0.01)


@pytest.mark.parametrize("pressure", [STEPS, RAMPS], ids=["steps", "ramps"])
def test_fourth_order(pressure):
    """rk4's error falls by 16 when the step is halved, jumps and kinks included."""
    start = {"x0": seed_x0(), "pressure": pressure, "t_end": 0.8, "method": "rk4"}
    exact = reference(0.8, pressure)
    errors = [
        np.linalg.norm(dtc.simulate(seed(), **start, step_s=h).x[:, -1] - exact)
        for h in (1e-3, 5e-4, 2.5e-4)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(4.0, abs=0.15)


@pytest.mark.parametrize("method", ["tsit5", "DOP853"])
def test_energy_is_conserved(method):
    """Springs and weight alone, in space; tsit5 re-centres on the way, DOP853 cannot."""
    run = dtc.simulate(free(), swift(free()), t_end=1.0, method=method, **TIGHT)
    assert run.success, run.message
    assert bool(run.recentrings) == (method == "tsit5")
    energy = run.energy["kinetic"] + run.energy["potential"]
    turned = np.ptp(run.energy["kinetic"])
    assert turned > 10
    # 1e-10 a step over some hundred steps.
    assert np.ptp(energy) < 1e-8 * turned
    assert not np.any(run.energy["supplied"]) and not np.any(run.energy["dissipated"])


@pytest.mark.parametrize("kind", ["step", "linear"])
@pytest.mark.parametrize("method", ["tsit5", "DOP853"])
def test_energy_balances_with_everything_on(method, kind):
    values = np.random.default_rng(6).uniform(0.0, 5.0, (3, 3))
    profile = dtc.Profile([0.0, 0.3, 0.7], values, kind)
    start = {"x0": swift(full()), "pressure": profile, "theta": full_theta(), "t_end": 1.0}
    run = dtc.simulate(full(), **start, method=method, **TIGHT)
    assert run.success, run.message
    energy = run.energy
    for name in ("kinetic", "potential", "supplied", "dissipated"):
        assert np.ptp(energy[name]) > 1
    # 1e-10 a step; DOP853's interpolant between its long steps has order 7 only.
    assert np.max(np.abs(energy["residual"])) < 1e-7 * np.ptp(energy["dissipated"])
    assert np.all(np.diff(energy["dissipated"]) > 0)


def test_re_centring_does_not_change_the_motion():
    """Poses and energies with it and without."""
    start = {"x0": swift(full()), "pressure": [3.0, 2.0, 1.0], "theta": full_theta(), "t_end": 1.0}
    centred = dtc.simulate(full(), **start, method="tsit5", **TIGHT)
    plain = dtc.simulate(full(), **start, method="DOP853", **TIGHT)
    assert centred.recentrings and not plain.recentrings
    last = np.array([-1])
    for value, expected in zip(centred.poses(last), plain.poses(last), strict=True):
        assert np.max(np.abs(value - expected)) < 1e-8
    kinetic = [run.energy["kinetic"][-1] for run in (centred, plain)]
    assert kinetic[0] == pytest.approx(kinetic[1], rel=1e-8)


def test_canonical_form_gives_the_same_motion():
    """Eq (7) integrated by SciPy alone, momenta in place of rates, against the state equation."""
    model, theta, pressure = full(), full_theta(), np.array([3.0, 2.0, 1.0])
    n, x0, still = model.n_q, swift(model), np.zeros(model.n_q)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        rates = numbers(model.canonical_ode, y[:n], y[n:], pressure, still, theta)
        return np.concatenate(rates)

    p0 = numbers(model.momenta, x0[:n], x0[n:], theta)
    start = np.concatenate([x0[:n], p0])
    canonical = solve_ivp(rate, (0, 0.5), start, method="DOP853", **TIGHT).y[:, -1]
    inputs = {"pressure": pressure, "theta": theta, "t_end": 0.5}
    run = dtc.simulate(model, x0, **inputs, method="DOP853", **TIGHT)
    q, qd = run.q[:, -1], run.qd[:, -1]
    assert np.max(np.abs(canonical[:n] - q)) < 1e-8
    assert np.max(np.abs(canonical[n:] - numbers(model.momenta, q, qd, theta))) < 1e-8


def test_theta_replaces_the_robots_numbers():
    light = replace(seed().robot, gravity=1.62)
    model = dtc.build(light, chart="planar", parameters=("gravity",))
    assert model.theta0.tolist() == [1.62]
    start = {"x0": seed_x0(), "pressure": RAMPS, "t_end": 0.5, "method": "DOP853", **TIGHT}
    run = dtc.simulate(model, theta=np.array([9.81]), **start)
    assert np.max(np.abs(run.x[:, -1] - reference(0.5))) < 1e-8
    assert run.theta.tolist() == [9.81]
    assert np.max(np.abs(dtc.simulate(model, **start).x[:, -1] - reference(0.5))) > 0.1


def test_arguments_win_over_the_scene():
    nothing = dtc.Profile.constant(np.zeros(0))
    parts = {"q0": [1.0], "qd0": [0.0], "pressure": nothing, "options": {"chart": "hinge"}}
    scene = dtc.Scene("swing", pendulum().robot, **parts, t_end=0.1, method="rk4", step_s=1e-3)
    run = dtc.simulate(scene)
    assert (run.method, run.steps, run.t[-1]) == ("rk4", 100, 0.1)
    assert run.x[:, 0].tolist() == [1.0, 0.0]
    run = dtc.simulate(scene, [0.5, 0.0], t_end=0.2, step_s=2e-3)
    assert (run.method, run.steps, run.t[-1]) == ("rk4", 100, 0.2)
    assert run.x[:, 0].tolist() == [0.5, 0.0]
    loose, tight = (
        dtc.simulate(scene, method="RK45", t_end=2.0, rtol=rtol).steps for rtol in (1e-3, 1e-8)
    )
    assert loose < tight / 2


@pytest.mark.parametrize(
    ("t_end", "steps"), [(0.0103, 11), (0.007, 7), (0.011, 11), (1e-4, 1), (0.0010000000000001, 1)]
)
def test_fixed_steps_are_equal_and_end_at_the_end(t_end, steps):
    """A step that does not divide the time is made smaller, one that does is kept."""
    run = dtc.simulate(seed(), seed_x0(), t_end=t_end, method="rk4", step_s=1e-3)
    assert run.steps == steps and run.t[-1] == t_end
    assert np.diff(run.t) == pytest.approx(t_end / steps)


@pytest.mark.parametrize("method", ["auto", "tsit5", "LSODA", "DOP853", "RK45"])
def test_a_robot_at_rest_stays_there(method):
    """Nothing is turned over: small errors must not pass for an energy balance that is off."""
    settled = rest()
    run = dtc.simulate(seed(), settled, pressure=12.0, t_end=10.0, method=method)
    assert run.success, run.message
    assert np.max(np.abs(run.x[:, -1] - settled)) < 1e-7


class Terminal(io.StringIO):
    """A stream that says it is one."""

    def isatty(self) -> bool:
        """It is."""
        return True


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize("patience", [None, 0.0])
def test_a_bar_on_a_terminal_in_long_runs(monkeypatch, terminal, patience):
    screen = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", screen)
    if patience is not None:
        monkeypatch.setattr(sys.modules["dtcasadi.simulate"], "_PATIENCE_S", patience)
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 2.0}
    assert dtc.simulate(seed(), **start, method="rk4", step_s=1e-3).success
    if terminal and patience == 0:
        assert "of 2.00 s simulated" in screen.getvalue()
    else:
        assert not screen.getvalue()
