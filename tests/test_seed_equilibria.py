"""Where the paper's robot with the thread below (up = +y) can rest, and up to what pressure."""

import numpy as np
import pytest
from moving import UP, scene_model
from scipy.optimize import brentq, root

import dtcasadi as dtc

# up = +y: pressure -> (beta1, psi1, beta2, psi2, beta3, psi3), and half a unit of the last digit.
EQUILIBRIA = {
    3.82: ((1.74, 1.37, -1.33, 1.39, -1.28, 1.57), 0.005),
    5.0: ((1.787, 1.309, -1.257, 1.337, -1.200, 1.566), 0.0005),
    8.0: ((1.908, 1.177, -1.086, 1.227, -0.982, 1.555), 0.0005),
    12.0: ((1.983, 1.117, -0.942, 1.169, -0.587, 1.508), 0.0005),
}


def rest(pressure: float, guess: np.ndarray) -> tuple[np.ndarray, bool]:
    """An equilibrium with up = +y near a guess, and whether one was found."""
    ode = scene_model(UP).compiled("ode_jacobian")
    still, theta = np.zeros(6), scene_model(UP).theta0

    def residual(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value = ode(np.concatenate([q, still]), [pressure], theta)
        return value.xdot[6:], value.F_x[6:, :6]

    found = root(residual, guess, jac=True, tol=1e-13)
    # Accelerations are of order 10 where nothing balances.
    return found.x, bool(np.max(np.abs(found.fun)) < 1e-9)


def rates_of(pressure: float, q: np.ndarray) -> np.ndarray:
    """Eigenvalues of the motion linearized about an equilibrium, the least stable first [1/s]."""
    ode = scene_model(UP).compiled("ode_jacobian")
    F_x = ode(np.concatenate([q, np.zeros(6)]), [pressure], scene_model(UP).theta0).F_x
    values = np.linalg.eigvals(F_x)
    return values[np.argsort(-values.real)]


@pytest.mark.parametrize("pressure", EQUILIBRIA)
def test_equilibria_are_stable(pressure):
    expected, digit = EQUILIBRIA[pressure]
    q, found = rest(pressure, np.array(expected))
    assert found
    np.testing.assert_allclose(q, expected, rtol=0, atol=1.01 * digit)
    slowest = rates_of(pressure, q)[0]
    assert -0.065 < slowest.real < -0.045  # "-0.05 to -0.06 1/s"


@pytest.mark.parametrize("pressure", [3.82, 5.0, 8.0])
def test_equilibria_are_returned_to(pressure):
    """From 0.2 rad off in each angle, both ways, within 200 s."""
    q, _ = rest(pressure, np.array(EQUILIBRIA[pressure][0]))
    for push in 0.2 * np.vstack([np.eye(6), -np.eye(6)]):
        x0 = np.concatenate([q + push, np.zeros(6)])
        run = dtc.simulate(scene_model(UP), x0, pressure=pressure, t_end=200.0)
        assert run.success, run.message
        # The slowest mode leaves 0.2 exp(-0.055 * 200) = 3e-6 of the push.
        assert np.max(np.abs(run.q[:, -1] - q)) < 1e-4


def test_stability_is_lost_by_a_hopf_bifurcation():
    """A complex pair crosses at a pressure of about 13.8."""
    q, _ = rest(12.0, np.array(EQUILIBRIA[12.0][0]))
    branch = [q]
    for pressure in np.linspace(12.0, 13.7, 18):
        q, found = rest(pressure, q)
        assert found and rates_of(pressure, q)[0].real < 0
        branch.append(q)

    def worst(pressure: float) -> float:
        return float(rates_of(pressure, rest(pressure, branch[-1])[0])[0].real)

    critical = brentq(worst, 13.7, 13.95)
    assert critical == pytest.approx(13.8, abs=0.05)
    pair = rates_of(critical, rest(critical, branch[-1])[0])[:2]
    assert abs(pair[0].imag) > 0.05
    assert pair[0] == pytest.approx(np.conj(pair[1]))


@pytest.mark.parametrize(("pressure", "stable"), [(13.0, 1), (14.0, 0), (16.0, 0), (30.0, 0)])
def test_no_stable_equilibrium_at_higher_pressures(rng, pressure, stable):
    """A search from 200 random poses finds the one stable equilibrium where there is one."""
    found = set()
    for guess in rng.uniform(-np.pi, np.pi, (200, 6)):
        q, good = rest(pressure, guess)
        if good and rates_of(pressure, q)[0].real < 0:
            found.add(tuple(np.round(np.exp(1j * q), 6)))  # whole turns are the same pose
    assert len(found) == stable
