"""Commands in every form (`dtcasadi.commands`), their jumps, and the regulator that lags them."""

# mypy: disable-error-code="arg-type, return-value"
# Wrong types are the subject of some tests.

from functools import cache

import numpy as np
import pytest
from moving import TIGHT, cranked, full, full_theta, seed, seed_x0, swift

import dtcasadi as dtc
from dtcasadi.errors import SimulationError

# Torque of a pressure of 1 on `cranked`: area 0.5 with a lever of 0.2; its inertia.
TORQUE, INERTIA = 0.1, 2.0 * 0.5**2 + 0.1


@cache
def crank() -> dtc.Model:
    return cranked()


@cache
def regulated(minimum: float = 0.0, maximum: float = 40.0, rate: float = 1e3) -> dtc.Model:
    return cranked(dtc.Regulator(0.1, minimum, maximum, rate))


@pytest.mark.parametrize("method", ["DOP853", "auto"])
def test_every_form_of_a_constant_command(method):
    forms = [
        12,
        12.0,
        [12],
        np.array([12.0]),
        np.float32(12),
        dtc.Profile.constant(12.0),
        dtc.Profile([-1.0, 0.5, 9.0], [12.0, 12.0, 12.0], "linear"),
        lambda t: 12,
        lambda t: np.array([12.0]),
    ]
    start = {"x0": seed_x0(), "t_end": 0.5, "method": method, **TIGHT}
    runs = [dtc.simulate(seed(), pressure=form, **start) for form in forms]
    for run in runs:
        assert run.success, run.message
        assert run.pressure.shape == (1, len(run.t)) and np.all(run.pressure == 12.0)
        # The same to the tolerance: a function of time may be left to another method.
        assert np.max(np.abs(run.x[:, -1] - runs[0].x[:, -1])) < 1e-8
    named = dtc.simulate(seed(), u=12.0, **start)
    assert np.array_equal(named.x, runs[0].x)


def test_no_command_is_no_pressure():
    run = dtc.simulate(crank(), [0.0, 1.0], t_end=1.0)
    assert not np.any(run.pressure)
    assert run.qd[0] == pytest.approx(1.0)


def test_one_number_for_all_chambers_or_one_for_each():
    start = {"x0": swift(full()), "theta": full_theta(), "t_end": 0.1, "method": "DOP853"}
    runs = [dtc.simulate(full(), pressure=p, **start) for p in (2.0, [2.0, 2.0, 2.0], [2, 2, 1])]
    assert np.array_equal(runs[0].x, runs[1].x)
    assert np.max(np.abs(runs[0].x[:, -1] - runs[2].x[:, -1])) > 1e-3
    assert runs[2].pressure[:, 0].tolist() == [2.0, 2.0, 1.0]


@pytest.mark.parametrize("method", ["rk4", "DOP853", "tsit5", "rodas4", "auto"])
def test_a_step_of_the_pressure_is_two_runs_in_a_row(method):
    options = {"method": method, "step_s": 0.007 if method == "rk4" else None, **TIGHT}
    profile = dtc.Profile([0.0, 0.3], [12.0, 20.0])
    whole = dtc.simulate(seed(), seed_x0(), pressure=profile, t_end=0.8, **options)
    assert 0.3 in whole.t
    first = dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=0.3, **options)
    second = dtc.simulate(seed(), first.x[:, -1], pressure=20.0, t_end=0.5, **options)
    # Fixed steps are the same ones; others differ in the first size tried after the step.
    within = 1e-12 if method == "rk4" else 1e-8
    assert np.max(np.abs(whole.x[:, -1] - second.x[:, -1])) < within
    before, at = whole.pressure[0, whole.t < 0.3], whole.pressure[0, whole.t >= 0.3]
    assert np.all(before == 12.0) and np.all(at == 20.0)


@pytest.mark.parametrize("method", ["DOP853", "auto", "LSODA"])
def test_a_short_pulse_is_not_stepped_over(method):
    """5 ms of pressure after 50 s of rest leave a momentum; no step may be blind to them."""
    pulse = dtc.Profile([0.0, 50.0, 50.005], [0.0, 100.0, 0.0])
    run = dtc.simulate(crank(), [0.0, 0.0], pressure=pulse, t_end=60.0, method=method)
    assert run.success, run.message
    rate = 100.0 * TORQUE * 0.005 / INERTIA
    assert run.qd[0, -1] == pytest.approx(rate, rel=1e-6)
    assert run.q[0, -1] == pytest.approx(rate * (10 - 0.0025), rel=1e-6)


@pytest.mark.parametrize("method", ["DOP853", "auto", "rodas4", "LSODA"])
def test_a_ramp_is_followed_between_its_kinks(method):
    """Pressure 30 t up to 1 s, then back to zero at 2 s: the momentum is the area below."""
    ramp = dtc.Profile([0.0, 1.0, 2.0], [0.0, 30.0, 0.0], "linear")
    run = dtc.simulate(crank(), [0.0, 0.0], pressure=ramp, t_end=2.5, method=method, **TIGHT)
    assert {1.0, 2.0} <= set(run.t)
    final = 30.0 * TORQUE / INERTIA
    assert run.qd[0, -1] == pytest.approx(final, rel=1e-9)
    # The rate is symmetric about half of its final value at 1 s, and constant from 2 s on.
    assert run.q[0, -1] == pytest.approx(final * (1.0 + 0.5), rel=1e-9)
    inside = (run.t > 0) & (run.t < 1)
    assert run.pressure[0, inside] == pytest.approx(30 * run.t[inside])


def test_a_function_of_time():
    """Pressure 30 cos 2t: rate 15 sin 2t, angle 7.5 (1 - cos 2t), times torque over inertia."""
    start = {"x0": [0.0, 0.0], "t_end": 3.0, **TIGHT}
    run = dtc.simulate(crank(), pressure=lambda t: 30 * np.cos(2 * t), **start)
    assert run.success, run.message
    scale = TORQUE / INERTIA
    # LSODA bounds the error of a step, not their sum.
    assert run.qd[0] == pytest.approx(15 * scale * np.sin(2 * run.t), abs=1e-7)
    assert run.q[0] == pytest.approx(7.5 * scale * (1 - np.cos(2 * run.t)), abs=1e-7)
    assert run.pressure[0] == pytest.approx(30 * np.cos(2 * run.t))
    assert run.energy["supplied"][-1] == pytest.approx(INERTIA / 2 * run.qd[0, -1] ** 2, abs=1e-6)


def test_methods_of_this_package_say_that_they_take_no_function():
    with pytest.raises(SimulationError, match="method tsit5 takes a pressure as numbers or a Prof"):
        dtc.simulate(crank(), [0.0, 0.0], pressure=lambda t: 1.0, t_end=1.0, method="tsit5")


@pytest.mark.parametrize("method", ["auto", "LSODA", "rk4"])
def test_the_regulator_lags(method):
    """pressure = command (1 - exp(-t/T)), T = 0.1 s."""
    step_s = 1e-3 if method == "rk4" else None
    start = {"x0": np.zeros(3), "pressure": 12.0, "t_end": 0.5, "rtol": 1e-9, "atol": 1e-11}
    run = dtc.simulate(regulated(), **start, method=method, step_s=step_s)
    assert run.success, run.message
    assert run.model.state_names[-1] == "pressure_1"
    expected = 12 * (1 - np.exp(-run.t / 0.1))
    assert run.pressure[0] == pytest.approx(expected, abs=1e-6)
    assert np.array_equal(run.pressure[0], run.x[-1]) and np.all(run.u == 12.0)
    # The momentum is the integral of the pressure.
    momentum = TORQUE * (12 * run.t - 0.1 * expected)
    assert INERTIA * run.qd[0] == pytest.approx(momentum, abs=1e-6)


@pytest.mark.parametrize("method", ["auto", "LSODA"])
@pytest.mark.parametrize(
    ("command", "start", "target"), [(50.0, 0.0, 40.0), (-30.0, 20.0, 5.0), (12.0, 30.0, 12.0)]
)
def test_the_regulator_has_limits(method, command, start, target):
    """It lags the command within its limits, and a pressure outside them decays to them."""
    model, x0 = regulated(minimum=5.0), [0.0, 0.0, start]
    run = dtc.simulate(model, x0, pressure=command, t_end=2.0, method=method, **TIGHT)
    expected = target + (start - target) * np.exp(-run.t / 0.1)
    assert run.pressure[0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("method", ["auto", "LSODA"])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_regulator_has_a_rate_limit(method, way):
    """50 Pa/s, then the lag; between, from 1.25 to 0.75 of 50 T before the command, a parabola.

    With y the distance over 50 T there: T y' = (y - 0.25)(y - 2.25).
    """
    model, T, rate, command = regulated(-40.0, 40.0, 50.0), 0.1, 50.0, 20.0
    start = {"x0": np.zeros(3), "pressure": way * command, "t_end": 1.0, "method": method}
    run = dtc.simulate(model, **start, rtol=1e-9, atol=1e-11)
    assert run.success, run.message
    first = (command - 1.25 * rate * T) / rate
    last = first + T * np.log(3.0) / 2
    E = np.exp(2 * (run.t - first) / T)
    passing = (2.25 + 0.25 * E) / (1 + E)
    y = np.where(run.t < last, passing, 0.75 * np.exp(-(run.t - last) / T))
    expected = way * np.where(run.t < first, rate * run.t, command - y * rate * T)
    assert run.pressure[0] == pytest.approx(expected, abs=1e-6)
    assert np.max(np.abs(np.diff(run.pressure[0]) / np.diff(run.t))) < rate * (1 + 1e-6)


def fails(t: float) -> float:
    """A function with a fault of its own."""
    raise KeyError("valve")


ONE = "pressure(0): expected a finite number, got"


@pytest.mark.parametrize(
    ("pressure", "message"),
    [
        ([1.0, 2.0], "pressure: expected finite numbers of shape (1), got shape (2,)"),
        ([], "pressure: expected finite numbers of shape (1), got shape (0,)"),
        ([[1.0]], "pressure: expected finite numbers of shape (1), got shape (1, 1)"),
        (np.nan, "pressure: expected a finite number, got nan"),
        ([np.inf], "pressure: expected finite numbers of shape (1), got [inf]"),
        ("12 kPa", "pressure: expected a finite number, got '12 kPa'"),
        (True, "pressure: expected a finite number, got True"),
        (
            dtc.Profile([0.0], [[1.0, 2.0]]),
            "pressure: expected 1 commands, one for each chamber, got 2",
        ),
        (lambda t: np.nan, f"{ONE} nan"),
        (lambda t: [1.0, 2.0], f"{ONE} [1.0, 2.0]"),
        (lambda t: np.array([np.inf]), f"{ONE} [inf]"),
        (lambda t: None, f"{ONE} None"),
        (lambda t: "high", f"{ONE} 'high'"),
        (lambda t: [[1.0], [1.0, 2.0]], f"{ONE} [[1.0], [1.0, 2.0]]"),
        (lambda t: {"p": 1}, f"{ONE} {{'p': 1}}"),
        (lambda t: 1 + 1j, f"{ONE} (1+1j)"),
    ],
)
def test_faults_are_named(pressure, message):
    with pytest.raises(SimulationError) as caught:
        dtc.simulate(crank(), [0.0, 0.0], pressure=pressure, t_end=1.0)
    assert str(caught.value) == message


@pytest.mark.parametrize("method", ["auto", "LSODA", "Radau", "DOP853"])
def test_a_function_that_fails_later_says_when(method):
    def pressure(t: float) -> float:
        return 12.0 if t < 0.5 else np.nan

    with pytest.raises(SimulationError, match=r"pressure\((0\.[5-9]|1)[0-9]*\): expected a finite"):
        dtc.simulate(crank(), [0.0, 0.0], pressure=pressure, t_end=1.0, method=method)


def test_a_functions_own_fault_is_not_hidden():
    with pytest.raises(KeyError, match="valve"):
        dtc.simulate(crank(), [0.0, 0.0], pressure=fails, t_end=1.0)
