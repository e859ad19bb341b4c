"""What a run says of itself (`dtcasadi.health`): energies, their balance, conditioning."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

import numpy as np
import pytest
from moving import TIGHT, full, full_theta, pendulum, seed, seed_x0, swift
from oracles.cases import numbers

import dtcasadi as dtc


@pytest.fixture(scope="module")
def long_run() -> dtc.Run:
    """More than 200 steps."""
    return dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=1.0, method="rk4", step_s=1e-3)


def ball() -> dtc.Model:
    """A disc that turns freely about its centre of mass."""
    disc = dtc.Disc(2.0, np.diag([1.0, 1.5, 2.0]))
    return dtc.build(dtc.Robot((disc, disc), (dtc.Thread(0.5),)), chart="ball")


def test_at_most_200_samples(long_run):
    t = long_run.energy["t"]
    assert len(long_run.t) == 1001 and len(t) == 200
    assert t[0] == 0.0 and t[-1] == long_run.t[-1]
    assert np.all(np.isin(t, long_run.t))
    assert np.max(np.diff(t)) < 1.5 * np.mean(np.diff(t))
    for values in (*long_run.energy.values(), long_run.condition):
        assert values.shape == (200,)


def test_every_step_of_a_short_run():
    run = dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=0.01, method="rk4", step_s=1e-3)
    assert np.array_equal(run.energy["t"], run.t) and len(run.condition) == 11
    run = dtc.simulate(seed(), seed_x0(), t_end=1e-3, method="rk4", step_s=1e-3)
    assert run.success and run.energy["t"].tolist() == [0.0, 1e-3]


def test_energies_are_the_models(long_run):
    at = np.searchsorted(long_run.t, long_run.energy["t"])
    q, qd, theta = long_run.q[:, at], long_run.qd[:, at], seed().theta0
    for k in (0, 57, 199):
        kinetic = qd[:, k] @ numbers(seed().mass_matrix, q[:, k], theta) @ qd[:, k] / 2
        assert long_run.energy["kinetic"][k] == pytest.approx(kinetic, rel=1e-12)
        potential = numbers(seed().potential_energy, q[:, k], theta)[0]
        assert long_run.energy["potential"][k] == pytest.approx(potential, rel=1e-12)


def test_works_are_the_integrals_of_the_powers(long_run):
    """By the trapezoidal rule on the steps, of order 2."""
    damping, push = [], []
    for q, qd in zip(long_run.q.T, long_run.qd.T, strict=True):
        damping.append(qd @ numbers(seed().damping, q, qd, seed().theta0))
        push.append(qd @ numbers(seed().inflation, q, 12.0, seed().theta0))
    at = np.searchsorted(long_run.t, long_run.energy["t"])
    for name, power in (("dissipated", damping), ("supplied", push)):
        work = np.concatenate([[0.0], np.cumsum((np.array(power)[1:] + power[:-1]) / 2e3)])
        assert np.ptp(work) > 1
        assert long_run.energy[name] == pytest.approx(work[at], abs=1e-4 * np.ptp(work))


def test_the_residual_closes_the_balance(long_run):
    e = long_run.energy
    total = e["kinetic"] + e["potential"]
    balance = total - total[0] - e["supplied"] + e["dissipated"]
    assert e["residual"] == pytest.approx(balance, abs=1e-12)
    assert np.max(np.abs(e["residual"])) < 1e-6


@pytest.mark.parametrize(("terms", "missing"), [("full", 0.0), ("paper", 0.05), ("none", 0.5)])
def test_the_residual_shows_what_other_velocity_terms_leave_out(terms, missing):
    """They do not conserve energy; that is the model's, not a failure of the run."""
    model = dtc.build(seed().robot, chart="planar", velocity_terms=terms)
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 2.0}
    run = dtc.simulate(model, **start, method="DOP853", **TIGHT)
    assert run.success, run.message
    residual = np.max(np.abs(run.energy["residual"]))
    assert residual < 1e-7 if terms == "full" else residual > missing, residual


@pytest.mark.parametrize("method", ["DOP853", "tsit5"])
def test_a_free_motion_at_loose_tolerances_is_a_success(method):
    """It turns no energy over but its drift, which is small beside what it moves with."""
    start = {"x0": [0.0, 0.0, 0.0, 0.3, 0.2, 6.0], "t_end": 5.0, "rtol": 1e-3, "atol": 1e-5}
    run = dtc.simulate(ball(), **start, method=method)
    assert run.success, run.message
    drift = np.ptp(run.energy["kinetic"])
    assert drift < 0.1 * run.energy["kinetic"][0]
    assert np.max(np.abs(run.energy["residual"])) > 0.1 * drift


def test_nothing_moves():
    """No energy is turned over at all: no scale to compare a residual with."""
    run = dtc.simulate(pendulum(), [0.0, 0.0], t_end=1.0)
    assert run.success and not np.any(run.x)
    assert not np.any(run.energy["residual"]) and not np.any(run.energy["kinetic"])


def test_condition_is_that_of_the_mass_matrix():
    """With the parameters in force then, re-centred ones included."""
    start = {"x0": swift(full()), "theta": full_theta(), "t_end": 0.5}
    run = dtc.simulate(full(), **start, method="tsit5")
    assert run.recentrings
    at = np.searchsorted(run.t, run.energy["t"])
    assert len(run.condition) == len(at)
    for k, column in enumerate(at):
        M = numbers(full().mass_matrix, run.q[:, column], run.thetas[:, column])
        assert run.condition[k] == pytest.approx(np.linalg.cond(M), rel=1e-9)
    assert np.ptp(run.condition) > 1


def test_condition_near_a_singular_pose_is_very_large():
    model = ball()
    x0 = [0.1, np.pi / 2 - 1e-6, 0.2, 0.0, 0.0, 0.0]
    run = dtc.simulate(model, x0, t_end=1e-3, method="rk4", step_s=1e-3, force=True)
    M = numbers(model.mass_matrix, run.q[:, 0], model.theta0)
    assert run.condition[0] == pytest.approx(np.linalg.cond(M), rel=1e-3)
    assert run.condition[0] > 1e11
