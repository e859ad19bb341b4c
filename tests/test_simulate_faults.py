"""`dtcasadi.simulate` on what cannot be run: faults are named, and NaN is never a success."""

# mypy: disable-error-code="arg-type"
# Wrong types are the subject of some tests.

import numpy as np
import pytest
from moving import pendulum, seed, seed_x0

import dtcasadi as dtc
from dtcasadi.errors import ModelError, SimulationError
from dtcasadi.integrators import METHODS


def check_it_is_honest(run: dtc.Run, t_end: float) -> None:
    """What holds of every result: finite states, and a success only if all of it is one."""
    assert np.all(np.isfinite(run.x)) and np.all(np.isfinite(run.t))
    assert run.t[0] == 0 and np.all(np.diff(run.t) > 0)
    assert run.x.shape == (run.model.n_x, len(run.t)) and run.steps == len(run.t) - 1
    if run.success:
        assert run.t[-1] == t_end
        assert all(np.all(np.isfinite(values)) for values in run.energy.values())
        assert np.all(np.isfinite(run.condition))
        assert run.message.startswith(f"reached t = {t_end:g} s in {run.steps} steps of ")
    else:
        assert "reached t" not in run.message


@pytest.mark.parametrize(
    ("method", "step_s"),
    [("euler", 0.02), ("rk4", 0.01), ("rk4", 0.02), ("rk4", 0.1), ("rk4", 1.0)],
)
def test_too_large_a_step_ends_without_success(method, step_s):
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 20.0, "step_s": step_s}
    limit = "is beyond the linear stability limit 0.00[0-9]+ s"
    with pytest.raises(SimulationError, match=f"step_s: {step_s:g} s {limit} of {method} at the"):
        dtc.simulate(seed(), **start, method=method)
    run = dtc.simulate(seed(), **start, method=method, force=True)
    check_it_is_honest(run, 20.0)
    assert not run.success and run.t[-1] < 20.0
    assert f"{method}: the step gave a state that is not finite after t = " in run.message
    assert f"t = {run.t[-1]:.6g} s (step {step_s:.2g} s, segment " in run.message


@pytest.mark.parametrize("pressure", [1e6, 1e12, 1e30, -1e30])
@pytest.mark.parametrize("method", ["rk4", "rodas4"])
def test_absurd_pressures_end_in_an_honest_result(method, pressure):
    # A fixed step, or so short a time that error control cannot take for ever.
    t_end = 0.05 if method == "rk4" else 1e3 / abs(pressure)
    start = {"x0": seed_x0(), "pressure": pressure, "t_end": t_end}
    run = dtc.simulate(seed(), **start, method=method, step_s=1e-3, force=True)
    check_it_is_honest(run, t_end)
    if method == "rk4":
        assert not run.success and run.t[-1] < t_end


@pytest.mark.parametrize("method", ["auto", "tsit5", "rk4"])
def test_absurd_rates_end_in_an_honest_result(method):
    x0 = seed_x0()
    x0[6:] = 1e30
    run = dtc.simulate(seed(), x0, t_end=0.1, method=method, step_s=1e-3, force=True)
    check_it_is_honest(run, 0.1)
    assert not run.success
    assert "after t = 0 s" in run.message


def test_finite_states_that_are_no_solution_are_no_success():
    """Explicit Euler feeds a free motion with energy, at this step by more than a tenth."""
    start = {"x0": [1.0, 0.0], "t_end": 2.0, "method": "euler"}
    run = dtc.simulate(pendulum(), **start, step_s=0.02, force=True)
    check_it_is_honest(run, 2.0)
    assert not run.success and run.t[-1] == 2.0
    assert "euler: the energy balance is off by" in run.message
    assert dtc.simulate(pendulum(), **start, step_s=1e-4).success


NAN = np.where(np.arange(12) == 3, np.nan, 0.0)
KNOWN = ", ".join(METHODS)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x0": np.zeros(11)}, "x0: expected finite numbers of shape (12), got shape (11,)"),
        ({"x0": NAN}, "x0: expected finite numbers of shape (12), got [0.0, 0.0, 0.0, nan, "),
        ({"x0": "rest"}, "x0: expected finite numbers of shape (12), got 'rest'"),
        ({"x0": None}, "x0: expected the initial state of the model, got None"),
        ({"t_end": -1.0}, "t_end: expected a finite positive number, got -1.0"),
        ({"t_end": 0.0}, "t_end: expected a finite positive number, got 0.0"),
        ({"t_end": np.nan}, "t_end: expected a finite positive number, got nan"),
        ({"t_end": np.inf}, "t_end: expected a finite positive number, got inf"),
        ({"t_end": None}, "t_end: expected a finite positive number, got None"),
        ({"t_end": True}, "t_end: expected a finite positive number, got True"),
        ({"method": "rk5"}, f"method: expected one of {KNOWN}, got 'rk5'"),
        ({"method": ""}, f"method: expected one of {KNOWN}, got ''"),
        ({"method": ["rk4"]}, f"method: expected one of {KNOWN}, got ['rk4']"),
        ({"rtol": 0.0}, "rtol: expected a finite positive number, got 0.0"),
        ({"atol": -1e-9}, "atol: expected a finite positive number, got -1e-09"),
        ({"step_s": 0}, "step_s: expected a finite positive number, got 0"),
        ({"method": "rk4"}, "step_s: expected a step [s] for rk4 without error control"),
        ({"theta": [1.0]}, "theta: expected finite numbers of shape (0), got shape (1,)"),
        ({"u": 1.0}, "expected either pressure or u, got both"),
    ],
)
def test_faults_are_named(changes, message):
    arguments = {"x0": seed_x0(), "pressure": 12.0, "t_end": 0.1, **changes}
    with pytest.raises(SimulationError) as caught:
        dtc.simulate(seed(), **arguments)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("subject", ["seed_four_disc", None, 3])
def test_what_to_simulate(subject):
    with pytest.raises(SimulationError, match=f"expected a Scene or a Model, got {subject!r}"):
        dtc.simulate(subject)


def test_a_robot_is_not_yet_a_model():
    with pytest.raises(SimulationError, match=r"expected a Scene or a Model, got Robot\("):
        dtc.simulate(seed().robot)


def test_a_run_that_would_fill_the_memory_stops(monkeypatch):
    """With a sentence, and its states so far."""
    monkeypatch.setattr("dtcasadi.integrators.package.MOST_NUMBERS", 10**5)
    run = dtc.simulate(seed(), seed_x0(), pressure=12.0, t_end=10.0, method="rk4", step_s=5e-4)
    assert not run.success and "would fill the memory" in run.message
    assert 0 < run.t[-1] < 10.0 and np.all(np.isfinite(run.x))


def test_a_robot_that_cannot_move_is_refused():
    robot = seed().robot
    with pytest.raises(ModelError, match="at least one segment that moves"):
        dtc.build(robot, chart="rigid")
