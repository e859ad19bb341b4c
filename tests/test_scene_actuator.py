"""Supply, valves, hysteresis and dead time in scene files."""

import numpy as np
import pytest
from scene_texts import SMALL

import dtcasadi as dtc
from dtcasadi.actuators import Delay, Gas, Hysteresis, Orifice, PressureValve, Regulator, Valve
from dtcasadi.scene import parse_scene

CHAMBER = "[[robot.chambers]]\ndiscs = 'all'\n"
GAS = """
[model]
inflation = "volume"

[model.actuator]
kind = "gas"
supply_pressure_bar = 3
exhaust_pressure_kpa = -20
atmosphere_kpa = 100
exponent = 1.2
dead_volume_ml = [15]

[model.actuator.supply]
conductance_l_per_s_bar = 0.5
critical_ratio = 0.25

[model.actuator.exhaust]
diameter_mm = 2
discharge_coefficient = 0.7

[model.actuator.leak]
conductance = 1e-12

[model.actuator.valve]
command = "pressure"
band_kpa = 2
underlap = 0.01
response_time_ms = 8

[model.actuator.hysteresis]
amplitude_kpa = 0.8
travel = 0.04
sharpness = 3
creep_time = 1e3
break_in_kpa = 2
break_in_travel = 10

[model.actuator.delay]
time_ms = 15
lags = 3

[initial]
pressure_kpa = 5

[pressure]
value_kpa = 20
"""
VALVES = """
[model.actuator]
kind = "gas"
supply_pressure_kpa = 50
supply = { conductance = 1e-9 }
exhaust = { conductance = 1e-9 }
"""


def parse(text: str) -> dtc.Scene:
    return parse_scene(text.encode())


def small(text: str) -> dtc.Scene:
    """With one chamber over the robot of the shortest scene."""
    head, run = SMALL.split("[run]")
    return parse(f"{head}\n{CHAMBER}\n{text}\n[run]{run}")


def test_every_key_of_the_gas():
    gas = Gas(
        supply=Orifice(5e-9, 0.25),
        exhaust=Orifice.from_hole(2e-3, 0.7),
        supply_pressure=3e5,
        valve=PressureValve(2e3, 0.01, 8e-3),
        leak=Orifice(1e-12),
        exhaust_pressure=-2e4,
        exponent=1.2,
        atmosphere=1e5,
        dead_volume=(15e-6,),
    )
    worn = Hysteresis(gas, 800.0, 0.04, 3, 1e3, 2e3, 10.0)
    scene = small(GAS)
    assert scene.options["actuator"] == Delay(worn, 0.015, 3)
    model = scene.build()
    z = scene.x0(model)[2 * model.n_q :]
    room = float(model.volume(scene.q0, 0.0, model.theta0)) + 15e-6
    # Air at 105 kPa absolute, no friction, a new chamber, the lags at the command held; FOLD^2 / 4.
    assert z[0] == pytest.approx(1e5 * room * 1.05 ** (1 / 1.2), rel=3e-5)
    assert z[1:].tolist() == [0.0, 0.0, 1.0, 5e3, 5e3, 5e3]


def test_a_regulator_that_vents_slower():
    scene = small(
        "[model.actuator]\nkind = 'regulator'\ntime_constant_ms = 50\nvent_time_constant = 0.2\n"
        "rate_limit_kpa_per_s = 100\nvent_rate_limit = 5e4\nblend = 20\nminimum = [0]"
    )
    expected = Regulator(0.05, (0.0,), rate_limit=1e5, vent_time_constant=0.2, vent_rate_limit=5e4)
    assert scene.options["actuator"] == Regulator(**{**vars(expected), "blend": 20.0})


def test_valves_commanded_by_their_opening():
    scene = small(VALVES + "[opening]\ntimes = [0, 0.5]\nvalues = [1, -1]")
    assert scene.options["actuator"].valve == Valve()
    model = scene.build()
    assert scene.pressure(0.2) == 1.0 and model.actuator.command == "opening"
    volume = float(model.volume(scene.q0, 0.0, model.theta0))
    assert scene.x0(model)[-1] == pytest.approx(101325.0 * volume, rel=3e-5)  # no gauge pressure


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (VALVES + "[pressure]\nvalue = 1", "pressure: expected a table [opening], the actuator's"),
        ("[opening]\nvalue = 1", "opening: expected a table [pressure], the actuator's command"),
        (GAS.replace("_bar = 3\n", "_kpa = -30\n"), "gas.supply_pressure"),
        (GAS.replace("[15]", "[15, 16]"), "model.actuator.dead_volume_ml: expected finite numbers"),
        (GAS.replace("0.5\n", "0\n", 1), "supply.conductance_l_per_s_bar: expected a finite posi"),
        (GAS.replace("= 3\ncreep", "= 1\ncreep"), "hysteresis.sharpness: expected an integer from"),
        (GAS.replace("lags = 3", "lag = 3"), "delay.lag: expected one of time, lags"),
        (
            GAS.replace("band_kpa", "band_km"),
            "model.actuator.valve.band: expected a finite positiv",
        ),
        (
            GAS.replace('command = "pressure"', 'command = "flow"'),
            "valve.command: expected opening",
        ),
        (GAS.replace("exponent = 1.2", "exponent = 0.5"), "exponent: expected a number from 1"),
    ],
)
def test_errors_name_their_place(text, error):
    with pytest.raises(dtc.errors.SceneError) as info:
        small(text)
    assert error.removeprefix("gas.") in str(info.value), info.value


def test_numbers_for_other_chambers_are_refused_by_build():
    robot = small(VALVES).robot
    with pytest.raises(dtc.errors.ModelError, match=r"actuator.time_constant: expected 1 or 1 num"):
        dtc.build(robot, actuator=Regulator(time_constant=(0.1, 0.2)))
    worn = Hysteresis(Regulator(), 100.0, break_in=1e3)
    with pytest.raises(dtc.errors.ModelError, match='break_in: expected inflation="volume"'):
        dtc.build(robot, actuator=worn)
    assert np.isfinite(dtc.build(robot, actuator=worn, inflation="volume").n_x)
