"""Air supply and hysteresis on a moving robot: derivatives, energy, loops, the gas law."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from air_robots import ACTUATORS, ATMOSPHERE, PRESSURE, gas, robot, start
from oracles.cases import error, numbers
from oracles.robots import coordinates
from test_derivatives import exact

import dtcasadi as dtc
from dtcasadi.actuation import settled
from dtcasadi.actuators import Hysteresis, Regulator
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.jacobians import implicit_form
from dtcasadi.sensors import PressureSensor

pytestmark = pytest.mark.filterwarnings("ignore::dtcasadi.compile.NoCompilerWarning")


@pytest.fixture(autouse=True)
def virtual_machine(monkeypatch):
    """Runs are short: nothing is compiled."""
    monkeypatch.setenv("DTCASADI_CC", "none")


# ---- derivatives ---------------------------------------------------------------------------------


@pytest.mark.parametrize("assembly", ["flat", "graph"])
@pytest.mark.parametrize("inflation", ["volume", "last_disc"])
def test_derivatives(rng, inflation, assembly):
    """State equation, implicit form and their theta against AD of the plain expressions."""
    charts = ("cardan", "paper")
    actuator = ACTUATORS["all"]
    if inflation == "last_disc":  # chambers break in with the other one
        actuator = replace(actuator, source=replace(actuator.source, break_in=None))
    paths = ("actuator.supply.conductance", "actuator.amplitude", "chambers.areas", "actuator.time")
    options = {"chart": charts, "inflation": inflation, "assembly": assembly}
    model = dtc.build(robot(), actuator=actuator, parameters=paths, **options)
    n, frames = model.n_q, model.theta_blocks["frames"].stop
    q, qd = 0.3 * coordinates(rng, charts), rng.normal(size=n)
    z = start(model, q, 8.0)[2 * n :] * rng.uniform(0.9, 1.1, model.n_x - 2 * n)
    z[2:6] = rng.uniform(-0.5, 0.5, 4)  # openings and friction
    x, u = np.concatenate([q, qd, z]), rng.uniform(6.0, 10.0, 2)
    arguments = (x, u, model.theta0)

    xdot, *value = numbers(model.ode_jacobian, *arguments)
    assert error(xdot, numbers(model.ode, *arguments)) < 1e-11
    references = exact(model.ode, arguments, 3)
    inner = [ca.MX.sym("a", len(a)) for a in arguments]
    carried = ca.Function("carried", inner, [ca.jacobian(model.ode(*inner), inner[2])])
    value.append(carried(*arguments).full()[:, frames:])
    references[2] = references[2][:, frames:]
    for mine, reference in zip(value, references, strict=True):
        assert error(mine.reshape(reference.shape), reference) < 1e-9  # cond(M)

    form = implicit_form(model.graphs[1])
    at = (q, qd, z, xdot[n : 2 * n], xdot[2 * n :], u, model.theta0)
    M, D, K, U, T = (block.full() for block in form.jacobian(*at))
    by = exact(form.residual, at, 7)
    expected = {"M": by[3:5], "D": by[1:3], "K": by[:1], "U": by[5:6], "T": [by[6][:, frames:]]}
    for mine, parts in zip((M, D, K[:, :n], U, T), expected.values(), strict=True):
        assert error(mine, np.hstack(parts)) < 1e-11


# ---- energy --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("chart", "exponent"), [("planar", 1.0), ("cardan", 1.4)])
def test_a_sealed_robot_conserves_its_energy(chart, exponent):
    """Gas + elastic + kinetic + gravity, valves shut, without damping: a motion of order one."""
    actuator = gas(exponent=exponent, dead_volume=0.3)
    model = dtc.build(robot(undamped=True), chart=chart, inflation="volume", actuator=actuator)
    x0 = start(model, np.full(model.n_q, 0.1), PRESSURE)
    run = dtc.simulate(model, x0, u=0.0, t_end=1.0, rtol=1e-9, atol=1e-11, method="dopri5")
    energy = run.energy
    total = energy["kinetic"] + energy["potential"] + energy["stored"]
    assert run.success and np.ptp(energy["stored"]) > 5 and np.max(energy["kinetic"]) > 5
    assert np.ptp(total) < 1e-7 * np.ptp(energy["potential"])  # a hundred times rtol
    assert not np.any(energy["supplied"]) and not np.any(energy["dissipated"])
    assert np.all(np.ptp(run.x[2 * model.n_q :], axis=1) == 0.0)
    assert np.ptp(run.pressure) > 1.0  # a gas spring


@pytest.mark.parametrize("inflation", ["volume", "last_disc"])
@pytest.mark.parametrize("name", ["gas", "worn", "all"])
def test_the_balance_closes(name, inflation):
    """What flows in, friction and damping against the energies, by quadrature of the powers."""
    actuator = ACTUATORS[name]
    if inflation == "last_disc" and name == "all":
        actuator = replace(actuator, source=replace(actuator.source, break_in=None))
    model = dtc.build(robot(), chart="planar", inflation=inflation, actuator=actuator)
    command = dtc.Profile([0.0, 0.5], [[1.0, 0.5], [-0.5, 1.0]])
    if actuator.command == "pressure":
        command = dtc.Profile([0.0, 0.5], [[10.0, 14.0], [4.0, 2.0]])
    x0 = start(model, np.full(model.n_q, 0.1), 5.0)
    run = dtc.simulate(model, x0, u=command, t_end=0.8, rtol=1e-8, atol=1e-10, method="dopri5")
    energy = run.energy
    assert run.success and energy["dissipated"][-1] > 0
    turned = max(np.ptp(energy[kind]) for kind in ("potential", "supplied", "dissipated"))
    # Three Gauss nodes on the interpolated states of each step: 5e-6 here, and 10 times less with a
    # tenth of rtol.
    assert np.max(np.abs(energy["residual"])) < 1e-5 * turned


# ---- motion --------------------------------------------------------------------------------------


def test_an_independent_method_agrees():
    """LSODA on the same equations, exact interpolation of the commands' steps."""
    model = dtc.build(robot(), chart="planar", inflation="volume", actuator=ACTUATORS["all"])
    x0 = start(model, np.full(model.n_q, 0.1), 2.0)
    command = dtc.Profile([0.0, 0.3], [[12.0] * 2, [3.0] * 2])
    ends = [
        dtc.simulate(model, x0, pressure=command, t_end=0.4, method=m, rtol=r, atol=1e-10).x[:, -1]
        for m, r in (("rodas4", 1e-6), ("LSODA", 1e-9))
    ]
    assert np.max(np.abs(ends[0] - ends[1]) / (1 + np.abs(ends[0]))) < 3e-5  # some 30 rtol


def test_pose_against_pressure_is_a_loop():
    """Inflated and vented slowly: at one pressure a growing chamber is smaller; the loop closes."""
    seed = replace(seed_robot(3), damping=dtc.Damping(c_a=5.0, c_b=5.0, c_w=5.0), gravity=0.0)
    actuator = Hysteresis(Regulator(0.05), 0.5, 0.02)
    model = dtc.build(seed, chart="planar", inflation="volume", actuator=actuator)
    times = np.array([0.0, 60.0, 120.0, 180.0, 240.0])
    command = dtc.Profile(times, [0.0, 3.0, 0.0, 3.0, 0.0], "linear")
    run = dtc.simulate(model, np.zeros(model.n_x), pressure=command, t_end=240.0, method="LSODA")
    assert run.success, run.message
    even = run.at(np.array([120.0, 150.0, 180.0, 210.0, 240.0]))
    R, r = even.poses()
    bend = np.arctan2(R[:, -1, 1, 2], R[:, -1, 2, 2])
    low, growing, top, shrinking, last = np.abs(bend)
    assert np.allclose(even.pressure[0, [1, 3]], 1.5, atol=0.01)  # the lag of 0.05 s at 0.05 Pa/s
    assert growing < shrinking - 0.05 and abs(last - low) < 0.02 * top
    w = even.x[-1]
    assert w[1] > 0.9 and w[3] < -0.9


def test_folding_through_zero_volume_stays_finite():
    """A chamber pushed inside out: its air takes the dead volume, and the run goes on."""
    seed = replace(seed_robot(2), damping=dtc.Damping(c_a=1.0, c_b=1.0, c_w=1.0))
    model = dtc.build(seed, chart="planar", inflation="volume", actuator=gas(dead_volume=0.2))
    folded = np.array([0.0, -1.2])
    assert float(model.volume(folded, 0.0, model.theta0)) < 0
    z = settled(model, np.zeros(2), np.array([-100.0]))
    x0 = np.concatenate([folded, np.zeros(2), z])
    run = dtc.simulate(model, x0, u=0.0, t_end=0.5, method="LSODA")
    assert run.success and np.all(run.pressure > -ATMOSPHERE) and np.all(np.isfinite(run.x))


def test_chambers_that_grow_hold_what_the_gas_law_says():
    """air = (p + p_atm) V(q, p), with V of the model's own `volume`."""
    plain = robot()
    chambers = tuple(
        replace(c, radial_compliance=k) for c, k in zip(plain.chambers, (0.01, 0.0), strict=True)
    )
    model = dtc.build(
        replace(plain, chambers=chambers), chart="planar", inflation="volume", actuator=gas()
    )
    q = np.full(model.n_q, 0.05)
    x = start(model, q, PRESSURE)
    x[2 * model.n_q :] *= [1.3, 1.1]
    pressure, effective = numbers(model.air, x, np.zeros(2), model.theta0)[:2]
    volume = numbers(model.volume, q, pressure, model.theta0)
    # 2.5e-5 of the volume is the smooth stop at zero.
    assert np.allclose(x[2 * model.n_q :], (pressure + ATMOSPHERE) * volume, rtol=1e-4)
    assert np.allclose(effective, pressure, rtol=1e-3) and pressure[0] > PRESSURE


def test_flows_fill_the_chambers():
    """Air at the end = air at the start + what flowed, in kg, by quadrature of the run's flows."""
    model = dtc.build(robot(), chart="planar", inflation="volume", actuator=gas())
    run = dtc.simulate(
        model,
        start(model, np.full(model.n_q, 0.1), 0.0),
        u=0.7,
        t_end=0.2,
        rtol=1e-9,
        method="LSODA",
    )
    even = run.at(np.linspace(0.0, 0.2, 2001))
    flow = even.air["supply_flow"] - even.air["exhaust_flow"] - even.air["leak_flow"]
    change = np.ptp(even.x[2 * model.n_q :][:, [0, -1]], axis=1) / (287.06 * 293.15)
    assert np.allclose(np.trapezoid(flow, even.t, axis=1), change, rtol=1e-6)
    assert np.all(even.air["exhaust_flow"] == 0)


def test_a_pressure_sensor_reads_the_gauge_pressure(rng):
    """That of the gas law, without friction; its slopes by central differences."""
    model = dtc.build(robot(2), chart="planar", inflation="volume", actuator=ACTUATORS["all"])
    sensors = (PressureSensor(name="gauge", noise=1.0, chambers=(1,)),)
    sensor = model.discrete(0.01, method="ros1", sensors=sensors, exact=False).sensors["gauge"]
    x = start(model, np.array([0.1, 0.2]), PRESSURE)
    x += 0.01 * rng.normal(size=len(x))
    u, theta = np.full(model.n_u, 5.0), model.theta0
    y, H_x, _ = (part.full() for part in sensor.linearize(x, u, theta))
    assert y[0, 0] == numbers(model.air, x, u, theta)[0][0]
    h = 1e-6 * np.eye(len(x))
    slopes = [(sensor.output(x + e, u, theta) - sensor.output(x - e, u, theta)) / 2e-6 for e in h]
    assert error(H_x[0], np.array([float(slope) for slope in slopes])) < 1e-8
