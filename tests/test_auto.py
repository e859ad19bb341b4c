"""`method="auto"` (`dtcasadi.integrators.auto`): what it picks, what it says, what it costs."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.integrators.auto import cost_ratio, step_ratio
from dtcasadi.presets import seed_four_disc
from dtcasadi.robot import Damping, Disc, Robot, Thread

START = np.array([0.1, 0.0, 0.01, 0.0, 0.01, 0.0, *np.zeros(6)])
# The paper's robot, planar, with its damping of 100 scaled: eigenvalues of order 1, -3e2, -3e6 1/s.
SOFT, SEED, STIFF = 0.0, 100.0, 1e6


@cache
def model(damping: float) -> dtc.Model:
    robot = replace(seed_four_disc(), damping=Damping(c_a=damping, c_b=damping))
    return dtc.build(robot, chart="planar")


@cache
def run(damping: float, method: str, t_end: float = 2.0, tolerance: float = 1e-6) -> dtc.Run:
    options: dict[str, Any] = {"rtol": tolerance, "atol": tolerance, "method": method}
    found = dtc.simulate(model(damping), START, pressure=12.0, t_end=t_end, **options)
    assert found.success, found.message
    return found


def test_a_soft_scene_is_run_with_tsit5():
    soft, plain = run(SOFT, "auto"), run(SOFT, "tsit5")
    assert soft.method == "auto: tsit5"
    assert soft.message.startswith("reached t = 2 s in ") and soft.method in soft.message
    # Stability would let it be over in a few steps: there is nothing to look at.
    assert soft.choice.startswith("tsit5 from t = 0 s (explicit stability allows steps of ")
    # Stretches change the step by no more than where one begins; a tenth is ample.
    assert soft.steps < 1.1 * plain.steps


def test_a_stiff_scene_is_run_with_rodas4():
    stiff, plain = run(STIFF, "auto"), run(STIFF, "rodas4")
    assert stiff.method == "auto: rodas4" and stiff.method in stiff.message
    assert stiff.choice == "rodas4 from t = 0 s (a first look at the step that accuracy allows)"
    assert stiff.steps < 1.1 * plain.steps + 16
    # Explicit steps of 1e-6 s would be a million.
    assert stiff.steps < 100


def test_where_implicit_steps_are_dear_explicit_ones_begin():
    """In space the paper's robot needs 2200 explicit steps, of implicit ones 65."""
    built = dtc.build(seed_four_disc(), chart="cardan")
    start = np.array([0.1, 0.01, *np.zeros(built.n_x - 2)])
    options: dict[str, Any] = {"pressure": 12.0, "t_end": 10.0, "rtol": 1e-3, "atol": 1e-5}
    both, plain = (
        dtc.simulate(built, start, method=name, **options) for name in ("auto", "rodas4")
    )
    first, last = both.choice.split("; ")
    assert first.startswith("tsit5 from t = 0 s (a first look")
    assert last.startswith("rodas4 from t = 0.") and "at the stability limit" in last
    # Two looks of 16 explicit steps, and four of rodas4 to compare.
    assert both.steps < 1.1 * plain.steps + 2 * 16 + 4


def test_the_choice_follows_the_motion():
    """Accuracy rules the fall of the paper's robot, stability its settling over the next minute."""
    both, explicit, implicit = (
        run(SEED, name, 60.0, tolerance=1e-9) for name in ("auto", "tsit5", "rodas4")
    )
    assert both.method == "auto: rodas4+tsit5"
    uses = both.choice.split("; ")
    assert uses[1].startswith("tsit5 from t = 0.") and uses[-1].startswith("rodas4 from t = ")
    assert "at the stability limit" in uses[-1]
    # tsit5's steps of the fall cost less than rodas4's; there are more of them.
    equal = cost_ratio(both.model) * implicit.steps
    assert both.steps < 1.2 * min(explicit.steps, equal)


@pytest.mark.parametrize("damping", [SOFT, SEED, STIFF])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_its_steps_cost_little_more_than_the_better_methods(damping, tolerance):
    """In steps of tsit5; what is above is the looks, and the transients before them."""

    def cost(found: dtc.Run, implicit: int) -> float:
        return found.steps + (cost_ratio(found.model) - 1) * implicit

    both = run(damping, "auto", tolerance=tolerance)
    implicit = run(damping, "rodas4", tolerance=tolerance)
    best = cost(implicit, implicit.steps)
    if damping != STIFF:  # there it would be a million steps
        best = min(best, cost(run(damping, "tsit5", tolerance=tolerance), 0))
    assert cost(both, both.steps) < 1.5 * best + 64


def test_where_accuracy_sets_both_steps_they_are_as_predicted():
    """To a factor of 1.6, which the choice can bear, on a motion without stiffness."""
    for tolerance in (1e-3, 1e-6, 1e-9):
        steps = [run(SOFT, name, tolerance=tolerance).steps for name in ("rodas4", "tsit5")]
        assert 1 / 1.6 < steps[0] / steps[1] / step_ratio(tolerance) < 1.6


@pytest.mark.parametrize("damping", [SOFT, SEED, STIFF])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
def test_results_agree_to_the_tolerance(damping, tolerance):
    """With Radau at 1e-11: some hundred local errors, of which damping forgets all but the last.

    The soft scene forgets none and doubles them every 0.5 s.
    """
    exact = run(damping, "Radau" if damping else "DOP853", tolerance=1e-11).x[:, -1]
    error = np.max(np.abs(run(damping, "auto", tolerance=tolerance).x[:, -1] - exact))
    assert error < (1000 if damping == SOFT else 10) * tolerance


def test_a_function_of_time_goes_to_lsoda() -> None:
    """As a profile would be run, to the tolerance; the reason is in the choice."""
    arguments: dict[str, Any] = {"x0": START, "t_end": 2.0}
    profile = dtc.Profile(np.array([0.0, 2.0]), np.array([4.0, 12.0]), "linear")
    expected = dtc.simulate(model(SEED), pressure=profile, **arguments)
    found = dtc.simulate(model(SEED), pressure=lambda t: np.array([4.0 + 4.0 * t]), **arguments)
    assert found.success and found.method == "LSODA"
    assert found.choice == "LSODA: the pressure is a function of time"
    assert np.max(np.abs(found.x[:, -1] - expected.x[:, -1])) < 1e-4
    assert np.array_equal(found.pressure[0], 4.0 + 4.0 * found.t)


@pytest.mark.parametrize("method", ["auto", "tsit5", "rodas4"])
def test_steps_and_rejections_are_reported(method):
    """A first step of 0.5 s is refused until it fits."""
    found = dtc.simulate(
        model(SEED), START, pressure=12.0, t_end=1.0, method=method, step_s=0.5, rtol=1e-8
    )
    assert found.success and found.rejected >= 3
    assert found.steps == len(found.t) - 1 == len(found.step_sizes)
    assert np.all(found.step_sizes > 0) and np.sum(found.step_sizes) == pytest.approx(1.0)
    assert found.step_sizes[0] < 0.1
    assert found.evaluations >= 6 * (found.steps + found.rejected) - 6
    assert found.wall_time > 0


def test_other_methods_have_nothing_to_say():
    assert run(SOFT, "tsit5").choice == "" and "tsit5" in run(SOFT, "tsit5").message


def test_steps_end_at_the_jumps_of_a_profile():
    """No step straddles one, whichever method is at work."""
    profile = dtc.Profile(np.array([0.0, 0.3, 0.7]), np.array([2.0, 20.0, 5.0]))
    found = dtc.simulate(model(SEED), START, pressure=profile, t_end=1.0)
    assert found.success and {0.3, 0.7, 1.0} <= set(found.t.tolist())
    exact = dtc.simulate(
        model(SEED), START, pressure=profile, t_end=1.0, method="Radau", rtol=1e-10, atol=1e-10
    )
    assert np.max(np.abs(found.x[:, -1] - exact.x[:, -1])) < 1e-5


@pytest.mark.slow
def test_many_coordinates_are_run_with_tsit5():
    """A chain of 110 links, whose Jacobian is not worth compiling."""
    disc = Disc(0.1, 1e-6 * np.eye(3))
    chain = Robot((disc,) * 111, (Thread(0.01),) * 110, up=np.array([0.0, 1.0, 0.0]))
    x = np.zeros(220)
    x[0] = 0.1
    found = dtc.simulate(dtc.build(chain, chart="hinge"), x, t_end=0.05)
    assert found.success and found.method == "auto: tsit5"
    assert found.choice == "tsit5 throughout: more than 100 coordinates"
