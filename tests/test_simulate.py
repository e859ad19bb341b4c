"""`dtcasadi.simulate`: methods agree, energy balances, faults are named, NaN is no success."""

# mypy: disable-error-code="arg-type"
# Wrong types are the subject of some tests.

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
from dtcasadi.integrators import METHODS


@cache
def reference(t_end: float) -> np.ndarray:
    """The seed robot's state by an explicit method of order 8 at 1e-12."""
    options: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    return dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=t_end, **options).x[:, -1]


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
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 2.0, "rtol": 1e-9, "atol": 1e-11}
    run = dtc.simulate(seed(), **start, method=method, step_s=step_s)
    assert run.success and run.t[0] == 0 and run.t[-1] == 2.0
    # A thousand local errors of 1e-9 of coordinates near 1.
    assert np.max(np.abs(run.x[:, -1] - reference(2.0))) < 1e-6


@pytest.mark.parametrize("kind", ["step", "linear"])
def test_fourth_order(kind):
    """rk4's error falls by 16 when the step is halved, over jumps and kinks off the grid too."""
    profile = dtc.Profile([0.0, 0.2971, 0.5513], [12.0, 20.0, 6.0], kind)
    start = {"x0": seed_x0(), "pressure": profile, "t_end": 0.8}
    exact = dtc.simulate(seed(), **start, method="DOP853", rtol=1e-12, atol=1e-14).x[:, -1]
    errors = [
        np.linalg.norm(dtc.simulate(seed(), **start, method="rk4", step_s=h).x[:, -1] - exact)
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
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 0.5, "method": "DOP853", **TIGHT}
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


def test_the_last_step_ends_at_the_end():
    """A step that does not divide the time is made to."""
    run = dtc.simulate(seed(), seed_x0(), t_end=0.0103, method="rk4", step_s=1e-3)
    assert run.steps == 10 and run.t[-1] == 0.0103
    assert np.diff(run.t) == pytest.approx(0.00103)
    run = dtc.simulate(seed(), seed_x0(), t_end=1e-4, method="rk4", step_s=1e-3)
    assert run.steps == 1 and run.t[-1] == 1e-4


@pytest.mark.parametrize("method", ["auto", "tsit5", "LSODA", "DOP853", "RK45"])
def test_a_robot_at_rest_stays_there(method):
    """Nothing is turned over: small errors must not pass for an energy balance that is off."""
    settled = rest()
    run = dtc.simulate(seed(), settled, pressure=12.0, t_end=10.0, method=method)
    assert run.success, run.message
    assert np.max(np.abs(run.x[:, -1] - settled)) < 1e-7


def check_it_is_honest(run: dtc.Run, t_end: float) -> None:
    """What holds of every result: finite states, and a success only if all of it is one."""
    assert np.all(np.isfinite(run.x)) and np.all(np.isfinite(run.t))
    assert run.t[0] == 0 and np.all(np.diff(run.t) > 0)
    assert run.x.shape == (run.model.n_x, len(run.t)) and run.steps == len(run.t) - 1
    if run.success:
        assert run.t[-1] == t_end
        assert all(np.all(np.isfinite(values)) for values in run.energy.values())
        assert np.all(np.isfinite(run.condition))
        assert run.message.startswith(f"reached t = {t_end:g} s in {run.steps} steps of ")
    else:
        assert "reached t" not in run.message


@pytest.mark.parametrize(
    ("method", "step_s"),
    [("euler", 0.02), ("rk4", 0.01), ("rk4", 0.02), ("rk4", 0.1), ("rk4", 1.0)],
)
def test_too_large_a_step_ends_without_success(method, step_s):
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 20.0, "step_s": step_s}
    limit = "is beyond the linear stability limit 0.00[0-9]+ s"
    with pytest.raises(SimulationError, match=f"step_s: {step_s:g} s {limit} of {method} at the"):
        dtc.simulate(seed(), **start, method=method)
    run = dtc.simulate(seed(), **start, method=method, force=True)
    check_it_is_honest(run, 20.0)
    assert not run.success and run.t[-1] < 20.0
    assert f"{method}: the step gave a state that is not finite after t = " in run.message
    assert f"t = {run.t[-1]:.6g} s (step {step_s:.2g} s, segment " in run.message


@pytest.mark.parametrize("pressure", [1e6, 1e12, 1e30, -1e30])
@pytest.mark.parametrize("method", ["rk4", "rodas4"])
def test_absurd_pressures_end_in_an_honest_result(method, pressure):
    # A fixed step, or so short a time that error control cannot take for ever.
    t_end = 0.05 if method == "rk4" else 1e3 / abs(pressure)
    start = {"x0": seed_x0(), "pressure": pressure, "t_end": t_end}
    run = dtc.simulate(seed(), **start, method=method, step_s=1e-3, force=True)
    check_it_is_honest(run, t_end)
    if method == "rk4":
        assert not run.success and run.t[-1] < t_end


@pytest.mark.parametrize("method", ["auto", "tsit5", "rk4"])
def test_absurd_rates_end_in_an_honest_result(method):
    x0 = seed_x0()
    x0[6:] = 1e30
    run = dtc.simulate(seed(), x0, t_end=0.1, method=method, step_s=1e-3, force=True)
    check_it_is_honest(run, 0.1)
    assert not run.success
    assert "after t = 0 s" in run.message


def test_finite_states_that_are_no_solution_are_no_success():
    """Explicit Euler feeds a free motion with energy, at this step by more than a tenth."""
    start = {"x0": [1.0, 0.0], "t_end": 2.0, "method": "euler"}
    run = dtc.simulate(pendulum(), **start, step_s=0.02, force=True)
    check_it_is_honest(run, 2.0)
    assert not run.success and run.t[-1] == 2.0
    assert "euler: the energy balance is off by" in run.message
    assert dtc.simulate(pendulum(), **start, step_s=1e-4).success


def test_no_bar_where_nobody_looks(capsys):
    dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=1.0)
    assert capsys.readouterr() == ("", "")


def test_a_bar_on_a_terminal(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(sys.modules["dtcasadi.simulate"], "_PATIENCE_S", 0.0)
    dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=2.0, method="rk4", step_s=2e-4)
    assert "of 2.00 s simulated" in screen.getvalue()


NAN = np.where(np.arange(12) == 3, np.nan, 0.0)
KNOWN = ", ".join(METHODS)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x0": np.zeros(11)}, "x0: expected finite numbers of shape (12), got shape (11,)"),
        ({"x0": NAN}, "x0: expected finite numbers of shape (12), got [0.0, 0.0, 0.0, nan, "),
        ({"x0": "rest"}, "x0: expected finite numbers of shape (12), got 'rest'"),
        ({"x0": None}, "x0: expected the initial state of the model, got None"),
        ({"t_end": -1.0}, "t_end: expected a finite positive number, got -1.0"),
        ({"t_end": 0.0}, "t_end: expected a finite positive number, got 0.0"),
        ({"t_end": np.nan}, "t_end: expected a finite positive number, got nan"),
        ({"t_end": np.inf}, "t_end: expected a finite positive number, got inf"),
        ({"t_end": None}, "t_end: expected a finite positive number, got None"),
        ({"t_end": True}, "t_end: expected a finite positive number, got True"),
        ({"method": "rk5"}, f"method: expected one of {KNOWN}, got 'rk5'"),
        ({"method": ""}, f"method: expected one of {KNOWN}, got ''"),
        ({"method": ["rk4"]}, f"method: expected one of {KNOWN}, got ['rk4']"),
        ({"rtol": 0.0}, "rtol: expected a finite positive number, got 0.0"),
        ({"atol": -1e-9}, "atol: expected a finite positive number, got -1e-09"),
        ({"step_s": 0}, "step_s: expected a finite positive number, got 0"),
        ({"method": "rk4"}, "step_s: method rk4 needs a step [s], got None"),
        ({"theta": [1.0]}, "theta: expected finite numbers of shape (0), got shape (1,)"),
        ({"u": 1.0}, "expected either pressure or u, got both"),
    ],
)
def test_faults_are_named(changes, message):
    arguments = {"x0": seed_x0(), "pressure": 12.0, "t_end": 0.1, **changes}
    with pytest.raises(SimulationError) as caught:
        dtc.simulate(seed(), **arguments)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("subject", ["seed_four_disc", None, 3])
def test_what_to_simulate(subject):
    with pytest.raises(SimulationError, match=f"expected a Scene or a Model, got {subject!r}"):
        dtc.simulate(subject)


def test_a_robot_is_not_yet_a_model():
    with pytest.raises(SimulationError, match=r"expected a Scene or a Model, got Robot\("):
        dtc.simulate(seed().robot)
