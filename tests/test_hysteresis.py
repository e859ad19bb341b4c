"""Hysteresis on chambers whose volume is prescribed: closed forms, loops, energy, break-in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tanks import LITRE, Tank

from dtcasadi.actuators import Direct, Hysteresis

AMPLITUDE, TRAVEL = 800.0, 0.04


def walls(**changes: object) -> Tank:
    fields: dict = {"amplitude": AMPLITUDE, "travel": TRAVEL, "sharpness": 2, "creep_time": 1e6}
    return Tank(Hysteresis(Direct(), **fields | changes))


def along(tank: Tank, stretch: np.ndarray, seconds: float, start: np.ndarray) -> np.ndarray:
    """States along the path V = rest (1 + stretch), samples evenly in time; RK4 on each piece."""
    h = seconds / (len(stretch) - 1)
    z, found = np.array(start, dtype=float), [np.array(start, dtype=float)]
    for a, b in zip(stretch, stretch[1:], strict=False):
        rate = (b - a) / h * tank.rest

        def slope(z: np.ndarray, share: float, a: float = a, b: float = b, v: float = rate):
            volume = tank.rest * (1 + a + share * (b - a))
            return tank.rate(z, 0.0, volume, v).full().ravel()

        k1 = slope(z, 0.0)
        k2 = slope(z + h / 2 * k1, 0.5)
        k3 = slope(z + h / 2 * k2, 0.5)
        k4 = slope(z + h * k3, 1.0)
        z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        found.append(z)
    return np.array(found)


def test_growing_is_a_tangent_and_turning_back_a_line():
    """n = 2: w = tanh(stretch / travel) from rest; back from w0 it falls in proportion to zero."""
    tank = walls()
    stretch = np.linspace(0.0, 0.06, 301)
    w = along(tank, stretch, 1.0, np.zeros(1))[:, 0]
    # Creep of (travel / creep_time)^2 beside v^2: far below RK4's 1e-9 with 300 steps.
    assert np.allclose(w, np.tanh(stretch / TRAVEL), atol=1e-7)
    back = np.linspace(0.06, 0.06 - TRAVEL * w[-1], 301)
    assert np.allclose(
        along(tank, back, 1.0, w[-1:])[:, 0], w[-1] - (0.06 - back) / TRAVEL, atol=1e-7
    )


@pytest.mark.parametrize("sharpness", [2, 5])
def test_loops_close_have_the_right_direction_and_lose_energy(sharpness):
    tank = walls(sharpness=sharpness)
    angle = np.linspace(0.0, 2 * np.pi, 401)
    stretch = 0.3 * (1 - np.cos(angle)) / 2
    first = along(tank, stretch, 1.0, np.zeros(1))
    w = along(tank, np.tile(stretch, 5), 5.0, first[-1])[-len(stretch) :, 0]
    # Each cycle forgets the start by a factor of more than 1e3.
    assert abs(w[-1] - w[0]) < 1e-6 and abs(first[-1, 0] - first[0, 0]) > 0.5
    pushed = np.array(
        [
            float(tank.pressure(x, 2e4, tank.rest * (1 + s), 0.0))
            for x, s in zip(w, stretch, strict=True)
        ]
    )
    growing, shrinking = pushed[100], pushed[300]  # the same volume on both ways
    assert growing < 2e4 < shrinking
    assert shrinking - growing == pytest.approx(2 * AMPLITUDE, rel=0.15)
    lost = -float(np.trapezoid(pushed, stretch * tank.rest))
    rates = np.gradient(stretch, angle) * 2 * np.pi * tank.rest
    powers = [float(tank.accounts(x, 2e4, tank.rest, v)[2]) for x, v in zip(w, rates, strict=True)]
    assert lost > 0 and lost == pytest.approx(np.trapezoid(powers, angle) / (2 * np.pi), rel=1e-3)


def test_loops_do_not_depend_on_the_rate():
    stretch = 0.08 * np.sin(np.linspace(0.0, 4 * np.pi, 801))
    slow, fast = (along(walls(), stretch, seconds, np.zeros(1)) for seconds in (100.0, 0.1))
    # Creep: |v| is off by (travel / creep_time)^2 / (2 v), 1e-10 of it, more at the turns.
    assert np.max(np.abs(slow - fast)) < 1e-5


def test_a_resting_chamber_creeps_no_faster_than_its_creep_time():
    tank = walls(creep_time=100.0)
    w = along(tank, np.zeros(101), 100.0, np.array([1.0]))[:, 0]
    assert np.all(np.diff(w) < 0) and w[-1] > np.exp(-1.0)
    assert w[-1] == pytest.approx(1 / (1 + 0.5), rel=1e-6)  # dw/dt = -w^2 / (2 creep_time)


@given(
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(-1e-2, 1e-2),
    st.sampled_from([walls(), walls(sharpness=3, break_in=2e3), walls(creep_time=0.1)]),
)
def test_energy_is_never_created(w, stretch, rate, tank):
    """What the walls take is stored or lost, the loss is not negative, and w stays within 1."""
    state = np.array([w, 0.6][: len(tank.actuator.state_names(1))])
    at = state, 2e4, tank.rest * (1 + stretch), rate
    stored, supplied, lost = (float(part) for part in tank.accounts(*at))
    assert stored >= 0 and lost >= -1e-12 * abs(supplied)
    slope = tank.rate(*at).full().ravel()
    h = 1e-6

    def energy(side: float) -> float:
        moved = state + side * h * slope, 2e4, at[2] + side * h * rate, rate
        return float(tank.accounts(*moved)[0])

    change = (energy(1) - energy(-1)) / (2 * h)
    scale = AMPLITUDE * abs(rate) + lost
    # Differences: h^2, and round-off of what is stored over h.
    assert change == pytest.approx(supplied - lost, abs=1e-5 * scale + 1e-9 * stored)
    outward = tank.rate(np.concatenate([[np.sign(w) or 1.0], state[1:]]), *at[1:]).full()[0, 0]
    assert outward * (np.sign(w) or 1.0) <= 1e-15


def test_chambers_break_in_over_their_way():
    """c = exp(-way / break_in_travel), and the loop of a new chamber is stiffer."""
    tank = walls(break_in=2e3, break_in_travel=2.0, creep_time=1e8)
    stretch = np.tile(np.concatenate([np.linspace(0, 0.2, 51), np.linspace(0.2, 0, 51)]), 3)
    z = along(tank, stretch, 10.0, np.array([0.0, 1.0]))
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(stretch)))])
    assert np.allclose(z[:, 1], np.exp(-way / 2.0), rtol=1e-6)
    tops = [k for k in range(len(stretch)) if stretch[k] == 0.2]
    pushed = [float(tank.pressure(z[k], 2e4, 1.2 * LITRE, 0.0)) for k in tops[::2]]
    assert np.all(np.diff(pushed) > 0)  # the same pressure pushes more with every cycle
