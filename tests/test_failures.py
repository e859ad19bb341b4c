"""The failures are real, and each is reported: never NaN, never a hang, never success."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from oracles.robots import planar_robot
from scipy.optimize import root

import dtcasadi as dtc
from dtcasadi.commands import command_pieces
from dtcasadi.errors import DtcasadiError, SimulationError
from dtcasadi.integrators import METHODS, ONE_STEP, Problem
from dtcasadi.integrators.stability import limit_on_ray, stability_limit
from dtcasadi.presets import seed_four_disc

# The paper's robot with the thread below: a stable equilibrium at this pressure, to three digits.
PRESSURE = 3.82
SETTLED = (1.74, 1.37, -1.33, 1.39, -1.28, 1.57)
EXPLICIT = ("euler", "heun", "rk4")


def slow(*values: str) -> tuple:
    """Parameters for the thorough run only: their steps take long to compile."""
    return tuple(pytest.param(value, marks=pytest.mark.slow) for value in values)


def step_of(name: str, step_s: float) -> dict[str, Any]:
    """The arguments of a method that needs a step, whatever its stability limit."""
    return {"step_s": step_s, "force": True} if name in ONE_STEP else {}


@cache
def settled() -> tuple[dtc.Model, np.ndarray]:
    """The planar robot, and its equilibrium."""
    model, still = dtc.build(seed_four_disc(up=(0.0, 1.0, 0.0)), chart="planar"), np.zeros(6)

    def acceleration(q: np.ndarray) -> np.ndarray:
        return np.array(model.forward_dynamics(q, still, PRESSURE, still, model.theta0)).ravel()

    q = root(acceleration, SETTLED, tol=1e-13).x
    assert np.max(np.abs(q - SETTLED)) < 0.006
    return model, np.concatenate([q, still])


@cache
def limit(name: str) -> float:
    """Linear stability limit of a method at the equilibrium [s]."""
    model, x = settled()
    pieces = command_pieces(PRESSURE, 1, 1.0)
    return stability_limit(Problem(model, x, model.theta0, pieces, 1e-6, 1e-8), ONE_STEP[name])


def near_equilibrium(name: str, step_s: float, steps: int, **options: Any) -> dtc.Run:
    """Steps from close to the equilibrium, with rates of 1e-4 rad/s."""
    model, x = settled()
    start = x + 1e-4 * np.concatenate([np.zeros(6), np.sin(1.0 + np.arange(6))])
    t_end = step_s * steps
    return dtc.simulate(
        model, start, pressure=PRESSURE, t_end=t_end, method=name, step_s=step_s, **options
    )


def distances(run: dtc.Run) -> np.ndarray:
    return np.linalg.norm(run.x - settled()[1][:, np.newaxis], axis=0)


@pytest.mark.parametrize("name", EXPLICIT)
def test_the_limit_is_that_of_the_dominant_real_eigenvalue(name):
    model, x = settled()
    F_x = np.array(model.ode_jacobian(x, PRESSURE, model.theta0)[1])
    eigenvalues = np.linalg.eigvals(F_x)
    dominant = eigenvalues[np.argmax(np.abs(eigenvalues))]
    assert abs(dominant.imag) == 0 and np.max(eigenvalues.real) < 0
    # 2 for Euler and Heun, 2.785 for rk4 (Hairer, Wanner II, figure IV.2.1).
    reach = {"euler": 2.0, "heun": 2.0, "rk4": 2.785293563}[name]
    assert limit(name) == pytest.approx(reach / abs(dominant), rel=1e-9)
    assert limit(name) == pytest.approx(limit_on_ray(ONE_STEP[name], dominant), rel=1e-12)


@pytest.mark.parametrize("name", EXPLICIT)
def test_steps_hold_within_the_limit_and_diverge_beyond_it(name):
    """0.9 of the limit damps, |R| < 1; at 1.1 |R| is 1.2 to 1.5: 1e3 times in 60 steps or less."""
    run = near_equilibrium(name, 0.9 * limit(name), 300)
    away = distances(run)
    assert run.success and np.max(away) == away[0] and away[-1] < 0.5 * away[0]
    run = near_equilibrium(name, 1.1 * limit(name), 60, force=True)
    away = distances(run)
    assert away[-1] > 1e3 * away[0] and np.all(np.isfinite(run.x))


@pytest.mark.parametrize("name", EXPLICIT)
def test_a_step_beyond_the_limit_is_refused_with_the_limit_in_the_message(name):
    near_equilibrium(name, 0.999 * limit(name), 2)
    with pytest.raises(SimulationError) as error:
        near_equilibrium(name, 1.001 * limit(name), 2)
    text = str(error.value)
    assert text.startswith("step_s: ") and f"{limit(name):.3g} s of {name} at the start" in text
    assert "force=True" in text and "rodas4" in text


@pytest.mark.parametrize("name", EXPLICIT)
@pytest.mark.parametrize("times", [1.1, 10.0])
def test_a_forced_step_beyond_the_limit_is_a_failure(name, times):
    """Bounded nonsense (the springs catch it) is told by its energy, the rest by overflow."""
    run = near_equilibrium(name, times * limit(name), 200, force=True)
    assert not run.success and np.all(np.isfinite(run.x))
    assert "energy balance is off" in run.message or "not finite" in run.message


@pytest.mark.parametrize(
    "name", ["ros2", "rodas4", "midpoint", *slow("ros1", "ros3", "sdirk2", "radau5", "gauss2")]
)
def test_implicit_methods_take_a_step_beyond_any_explicit_limit(name):
    run = near_equilibrium(name, 20 * limit("rk4"), 50)
    away = distances(run)
    assert run.success and np.max(away) < 2 * away[0] and away[-1] < away[0]


@cache
def paper(damping: str) -> dtc.Model:
    return dtc.build(seed_four_disc(), chart="paper", damping=damping)


def paper_start(**changes: float) -> np.ndarray:
    """The paper's initial state: beta = 0.1, 0.01, 0.01, everything else zero."""
    model = paper("coordinate")
    x = np.zeros(model.n_x)
    for number, beta in enumerate((0.1, 0.01, 0.01), 1):
        x[model.state_names.index(f"beta_{number}")] = beta
    for name, value in changes.items():
        x[model.state_names.index(name)] = value
    return x


@cache
def paper_run(name: str, angle: str, size: float) -> dtc.Run:
    """Half a second of the paper's robot in the paper's chart with b = 100 on every rate."""
    start = paper_start(**({angle: size} if size else {}))
    options: dict[str, Any] = {"step_s": 1e-3, "force": True} if name == "rk4" else {}
    return dtc.simulate(
        paper("coordinate"), start, pressure=12.0, t_end=0.5, method=name, **options
    )


@pytest.mark.parametrize("name", ["rk4", "Radau"])
def test_exact_zeros_carry_the_paper_through(name):
    """So what fails below is the perturbation's doing, and nothing else's."""
    run = paper_run(name, "alpha_1", 0.0)
    assert run.success
    out = [i for i, name in enumerate(run.model.coordinate_names) if name[0] in "agp"]
    out = [i for i in out if not run.model.coordinate_names[i].startswith("psi")]
    assert not np.any(run.q[out])


@pytest.mark.parametrize("angle", ["alpha_1", "alpha_3", "gamma_2"])
def test_a_perturbation_of_1e_15_blows_rk4_up_in_the_papers_chart(angle):
    """Steps of 1 ms against eigenvalues of -7e6 1/s: 1e15 is made up for in a few steps."""
    run = paper_run("rk4", angle, 1e-15)
    assert not run.success and run.steps <= 5
    assert np.all(np.isfinite(run.x)) and np.max(np.abs(run.q)) > 1e3
    assert "rk4: the step gave a state that is not finite after t = 0.00" in run.message
    assert "segment" in run.message and "try" in run.message


@pytest.mark.parametrize("angle", ["alpha_1", "gamma_2"])
@pytest.mark.parametrize("name", ["Radau", "auto"])
def test_a_perturbation_of_1e_15_stops_implicit_methods_at_the_singularity(name, angle):
    """Beta of the second segment passes through zero at 0.235 s; a step of auto may end beyond."""
    run = paper_run(name, angle, 1e-15)
    assert not run.success and np.all(np.isfinite(run.x))
    assert run.t[-1] == pytest.approx(0.235, abs=2e-3 if name == "Radau" else 0.04)
    segments = ("segment 2",) if name == "Radau" else ("segment 1", "segment 2")
    assert any(f"{one}: beta = " in run.message for one in segments)
    assert "singularity of chart paper" in run.message
    assert "try chart='cardan' with damping='physical'" in run.message


def test_rk4_at_1_ms_is_refused_in_the_papers_chart():
    """Its limit is 4e-7 s, as the eigenvalue of -7e6 1/s has it."""
    with pytest.raises(SimulationError, match=r"step_s: 0.001 s is beyond .* limit 3\.\d*e-07 s"):
        dtc.simulate(
            paper("coordinate"), paper_start(), pressure=12.0, t_end=0.1, method="rk4", step_s=1e-3
        )


def test_the_same_start_in_the_default_chart_runs_through(rng):
    """Perturbed by 1e-3 instead of 1e-15, for ten seconds."""
    model = dtc.build(seed_four_disc())
    x = np.zeros(model.n_x)
    x[[0, 5, 10]] = 0.1, 0.01, 0.01
    x[: model.n_q] += 1e-3 * rng.choice([-1, 1], model.n_q)
    run = dtc.simulate(model, x, pressure=12.0, t_end=10.0, method="rodas4")
    assert run.success and run.t[-1] == 10.0
    assert np.max(run.condition) < 1e4  # no pose is singular
    share = np.max(np.abs(run.energy["residual"])) / np.ptp(run.energy["potential"])
    assert share < 1e-4  # 400 steps to 1e-6 each


@pytest.mark.parametrize("damping", ["coordinate", *slow("physical")])
@pytest.mark.parametrize("name", ["auto", "rk4", "DOP853", "Radau", "LSODA", *slow("radau5")])
def test_a_singular_start_is_reported_with_its_reason(name, damping):
    """Beta = 0 in the paper's chart: alpha and gamma turn about one axis.

    With physical damping `auto` leaves the chart instead; see test_events.py.
    """
    if (name, damping) == ("auto", "physical"):
        pytest.skip("it runs, in another chart")
    start = paper_start(beta_2=0.0)
    step = step_of(name, 1e-3)
    run = dtc.simulate(paper(damping), start, pressure=12.0, t_end=0.1, method=name, **step)
    assert not run.success and np.array_equal(run.x, start[:, np.newaxis])
    assert "segment 2: beta = 0 rad is at a singularity of chart paper" in run.message


BAD = (np.nan, np.inf, -np.inf)


def wrong_arguments(bad: float) -> list[tuple[dict[str, Any], str]]:
    """One argument of `simulate` at a time, and what the message starts with."""
    model, x = settled()
    state = np.where(np.arange(12) == 3, bad, x)
    return [
        ({"pressure": bad}, "pressure: expected"),
        ({"pressure": [bad]}, "pressure: expected"),
        ({"pressure": lambda t: np.array([bad])}, r"pressure\(0\): expected a finite number"),
        ({"x0": state}, "x0: expected"),
        ({"t_end": bad}, "t_end: expected"),
        ({"rtol": bad}, "rtol: expected"),
        ({"atol": bad}, "atol: expected"),
        ({"step_s": bad}, "step_s: expected"),
        ({"theta": np.full(len(model.theta0) + 1, bad)}, "theta: expected"),
    ]


@pytest.mark.parametrize("bad", BAD)
def test_arguments_that_are_not_finite_are_refused(bad):
    model, x = settled()
    for change, text in wrong_arguments(bad):
        with pytest.raises(DtcasadiError, match=text):
            dtc.simulate(model, **({"x0": x, "pressure": 1.0, "t_end": 0.1} | change))


def becoming(bad: float) -> Callable[[float], np.ndarray]:
    """A command that is good for a while."""
    return lambda t: np.array([bad if t > 0.05 else 1.0])


@pytest.mark.parametrize("bad", BAD)
def test_a_command_that_becomes_bad_names_its_time(bad):
    model, x = settled()
    with pytest.raises(SimulationError, match=r"pressure\(0\.0\d+\): expected a finite number"):
        dtc.simulate(model, x, pressure=becoming(bad), t_end=0.1)


@cache
def small() -> dtc.Model:
    """One moving disc: every method compiles at once."""
    return dtc.build(planar_robot(np.random.default_rng(1), 2), chart="planar")


USUAL = ("auto", "rk4", "midpoint", "DOP853", "Radau", "LSODA")


@pytest.mark.parametrize("name", [*USUAL, *slow(*sorted(set(METHODS) - set(USUAL)))])
@pytest.mark.parametrize(("pressure", "rate"), [(1e29, 0.0), (1.0, 1e29)])
def test_what_overflows_never_succeeds(name, pressure, rate):
    """Numbers just inside what a model accepts, but no motion: each method returns at once.

    A fixed L-stable step may end in finite nonsense, which its energy tells.
    """
    x, step = np.array([0.1, 0.2, rate, rate]), step_of(name, 0.01)
    run = dtc.simulate(small(), x, pressure=pressure, t_end=1.0, method=name, **step)
    assert not run.success and np.all(np.isfinite(run.x))
    assert run.steps <= 1 or name in ONE_STEP
    assert run.message.startswith(("rodas4: ", f"{name}: ")) and "nan" not in run.message.lower()
    assert "after t = " in run.message or "energy balance is off" in run.message


@pytest.mark.parametrize("name", [n for n, m in ONE_STEP.items() if not m.error_order])
def test_steps_without_error_control_need_a_size(name):
    expected = rf"step_s: expected a step \[s\] for {name} without error control"
    with pytest.raises(SimulationError, match=expected):
        METHODS[name].integrate(
            Problem(small(), np.zeros(4), small().theta0, command_pieces(1.0, 1, 0.1), 1e-6, 1e-8)
        )


def test_newton_that_does_not_converge_is_reported():
    """A step of a second from a state in swift motion: the stage's solution is not near."""
    model, x = settled()
    x = np.concatenate([x[:6], np.full(6, 3.0)])
    run = dtc.simulate(model, x, pressure=1.0, t_end=2.0, method="midpoint", step_s=1.0)
    assert not run.success and run.steps == 0 and np.array_equal(run.x[:, 0], x)
    assert "midpoint: the Newton iteration of the step did not converge" in run.message
    assert "try a smaller step or an adaptive method" in run.message
