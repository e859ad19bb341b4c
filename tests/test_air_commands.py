"""Commands of actuators, their dead time and their free parameters; an actuator of one's own."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from air_robots import ACTUATORS, gas, robot, start
from oracles.cases import error, numbers

import dtcasadi as dtc
from dtcasadi.actuators import Actuator, Delay, Direct, Regulator, Valve
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.errors import ModelError, SimulationError

pytestmark = pytest.mark.filterwarnings("ignore::dtcasadi.compile.NoCompilerWarning")


@pytest.fixture(autouse=True)
def virtual_machine(monkeypatch):
    """Runs are short: nothing is compiled."""
    monkeypatch.setenv("DTCASADI_CC", "none")


# ---- commands ------------------------------------------------------------------------------------


def test_dead_time_is_exact_in_a_simulation():
    model = dtc.build(robot(), chart="planar", actuator=Delay(Regulator(0.1), 0.2, lags=0))
    plain = dtc.build(robot(), chart="planar", actuator=Regulator(0.1))
    x0 = np.concatenate([np.full(4, 0.1), np.zeros(6)])
    command = dtc.Profile([0.0, 0.5], [[8.0, 4.0], [2.0, 12.0]])
    late = dtc.Profile([0.2, 0.7], command.values)
    runs = [
        dtc.simulate(m, x0, pressure=p, t_end=1.0, method="rk4", step_s=0.01)
        for m, p in ((model, command), (plain, late))
    ]
    assert np.array_equal(runs[0].x[:, -1], runs[1].x[:, -1])
    assert np.all(runs[0].at([0.69, 0.71]).u == [[8.0, 2.0], [4.0, 12.0]])
    waves = [
        dtc.simulate(m, x0, pressure=p, t_end=0.6, method="LSODA").pressure[0, -1]
        for m, p in ((model, lambda t: 9.0 + t), (plain, lambda t: 9.0 + max(t - 0.2, 0.0)))
    ]
    assert waves[0] == pytest.approx(waves[1], rel=1e-6)
    with pytest.raises(ModelError, match=r"delay.lags: expected lags from 1 on"):
        model.discrete(0.01)


def test_a_scene_holds_its_pressure_until_the_command_arrives():
    scene = dtc.load_scene("seed_four_disc")
    scene = replace(
        scene,
        robot=replace(seed_robot(2), gravity=0.0),
        q0=np.zeros(2),
        qd0=np.zeros(2),
        initial_chart="planar",
        options={"chart": "planar", "actuator": Delay(Direct(), 0.25, lags=0)},
        initial_pressure=np.array([3.0]),
        t_end=0.5,
    )
    run = dtc.simulate(scene, method="LSODA")
    assert run.at([0.1, 0.3]).pressure.tolist() == [[3.0, 12.0]]
    late = dtc.simulate(replace(scene, t_end=0.2), method="LSODA")
    assert np.all(late.pressure == 3.0)


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ({"u": [0.5, np.nan]}, r"opening\[2\]: expected a finite number, got nan"),
        ({"u": np.nan}, "opening: expected a finite number, got nan"),
        ({"u": lambda t: np.nan}, r"opening\(0\): expected a finite number"),
        ({"pressure": 5.0}, "pressure: expected u, as this actuator's command is the opening"),
    ],
)
def test_commands_that_are_none_are_refused_by_name(command, text):
    model = dtc.build(robot(), chart="planar", inflation="volume", actuator=gas())
    with pytest.raises(SimulationError, match=text):
        dtc.simulate(model, start(model, np.zeros(4), 0.0), t_end=0.1, method="LSODA", **command)


@pytest.mark.parametrize("actuator", [Regulator(), gas(valve=Valve()), Direct()])
def test_a_step_reports_a_command_that_is_not_a_number(actuator):
    model = dtc.build(robot(), chart="planar", inflation="volume", actuator=actuator)
    discrete = model.discrete(0.01, method="ros2")
    x = start(model, np.full(4, 0.1), 1.0)
    for u, status in (([0.5, 0.5], 0), ([0.5, np.nan], 1), ([np.inf, 0.0], 1)):
        assert int(discrete.step(x, u, model.theta0)[1]) == status


# ---- parameters ----------------------------------------------------------------------------------


def test_parameters_are_reached_through_what_is_around_them():
    paths = (
        "actuator.conductance",
        "actuator.supply.conductance",
        "actuator.band",
        "actuator.lags",
    )
    model = dtc.build(robot(), inflation="volume", actuator=ACTUATORS["all"], parameters=paths[1:2])
    block = model.theta_blocks["actuator.supply.conductance"]
    assert model.theta0[block] == [1e-3]
    for path in (paths[0], paths[2], paths[3]):
        with pytest.raises(ModelError, match=f"got '{path}'"):
            dtc.build(robot(), inflation="volume", actuator=ACTUATORS["all"], parameters=[path])
    own = Regulator(time_constant=(0.1, 0.3))
    model = dtc.build(robot(), actuator=own, parameters=["actuator.time_constant"])
    assert model.theta0[model.theta_blocks["actuator.time_constant"]].tolist() == [0.1, 0.3]
    with pytest.raises(ModelError, match="names a number that is already a parameter"):
        repeated = ["actuator.source.time_constant", "actuator.time_constant"]
        dtc.build(robot(), actuator=Delay(own, 0.1), parameters=repeated)
    with pytest.raises(ModelError, match="actuator.time has no effect"):
        held = Delay(own, 0.1, lags=0)
        dtc.build(robot(), actuator=held, parameters=["actuator.time"])


def test_a_parameter_acts_as_the_number_it_stands_for():
    path = "actuator.time_constant"
    free = dtc.build(robot(), chart="planar", actuator=Regulator(), parameters=path)
    other = dtc.build(robot(), chart="planar", actuator=Regulator(0.25))
    x, u = np.concatenate([np.full(4, 0.1), np.zeros(4), [3.0, 4.0]]), np.array([8.0, 2.0])
    theta = free.theta0.copy()
    theta[free.theta_blocks[path]] = 0.25
    mine, expected = numbers(free.ode, x, u, theta), numbers(other.ode, x, u, other.theta0)
    assert error(mine, expected) < 1e-15  # 1/0.25 is folded or not


def test_an_own_actuator():
    """Ten lines: a pump whose pressure follows a quadratic law."""

    @dataclass(frozen=True)
    class Pump(Actuator):
        gain: float = 2.0

        def state_names(self, n):
            return tuple(f"speed_{i + 1}" for i in range(n))

        def pressure(self, state, u, air):
            return self.gain * state**2

        def rate(self, state, u, air):
            return u - state

        def rest_state(self, pressure, volume, rest):
            return np.sqrt(pressure / self.gain)

    model = dtc.build(robot(), chart="planar", actuator=Pump(), parameters="actuator.gain")
    x0 = start(model, np.full(4, 0.1), 8.0)
    assert x0[-2:].tolist() == [2.0, 2.0]
    run = dtc.simulate(model, x0, u=2.0, t_end=0.2, method="LSODA")
    assert run.success and np.allclose(run.pressure, 8.0)
