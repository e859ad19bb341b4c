"""ocp.closed_loop and ocp.baselines on a linear plant that is not the controller's model."""

import numpy as np
import pytest
from control_toy import cart

from dtcasadi.errors import ControlError
from estimators import EKF
from ocp import Effort, Limits, Problem, Solver, Tracking, stages, transcribe
from ocp.baselines import FullMPC, PIControl, StaticControl
from ocp.closed_loop import Plant, closed_loop

REST = np.zeros(2), np.zeros(1)


def posed(reference=1.0, **limits):
    limits = {"lower": -4.0, "upper": 4.0, "rate": 20.0, **limits}
    problem = Problem(
        15, Tracking("place", reference, weight=10.0), Effort(0.05), Limits(**limits), terminal=None
    )
    return stages(cart(0.1), problem)


def full(problem):
    return FullMPC(Solver(transcribe(problem), "sqpmethod-qrqp"), np.zeros(1))


def filter_of(discrete):
    """Estimates the load as a disturbance that wanders."""
    P0 = np.array([1e-4, 1e-4, 1.0])
    Q_w = np.diag([1e-4, 1e-2, 1.0])  # the toy's sensor has a noise of one
    return EKF(discrete, x0=np.zeros(2), P0=P0, Q_w=Q_w, augment=("load",))


def test_a_constant_load_leaves_no_steady_error_with_a_disturbance_model():
    problem = posed()
    fine = cart(0.02)
    plant = Plant(fine, *REST, changes=lambda t: {"load": [-0.8 * (t >= 0)]}, seed=None)
    errors = {}
    for name, controller in {"mpc": full(problem), "open": StaticControl(problem, REST[1])}.items():
        found = closed_loop(
            controller,
            plant,
            problem,
            t_end=40.0,
            estimator=filter_of(cart(0.1)),
            measured=["place"],
        )
        errors[name] = found.steady(36.0, 40.0)
        assert found.violations == 0
    # The open loop stands where the spring of 2 holds the load of 0.8.
    assert errors["mpc"] < 2e-3 and errors["open"] == pytest.approx(0.4, rel=0.02)


def test_a_delay_moves_the_plant_later_by_itself():
    """A step of the command that a controller without memory gives at once."""
    problem = posed(rate=np.inf)
    paths = []
    for delay in (0.0, 0.3):
        controller = StaticControl(problem, REST[1])
        plant = Plant(cart(0.02), *REST, delay_s=delay, seed=None)
        paths.append(closed_loop(controller, plant, problem, t_end=3.0).y[:, 0])
    assert np.allclose(paths[1][3:], paths[0][:-3], atol=1e-12)
    assert np.allclose(paths[1][:3], 0.0)


def test_pi_takes_the_steady_error_away_and_mpc_is_better():
    problem = posed()
    plant = Plant(cart(0.02), *REST, changes=lambda t: {"load": [-0.8]}, seed=None)
    pi = closed_loop(PIControl(problem, REST[1], k_p=0.1, k_i=0.1), plant, problem, t_end=60.0)
    mpc = closed_loop(full(problem), plant, problem, t_end=60.0)
    assert pi.steady(58.0, 60.0) < 5e-3
    assert mpc.cost < pi.cost
    predicted = mpc.predicted(5)
    assert predicted is not None and np.allclose(predicted[0], mpc.y[5], atol=1e-12)
    # Perfect model, state and load: what was planned comes true.
    assert np.allclose(predicted[1], mpc.y[6], atol=0.02) and pi.predicted(5) is None


def test_samples_have_noise_periods_and_a_seed():
    problem = posed()
    runs = [
        closed_loop(
            StaticControl(problem, REST[1]),
            Plant(cart(0.025), *REST, seed=seed),
            problem,
            t_end=1.0,
            estimator=filter_of(cart(0.05)),
            measured=["place"],
        )
        for seed in (1, 1, 2)
    ]
    states = [np.array([est.x for est in run.estimate]) for run in runs]
    assert np.array_equal(states[0], states[1]) and not np.allclose(states[0], states[2])


def test_steps_that_do_not_divide_are_refused():
    problem = posed()
    with pytest.raises(ControlError, match=r"plant.step_s: expected a step that divides 0.1 s"):
        closed_loop(full(problem), Plant(cart(0.03), *REST), problem, t_end=1.0)
