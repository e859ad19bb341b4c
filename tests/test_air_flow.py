"""Orifices and the gas law against textbooks: isolated tanks, choked and subsonic flow."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tanks import ATMOSPHERE, LITRE, SMALL, Tank, gas, servo

from dtcasadi.actuators import Orifice
from dtcasadi.actuators.orifice import REFERENCE_PRESSURE, REFERENCE_TEMPERATURE, SPECIFIC
from dtcasadi.errors import ModelError

# Relative flow that smoothing changes: (LAMINAR p / difference)^2 / 2 and (SWITCH / 2)^2 where it
# is largest, at the ends of the subsonic range; a few 1e-4 in between.
# Pressures within 2 % of each other are left out.
SMOOTHING = 1e-3


def iso_6358(ratio: np.ndarray, b: float) -> np.ndarray:
    """Flow over the choked one, the standard's ellipse."""
    return np.where(ratio <= b, 1.0, np.sqrt(1 - ((np.maximum(ratio, b) - b) / (1 - b)) ** 2))


def nozzle(p1: float, p2: np.ndarray, area: float) -> np.ndarray:
    """Mass flow of an isentropic nozzle (Anderson, Modern Compressible Flow, section 5.4)."""
    gamma = 1.4
    critical = (2 / (gamma + 1)) ** (gamma / (gamma - 1))
    r = np.maximum(p2 / p1, critical)
    psi = np.sqrt(2 * gamma / (gamma - 1) * (r ** (2 / gamma) - r ** ((gamma + 1) / gamma)))
    return area * p1 / np.sqrt(SPECIFIC) * psi


def flow(orifice: Orifice, p1: float, p2: float) -> float:
    return float(orifice.flow(p1, p2))


def test_flow_by_the_standard():
    orifice, p1 = Orifice(SMALL, 0.3), 4e5
    ratios = np.concatenate([np.linspace(0.0, 0.27, 9), np.linspace(0.33, 0.98, 30)])
    found = np.array([flow(orifice, p1, r * p1) for r in ratios])
    expected = REFERENCE_PRESSURE * SMALL * p1 * iso_6358(ratios, 0.3)
    assert np.max(np.abs(found / expected - 1)) < SMOOTHING
    # 0.5 l/(s bar) of reference air at 4 bar: 2 l/s, 2.4 g/s.
    assert found[0] / SPECIFIC == pytest.approx(2e-3 * 1.1884, rel=1e-3)


def test_flow_through_a_hole_by_the_nozzle():
    """The standard's ellipse meets the isentropic flow within 0.5 % of the choked one."""
    diameter, p1 = 1e-3, 3e5
    orifice = Orifice.from_hole(diameter, 0.8)
    ratios = np.linspace(0.0, 0.99, 50)
    found = np.array([flow(orifice, p1, r * p1) for r in ratios]) / SPECIFIC
    expected = nozzle(p1, ratios * p1, 0.8 * np.pi / 4 * diameter**2)
    assert np.max(np.abs(found - expected)) < 0.005 * expected[0]
    assert found[0] == pytest.approx(expected[0], rel=1e-6)


@given(st.floats(0.0, 1e6), st.floats(1e3, 1e6))
@settings(max_examples=200)
def test_flow_is_odd_bounded_and_runs_downhill(p1, p2):
    orifice = Orifice(SMALL, 0.3)
    there, back = flow(orifice, p1, p2), flow(orifice, p2, p1)
    assert there == -back and there * (p1 - p2) >= 0
    choked = REFERENCE_PRESSURE * SMALL * max(p1, p2)
    assert abs(there) <= choked * (1 + 1e-6)  # LAMINAR^2 / 4 of round corner, then round-off


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.4])
def test_choked_venting(exponent):
    """p = p0 (1 + (n - 1) t / (2 T))^(-2n/(n-1)), T = V / (C p_ref sqrt(T1/T0)); n = 1: exp.

    Into a vacuum it stays choked. T1 is the start's temperature, by n, from ambient air.
    """
    tank = Tank(gas(exponent=exponent, exhaust_pressure=-ATMOSPHERE + 10.0))
    start = 6e5
    warmth = (1 + start / ATMOSPHERE) ** ((exponent - 1) / exponent)
    T = LITRE / (SMALL * REFERENCE_PRESSURE * np.sqrt(warmth))
    times = np.linspace(0.0, 3 * T, 7)
    found = tank.run(start, -1.0, times) + ATMOSPHERE
    n = exponent
    law = np.exp(-times / T)
    if n > 1:
        law = (1 + (n - 1) * times / (2 * T)) ** (-2 * n / (n - 1))
    assert np.max(np.abs(found / (law * (start + ATMOSPHERE)) - 1)) < SMOOTHING


def test_subsonic_venting():
    """With r = p_atm / p: dr/dt = k r phi(r), whose integral is elementary."""
    b, start, end = 0.4, 1.4e5, 5e3
    tank = Tank(gas())
    k = SMALL * REFERENCE_PRESSURE / LITRE

    def time(r: float) -> float:
        """Integral of dr / (r phi(r)), phi = sqrt(X) / (1 - b), X = (1 - 2b) + 2 b r - r^2."""
        A = 1 - 2 * b
        X = A + 2 * b * r - r**2
        return -(1 - b) / np.sqrt(A) * np.log((2 * np.sqrt(A * X) + 2 * b * r + 2 * A) / r)

    first, last = (ATMOSPHERE / (p + ATMOSPHERE) for p in (start, end))
    assert b < first  # subsonic from the start
    times = np.array([0.0, (time(last) - time(first)) / k])
    assert tank.run(start, -1.0, times)[-1] == pytest.approx(end, rel=5 * SMOOTHING)


def test_choked_filling():
    """The pressure rises in proportion to time until the ratio is critical."""
    tank = Tank(gas())
    rate = SMALL * REFERENCE_PRESSURE * (3e5 + ATMOSPHERE) / LITRE
    times = np.linspace(0.0, 0.9 * (0.3 * (3e5 + ATMOSPHERE) - 2e4) / rate, 5)
    start = 2e4 - ATMOSPHERE
    assert np.allclose(tank.run(start, 1.0, times) - start, rate * times, rtol=SMOOTHING, atol=1)


def test_leak_and_shut_valve():
    """A shut valve holds the pressure to the last digit; a leak lets it go."""
    times = np.linspace(0.0, 20.0, 5)
    assert np.ptp(Tank(gas()).run(2e4, 0.0, times)) == 0.0
    leaking = Tank(gas(leak=Orifice(SMALL / 100))).run(2e4, 0.0, times)
    assert np.all(np.diff(leaking) < 0) and leaking[-1] > 0


def test_flows_are_the_rate_of_the_air():
    """Mass balance: what comes in less what goes out, in kg, to round-off."""
    tank = Tank(servo(leak=Orifice(SMALL / 10), exponent=1.3))
    for command in (0.0, 2e4, 3e5):
        at = [120.0], command, LITRE, 0.0
        _, supply, exhaust, leak = (float(part) for part in tank.signals(*at))
        rate = float(tank.rate(*at)) / SPECIFIC
        scale = abs(supply) + abs(exhaust) + abs(leak)
        assert rate == pytest.approx(supply - exhaust - leak, abs=1e-15 * scale)


@given(
    st.lists(st.one_of(st.floats(-1e30, 1e30), st.floats(-2, 2)), min_size=1, max_size=4),
    st.sampled_from([Tank(gas()), Tank(servo()), Tank(gas(exponent=1.4, leak=Orifice(SMALL)))]),
    st.floats(0.0, 3e5),
)
@settings(max_examples=20, deadline=None)
def test_pressures_and_flows_stay_within_their_limits(commands, tank, start):
    """Whatever steps the command makes: between exhaust and supply, flows at most choked ones."""
    for command in commands:
        found = tank.run(start, command, np.linspace(0.0, 0.4, 4))
        # The solver's tolerance of 1e-10 is relative to 4e5 Pa.
        assert np.all((found >= -1e-3) & (found <= 3e5 + 1e-3))
        start = float(np.clip(found[-1], 0.0, 3e5))
        state = tank.actuator.rest_state(np.array([start]), *np.full((2, 1), LITRE))
        _, supply, exhaust, _ = (float(s) for s in tank.signals(state, command, LITRE, 0.0))
        largest = SMALL * REFERENCE_PRESSURE * (3e5 + ATMOSPHERE) / SPECIFIC * (1 + 1e-6)
        # Where both sides are at one pressure round-off may point either way.
        assert -1e-9 * largest <= min(supply, exhaust) and max(supply, exhaust) <= largest


def test_pressure_valve_settles_at_its_command():
    tank = Tank(servo())
    for start, command in ((0.0, 2e4), (8e4, 2e4), (2e4, 0.0)):
        settled = tank.run(start, command, np.array([0.0, 5.0]))[-1]
        assert abs(settled - command) <= 0.02 * 2e3 * (1 + 1e-6)  # underlap times band


@pytest.mark.parametrize("exponent", [1.0, 1.3])
def test_energy_of_sealed_air(exponent):
    """-dE/dV is the gauge pressure and dE/d(air) times the flow is what is supplied."""
    tank = Tank(gas(exponent=exponent, dead_volume=2e-4))

    def energy(volume: float, scale: float = 1.0) -> float:
        return float(tank.closed(150.0 * scale, 0.0, volume, 0.0)[0])

    h = 1e-6
    for volume in (1e-3, 4e-4, 3e-5, -2e-5):  # the last is folded
        slope = (energy(volume + h * LITRE) - energy(volume - h * LITRE)) / (2 * h * LITRE)
        pressure = float(tank.pressure(150.0, 0.0, volume, 0.0))
        assert slope == pytest.approx(-pressure, rel=1e-7, abs=1e-3)
    worth = (energy(LITRE, 1 + h) - energy(LITRE, 1 - h)) / (2 * h * 150.0)
    inflow = float(tank.rate(150.0, 1.0, LITRE, 0.0))
    assert float(tank.closed(150.0, 1.0, LITRE, 0.0)[1]) == pytest.approx(worth * inflow, rel=1e-7)
    # Nothing is stored in air at rest with the atmosphere.
    rest = gas(exponent=exponent).rest_state(np.zeros(1), *np.full((2, 1), LITRE))
    assert abs(float(Tank(gas(exponent=exponent)).closed(rest, 0.0, LITRE, 0.0)[0])) < 1e-4


def test_the_reference_is_iso_8778():
    assert REFERENCE_PRESSURE == 1e5 and REFERENCE_TEMPERATURE == 293.15


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Orifice(0.0), "orifice.conductance: expected a finite positive number"),
        (lambda: Orifice(SMALL, 0.95), "orifice.critical_ratio: expected a number up to 0.9"),
        (lambda: Orifice.from_hole(-1.0), "orifice.diameter: expected a finite positive"),
        (lambda: gas(supply=1.0), "gas.supply: expected an Orifice, got 1.0"),
        (lambda: gas(valve="servo"), "gas.valve: expected a Valve or a PressureValve"),
        (lambda: gas(supply_pressure=-1.0), "gas.supply_pressure: expected a gauge pressure above"),
        (lambda: gas(exhaust_pressure=-2e5), "gas.exhaust_pressure: expected a gauge pressure"),
        (lambda: gas(exponent=0.9), "gas.exponent: expected a number from 1"),
        (
            lambda: gas(dead_volume=(1e-3, -1e-3)),
            r"gas.dead_volume\[2\]: expected a finite non-neg",
        ),
    ],
)
def test_errors_name_the_field(make, text):
    with pytest.raises(ModelError, match=text):
        make()
