"""Regulator and dead time: limits, asymmetry, closed forms; Jacobians of all at their switches."""

import math
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tanks import LITRE, SMALL, Tank, gas, servo

from dtcasadi.actuators import Actuator, Delay, Direct, Hysteresis, Orifice, Regulator, Valve
from dtcasadi.actuators.orifice import REFERENCE_PRESSURE
from dtcasadi.errors import ModelError

LIMITED = Regulator(
    time_constant=0.1,
    minimum=-5e3,
    maximum=4e4,
    rate_limit=2e5,
    vent_time_constant=0.3,
    vent_rate_limit=5e4,
    blend=100.0,
)


def rate(tank: Tank, pressure: float, u: float) -> float:
    return float(tank.rate(pressure, u, LITRE, 0.0))


def test_rates_between_the_switches_are_the_plain_ones():
    tank = Tank(LIMITED)
    assert rate(tank, 1e4, 2e4) == pytest.approx(1e4 / 0.1, rel=1e-4)  # (blend / error)^2 / 4
    assert rate(tank, 2e4, 1e4) == pytest.approx(-1e4 / 0.3, rel=1e-4)
    assert rate(tank, -5e3, 9e9) == 2e5 and rate(tank, 4e4, -9e9) == -5e4
    assert rate(tank, 4e4, 9e9) == rate(tank, -5e3, -9e9) == rate(tank, 1e4, 1e4) == 0.0


def test_a_step_is_an_exponential():
    times = np.linspace(0.0, 0.3, 4)
    found = Tank(Regulator(0.1)).run(0.0, 2e4, times)
    assert np.allclose(found, 2e4 * (1 - np.exp(-times / 0.1)), rtol=1e-7)


@given(st.lists(st.floats(-1e30, 1e30), min_size=1, max_size=4), st.floats(-5e3, 4e4))
@settings(max_examples=25, deadline=None)
def test_pressure_and_rate_stay_within_their_limits(commands, start):
    tank, times = Tank(LIMITED), np.linspace(0.0, 0.2, 6)
    for command in commands:
        found = tank.run(start, command, times)
        assert np.all((found >= -5e3 - 1e-3) & (found <= 4e4 + 1e-3))  # the solver's 1e-10
        rates = np.array([rate(tank, p, command) for p in found])
        assert np.all((rates >= -5e4) & (rates <= 2e5))
        start = float(np.clip(found[-1], -5e3, 4e4))


def test_each_chamber_may_have_its_own_numbers():
    with pytest.raises(ModelError, match=r"regulator.maximum\[1\]: expected a finite number"):
        Regulator(maximum=(math.inf, 1e3))
    tank = Tank(Regulator(time_constant=(0.1, 0.2), maximum=(3e4, 1e3)), n=2)
    found = tank.rate([0.0, 0.0], [2e4, 2e4], [LITRE] * 2, [0.0] * 2).full().ravel()
    assert np.allclose(found, [2e4 / 0.1, 1e3 / 0.2])


# ---- dead time -----------------------------------------------------------------------------------


@pytest.mark.parametrize("lags", [1, 3])
def test_a_chain_of_lags(lags):
    """Its answer to a step is Erlang's distribution; its mean delay is the dead time."""
    time, command = 0.2, 1e4
    tank = Tank(Delay(Direct(), time, lags))
    times = np.linspace(0.05, 1.0, 6)
    z = np.zeros(lags)
    n, k = 4000, 0
    h, found = times[-1] / n, []
    for step in range(1, n + 1):  # explicit midpoint: h^2 k^2 / time^2 = 1e-5
        half = z + h / 2 * tank.rate(z, command, LITRE, 0.0).full().ravel()
        z = z + h * tank.rate(half, command, LITRE, 0.0).full().ravel()
        if k < len(times) and step * h >= times[k] - 1e-12:
            found.append(float(tank.pressure(z, command, LITRE, 0.0)))
            k += 1
    s = times * lags / time
    sums = sum(s**j / math.factorial(j) for j in range(lags))
    assert np.allclose(np.array(found) / command, 1 - np.exp(-s) * sums, atol=1e-4)


def test_without_lags_the_graph_sees_the_command_that_has_arrived():
    tank = Tank(Delay(Regulator(0.1), 0.05, lags=0))
    assert tank.actuator.dead_time == 0.05 and Delay(Direct(), 0.05).dead_time == 0.0
    assert Delay(tank.actuator, 0.02, lags=0).dead_time == pytest.approx(0.07)
    assert rate(tank, 0.0, 1e4) == 1e5


# ---- Jacobians -----------------------------------------------------------------------------------

ROOM = np.array([[0.9 * LITRE], [LITRE]])  # volume and rest volume


def check(
    actuator: Actuator, at: list, steps: list[float], columns: list[float], rows: list[float]
) -> None:
    """Jacobian finite and that of central differences: within 1e-4 of a change by the columns.

    Differences are wrong by their steps times the curvature, which jumps at the switches.
    """
    tank = Tank(actuator)
    arrays = [np.atleast_1d(np.array(part, dtype=float)) for part in at]
    exact, found = tank.slopes(arrays), tank.differences(arrays, steps)
    assert np.all(np.isfinite(exact))
    assert np.max(np.abs(exact - found) * np.array(columns) / np.array(rows)[:, None]) < 1e-4


@pytest.mark.parametrize("distance", [0.0, 1.0, -1.0, 1.5e4, 2e4, 2.5e4, -1.125e4, -1.5e4, 3e4])
def test_jacobian_of_the_regulator(distance):
    """At the command, where filling becomes venting, and through both rate limits."""
    regulator = Regulator(0.1, -1e5, 1e5, 2e5, 0.3, 5e4, blend=100.0)
    at = [2e4, 2e4 + distance, LITRE, 0.0]
    check(regulator, at, [0.01, 0.01, 1e-9, 1e-9], [1e4, 1e4, LITRE, LITRE], [1e4, 1e5])


@pytest.mark.parametrize("bound", [0.0, 5e4])
def test_jacobian_at_the_end_of_the_commands(bound):
    """Exactly at a limit half the slope, as central differences have it."""
    at = [2e4, bound, LITRE, 0.0]
    columns = [1e4, 1e4, LITRE, LITRE]
    check(Regulator(0.1, 0.0, 5e4), at, [0.01, 0.01, 1e-9, 1e-9], columns, [1e4, 1e5])


@pytest.mark.parametrize("u", [-1.0, -0.5, -0.04, 0.0, 0.02, 0.04, 0.7, 1.0])
@pytest.mark.parametrize("gauge", [0.0, 1.0, -1.0, 1.9e4, 3e5])
def test_jacobian_of_the_gas(u, gauge):
    """Shut, opening and open; without a difference to either side; at the choked passage."""
    actuator = gas(exponent=1.2, leak=Orifice(1e-10))
    at = [actuator.rest_state(np.array([gauge]), *ROOM), u, ROOM[0], 0.0]
    rows = [1e5, SMALL * REFERENCE_PRESSURE * 4e5]  # the largest flow
    check(actuator, at, [1e-5, 1e-6, 1e-10, 1e-9], [100.0, 1.0, LITRE, LITRE], rows)


@pytest.mark.parametrize("distance", [0.0, 40.0, -40.0, 1.5e3, 2e3, 2.5e3, -2.5e3])
def test_jacobian_of_the_pressure_valve(distance):
    """In the middle, at the ends of the underlap and where it is fully open."""
    actuator = servo()
    at = [actuator.rest_state(np.array([2e4]), *ROOM), 2e4 + distance, ROOM[0], 0.0]
    rows, columns = [1e5, SMALL * REFERENCE_PRESSURE * 4e5], [2.0, 2e3, LITRE / 50, LITRE]
    check(actuator, at, [1e-6, 1e-3, 1e-11, 1e-9], columns, rows)


@pytest.mark.parametrize("w", [0.0, 0.5, -1.0, 1.0])
@pytest.mark.parametrize("rate", [0.0, 1e-5, -1e-3])
@pytest.mark.parametrize("sharpness", [2, 3])
def test_jacobian_of_hysteresis(w, rate, sharpness):
    """At reversal, without friction and at full friction; creep fast enough for differences."""
    actuator = Hysteresis(Regulator(0.1), 500.0, 0.05, sharpness, 1.0, break_in=1e3)
    at = [[2e4, w, 0.7], 2e4, 1.1 * LITRE, rate]
    columns = [1e4, 1.0, 1.0, 1e4, LITRE, LITRE]
    check(actuator, at, [1e-5, 1e-3, 1e-9, 1e-9], columns, [1e4, 1e5, 20.0, 1.0])


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Regulator(0.0), "regulator.time_constant: expected a finite positive number"),
        (lambda: Regulator(maximum=-1.0), "regulator.maximum: expected a pressure above"),
        (lambda: Regulator(rate_limit=-1.0), "regulator.rate_limit: expected a finite positive"),
        (lambda: Regulator(time_constant=(1.0, "x")), r"regulator.time_constant\[2\]: expected"),
        (lambda: Delay(Direct(), -1.0), "delay.time: expected a finite positive number"),
        (lambda: Delay(Direct(), 0.1, 99), "delay.lags: expected an integer from 0 to 20"),
        (lambda: Delay(cast(Any, "direct"), 0.1), "delay.source: expected an actuator"),
        (lambda: Hysteresis(Direct(), -1.0), "hysteresis.amplitude: expected a finite non-neg"),
        (lambda: Hysteresis(Direct(), 1.0, sharpness=1), "hysteresis.sharpness: expected an int"),
        (lambda: Valve(2.0), "valve.overlap: expected a number between 0 and 1"),
    ],
)
def test_errors_name_the_field(make, text):
    with pytest.raises(ModelError, match=text):
        make()
