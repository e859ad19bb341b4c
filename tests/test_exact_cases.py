"""Motions with a closed form: pendulums, chains, free discs, tops, constant torques, damping.

A pendulum's link is a thread with its mass where the next thread joins: `up` is -z, so that it
hangs along the root's z with all coordinates zero.
"""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from functools import cache
from typing import Any

import numpy as np
import pytest
from oracles.cases import numbers
from oracles.robots import about_x
from scipy.integrate import solve_ivp
from scipy.special import ellipk, jn_zeros, roots_laguerre

import dtcasadi as dtc
from dtcasadi.robot import Chamber, Damping, Disc, Robot, Thread

G = 9.81
TIGHT: dict[str, Any] = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}


def links(masses: list[float], length: float, inertia: float, **parts: Any) -> Robot:
    """A pendulum of equal links; `inertia` is that of each disc about any axis."""
    discs = [Disc(mass, inertia * np.eye(3)) for mass in (1.0, *masses)]
    return Robot(discs, (Thread(length),) * len(masses), up=[0, 0, -1], **parts)


@cache
def one_link(chart: str, inertia: float) -> dtc.Model:
    return dtc.build(links([2.0], 0.7, inertia), chart=chart)


@pytest.mark.parametrize(("chart", "inertia"), [("hinge", 0.3), ("planar", 5.0)])
def test_large_pendulum(chart, inertia):
    """90 degrees: T/T0 = 2 K(1/2)/pi. `hinge`: the disc turns with the thread; `planar`: not."""
    model = one_link(chart, inertia)
    turning = 2.0 * 0.7**2 + (inertia if chart == "hinge" else 0.0)
    ratio = 2 / np.pi * ellipk(0.5)
    assert ratio == pytest.approx(1.1803406, abs=5e-8)
    period = ratio * 2 * np.pi * np.sqrt(turning / (2.0 * G * 0.7))
    x0 = np.zeros(model.n_x)
    x0[0] = np.pi / 2
    for quarters, angle in ((1, 0.0), (2, -np.pi / 2), (3, 0.0), (4, np.pi / 2)):
        run = dtc.simulate(model, x0, t_end=quarters * period / 4, **TIGHT)
        # Passing zero at up to 5 rad/s, this is 1e-9 of the period.
        assert run.q[0, -1] == pytest.approx(angle, abs=1e-8)
        if chart == "planar":  # nothing turns the disc
            assert run.q.sum(axis=0) == pytest.approx(np.pi / 2, abs=1e-10)
    fastest = np.sqrt(2 * 2.0 * G * 0.7 / turning)
    assert np.max(np.abs(run.qd[0])) == pytest.approx(fastest, rel=1e-2)


def frequencies(robot: Robot, chart: str) -> np.ndarray:
    """Squares of the angular frequencies about the hanging pose, sorted."""
    model = dtc.build(robot, chart=chart)
    n = model.n_q
    _, F_x, _ = numbers(model.ode_jacobian, np.zeros(2 * n), np.zeros((0, 1)), model.theta0)
    assert not np.any(F_x[n:, n:])
    values = np.linalg.eigvals(-F_x[n:, :n])
    assert np.max(np.abs(values.imag)) < 1e-9
    return np.sort(values.real)


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_small_swings_of_equal_links(n):
    """omega^2 l/g are the zeros of the Laguerre polynomial L_n."""
    length = 0.4
    zeros = roots_laguerre(n)[0]
    if n == 3:
        assert zeros == pytest.approx([0.415775, 2.294280, 6.289945], abs=5e-7)
    # A disc that turns with its thread adds its inertia, here 1e-12 of the mass times length^2.
    hinged = frequencies(links([2.0] * n, length, 2e-12 * length**2), "hinge")
    assert hinged * length / G == pytest.approx(zeros, rel=1e-9)
    # A disc that does not is of no consequence, and free to turn: n frequencies are zero.
    planar = frequencies(links([2.0] * n, length, 3.0), "planar") * length / G
    assert planar[:n] == pytest.approx(0.0, abs=1e-10)
    assert planar[n:] == pytest.approx(zeros, rel=1e-9)


def test_hanging_chain():
    """omega = j_k/2 sqrt(g/L) with the zeros of the Bessel function J0, reached with order 2."""
    exact = jn_zeros(0, 3) / 2
    assert exact == pytest.approx([1.202413, 2.760039, 4.326864], abs=5e-7)
    errors = []
    for n in (16, 32):
        masses = [1 / n] * (n - 1) + [0.5 / n]  # half of both neighbours' mass
        omega = np.sqrt(frequencies(links(masses, 1 / n, 1e-14), "hinge")[:3] / G)
        errors.append(np.abs(omega / exact - 1))
    # The third mode is barely in the asymptotic range.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)
    assert errors[1][0] < 1e-3


def test_torque_free_disc():
    """Joined at its centre of mass: Euler's equations; energy and angular momentum in space."""
    inertia = np.array([[1.0, 0.05, 0.1], [0.05, 1.6, -0.08], [0.1, -0.08, 2.2]])
    discs = (Disc(1.0, np.eye(3)), Disc(3.0, inertia))
    thread = Thread(0.5, bend=about_x(0.4), twist=about_x(-0.7))
    model = dtc.build(Robot(discs, (thread,)), chart="ball")
    x0 = np.array([0.2, -0.1, 0.3, 0.4, 0.5, 6.0])
    run = dtc.simulate(model, x0, t_end=5.0, **TIGHT)
    assert run.success, run.message
    assert np.max(np.abs(run.q[1])) < 1.2  # far from the chart's singularity
    assert run.q[2, -1] - run.q[2, 0] > 4 * np.pi
    R, _ = run.poses()
    table = [numbers(model.angular_jacobians, q, model.theta0) for q in run.q.T]
    spin = np.array([J @ qd for J, qd in zip(table, run.qd.T, strict=True)])
    momentum = np.einsum("kij,jl,kl->ki", R[:, 1], inertia, spin)
    assert np.max(np.abs(momentum - momentum[0])) < 1e-8 * np.max(np.abs(momentum))
    energy = np.einsum("ki,ij,kj->k", spin, inertia, spin) / 2
    assert energy == pytest.approx(energy[0], rel=1e-9)
    assert run.energy["kinetic"] == pytest.approx(energy[0], rel=1e-9)

    def euler(t: float, w: np.ndarray) -> np.ndarray:
        return np.linalg.solve(inertia, -np.cross(w, inertia @ w))

    body = solve_ivp(euler, (0, 5), spin[0], method="DOP853", rtol=1e-11, atol=1e-13, t_eval=run.t)
    assert spin == pytest.approx(body.y.T, abs=1e-7)


@pytest.mark.parametrize(("share", "stable"), [(0.999, False), (1.001, True)])
def test_sleeping_top(share, stable):
    """Upright, it stays so if omega3^2 > 4 A m g l/C^2, A about the pivot."""
    m, height, C, transverse = 1.3, 0.4, 0.5, 0.45
    disc = Disc(m, np.diag([transverse, transverse, C]), [0, 0, height])
    robot = Robot((Disc(1.0, np.eye(3)), disc), (Thread(0.2),), up=[0, 0, 1])
    model = dtc.build(robot, chart="ball")
    A = transverse + m * height**2
    x = np.zeros(6)
    x[5] = np.sqrt(share * 4 * A * m * G * height) / C
    _, F_x, _ = numbers(model.ode_jacobian, x, np.zeros((0, 1)), model.theta0)
    leaning = [0, 1, 3, 4]  # the spin angle itself is free
    growth = np.max(np.linalg.eigvals(F_x[np.ix_(leaning, leaning)]).real)
    assert growth < 1e-7 if stable else growth > 1e-2


def test_damped_rotation():
    """No weight, c_a alone: I qdd = -c qd, and the dissipated energy is what is missing."""
    robot = links([2.0], 0.5, 0.1, gravity=0.0, damping=Damping(c_a=0.3, c_b=7.0))
    inertia, t_end = 2.0 * 0.5**2 + 0.1, 2.0
    model = dtc.build(robot, chart="hinge")  # the disc turns with the thread: no c_b
    run = dtc.simulate(model, [0.0, 4.0], t_end=t_end, **TIGHT)
    decay = np.exp(-0.3 * run.t / inertia)
    assert run.qd[0] == pytest.approx(4 * decay, abs=1e-9)
    assert run.q[0] == pytest.approx(4 * inertia / 0.3 * (1 - decay), abs=1e-9)
    decay = np.exp(-0.6 * run.energy["t"] / inertia)
    lost = inertia * 16 / 2 * (1 - decay)
    assert run.energy["dissipated"] == pytest.approx(lost, abs=1e-6)
    assert run.energy["supplied"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("kind", ["pressure", "wrench"])
def test_constant_torque(kind):
    """pressure * area * lever, or an external moment: q = torque t^2/(2 I), work = torque q."""
    inertia, lever = 2.0 * 0.5**2 + 0.1, 0.2
    turning = Disc(2.0, 0.1 * np.eye(3), area=0.5, centroid=[0.0, lever, 0.0])
    chambers = (Chamber((1, 2)),)
    robot = Robot((Disc(1.0, np.eye(3)), turning), (Thread(0.5),), chambers=chambers, gravity=0)
    model = dtc.build(robot, chart="hinge", wrenches=(2,))
    theta, pressure = model.theta0.copy(), 0.0
    if kind == "pressure":
        # Normal to the disc, which turns with its thread: only the offset is a lever.
        pressure, torque = 30.0, 30.0 * 0.5 * lever
    else:
        theta[model.theta_blocks["wrench"]] = [0, 0, 0, 3.0, 0, 0]
        torque = 3.0
    run = dtc.simulate(model, [0.0, 0.0], pressure=pressure, theta=theta, t_end=1.0, **TIGHT)
    assert run.q[0] == pytest.approx(torque * run.t**2 / (2 * inertia), abs=1e-9)
    at = np.searchsorted(run.t, run.energy["t"])
    assert run.energy["supplied"] == pytest.approx(torque * run.q[0, at], abs=1e-9)
    assert run.energy["residual"] == pytest.approx(0.0, abs=1e-9)
