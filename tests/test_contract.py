"""The contract of a controller: whatever comes in, finite commands within the limits go out."""

import re
from collections import Counter

import numpy as np
import pytest
from c_compilers import needs_compiler
from control_robot import rest, robot, tip

from dtcasadi.errors import ControlError
from dtcasadi.recentring import recentre
from ocp import Action, ControlStatus, Limits, PressureMPC
from ocp.info import StepInfo

pytestmark = needs_compiler
LOW, HIGH, RATE = 0.0, 14.0, 40.0 * 0.05
FAULTS = (
    "none given",
    "states not a number",
    "one state infinite",
    "states far out",
    "states huge",
    "pose at random",
    "wrong shape",
    "parameters not a number",
    "reference not a number",
    "reference out of reach",
    "reference huge",
    "reference of a wrong shape",
    "memory lost",
    "memory of zeros",
    "memory at random",
)


@pytest.fixture(scope="module")
def controller() -> PressureMPC:
    return PressureMPC(robot(), tip(), plan_steps=4, hold_steps=3, ramp=20.0)


def kept(command: np.ndarray, before: np.ndarray, info: StepInfo, controller: PressureMPC) -> None:
    """What every step must keep to."""
    plan = np.concatenate([before, command, info.plan[1:, 0]])
    assert np.all(np.isfinite(plan)) and np.all(np.isfinite(info.states))
    assert np.all((plan[1:] >= LOW) & (plan[1:] <= HIGH))
    # Cut to before +- rate, which itself is rounded.
    assert np.all(np.abs(np.diff(plan)) <= RATE * (1 + 1e-14))
    assert info.iterations <= controller.contract.iteration.iterations
    assert info.action == Action.PLAN if info.status.good else info.action != Action.PLAN
    assert re.fullmatch(r"[a-z][^;]*; the [a-z' ]+", info.text)


def faulty(controller: PressureMPC, x: np.ndarray, fault: str, rng: np.random.Generator):
    """One step under a fault."""
    n, theta = len(x), controller.stages.discrete.theta0
    states = {
        "none given": None,
        "states not a number": x * np.nan,
        "one state infinite": np.where(np.arange(n) == rng.integers(n), np.inf, x),
        "states far out": x + 1e3 * rng.normal(size=n),
        "states huge": 1e200 * rng.normal(size=n),
        "pose at random": rng.uniform(-3, 3, n) * rng.uniform(0, 5),
        "wrong shape": x[1:],
    }
    wishes = {
        "reference not a number": np.nan,
        "reference out of reach": 1e3,
        "reference huge": 1e200,
        "reference of a wrong shape": np.zeros(5),
    }
    memory, n_plan = controller.memory, controller.stages.horizon
    if fault == "memory lost":
        controller.memory = memory * np.nan
    elif fault == "memory of zeros":
        controller.memory = 0 * memory
    elif fault == "memory at random":
        controller.memory = rng.normal(size=len(memory)) * 10.0 ** rng.uniform(-3, 30)
    if fault.startswith("memory"):
        controller.command = np.clip(
            np.nan_to_num(controller.memory[n_plan : n_plan + 1]), LOW, HIGH
        )
    before = controller.command
    bad = theta * np.nan if fault == "parameters not a number" else None
    found = controller.step(states.get(fault, x), reference=wishes.get(fault), theta=bad)
    return before, found


def run_with_faults(controller: PressureMPC, rng: np.random.Generator, steps: int) -> Counter:
    """A closed loop with a fault in some of its steps, alone or for a while."""
    move = robot().compiled("step")
    theta = controller.stages.discrete.theta0
    x, fault, left = np.zeros(13), "", 0
    counts: Counter = Counter()
    controller.reset(rng.uniform(LOW, HIGH, 1))
    for _ in range(steps):
        if left == 0:
            fault = str(rng.choice(FAULTS)) if rng.uniform() < 0.5 else ""
            left = int(rng.integers(1, 14))
        left -= 1
        before, (u, info) = faulty(controller, x, fault, rng)
        kept(u, before, info, controller)
        counts[fault, info.status] += 1
        moved = move(x, u, theta)
        x = moved.x_next if moved.status[0] == 0 else np.zeros(13)
    return counts


def test_random_faults(controller, rng):
    counts = run_with_faults(controller, rng, 2000)
    seen = {status for _, status in counts}
    assert seen >= {0, 2, 3, 4}
    assert {fault for fault, _ in counts} >= set(FAULTS)
    assert counts["", ControlStatus.SOLVED] > 0.9 * sum(n for (f, _), n in counts.items() if not f)


def test_without_estimates_the_plan_goes_on_then_holds_then_ramps_down_and_recovers(controller):
    move, theta = robot().compiled("step"), controller.stages.discrete.theta0
    controller.reset(5.0)
    x = np.zeros(13)
    for _ in range(10):
        u, info = controller.step(x)
        x = move(x, u, theta).x_next
    plan, commands, actions = info.plan[:, 0], [], []
    for _ in range(30):
        u, info = controller.step(None)
        assert info.status is ControlStatus.NO_ESTIMATE
        commands.append(u[0])
        actions.append(info.action)
        x = move(x, u, theta).x_next
    assert actions == [Action.LAST_PLAN] * 4 + [Action.HOLD] * 3 + [Action.RAMP] * 23
    np.testing.assert_allclose(commands[:4], plan[1:5], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(commands[4:7], commands[3])
    # 20 a second is 1 a step, down to the safe pressure of zero.
    np.testing.assert_allclose(commands[7:], np.maximum(0, commands[3] - np.arange(1, 24)))
    for _ in range(200):
        u, info = controller.step(x)
        assert info.status is ControlStatus.SOLVED
        x = move(x, u, theta).x_next
    hanging = robot().sensors["tip"].output(x, u, theta)[1]
    np.testing.assert_allclose(float(hanging), 2.6, atol=0.01)


def test_recovery_takes_one_step_after_each_fault(controller, rng):
    move, theta = robot().compiled("step"), controller.stages.discrete.theta0
    for fault in FAULTS:
        controller.reset(5.0)
        x = np.zeros(13)
        for _ in range(5):
            u, info = controller.step(x)
            x = move(x, u, theta).x_next
        for _ in range(3):
            _, (u, _) = faulty(controller, x, fault, rng)
            x = move(x, u, theta).x_next
        before = controller.command
        u, info = controller.step(x)
        kept(u, before, info, controller)
        assert info.status is ControlStatus.SOLVED, (fault, info.text)


def test_texts(controller, rng):
    x = np.zeros(13)
    expected = {
        "none given": "the estimate is missing or not finite (none was given); "
        "the last command is held",
        "wrong shape": "the estimate is missing or not finite "
        "(x: expected shape (13,), got (12,)); the last command is held",
        "states huge": "the estimate is missing or not finite; the last command is held",
        "reference not a number": "the reference, the target or its cost is missing or not "
        "finite; the last command is held",
        "states far out": "the model's prediction is not finite or did not converge; "
        "the last command is held",
    }
    for fault, text in expected.items():
        controller.reset(5.0)
        _, (_, info) = faulty(controller, x, fault, rng)
        assert info.text == text
    sentences = {each.sentence for kind in (ControlStatus, Action) for each in kind}
    assert len(sentences) == len(ControlStatus) + len(Action)


def test_out_of_reach_the_command_ends_at_its_limit(controller):
    move, theta = robot().compiled("step"), controller.stages.discrete.theta0
    controller.reset(5.0)
    x = rest(5.0)
    for _ in range(30):
        u, info = controller.step(x, reference=-100.0)
        assert info.status is ControlStatus.SOLVED and info.saturated.all()
        x = move(x, u, theta).x_next
    np.testing.assert_allclose(u, HIGH, rtol=1e-14)


def test_a_tight_budget_is_said_and_limits_are_kept(rng):
    controller = PressureMPC(robot(), tip(horizon=5), iterations=2)
    statuses = {run for _, run in run_with_faults(controller, rng, 100)}
    assert ControlStatus.BUDGET in statuses
    controller.reset(5.0)
    _, info = controller.step(rest(5.0), reference=2.3)
    assert info.text == (
        "the plan keeps to the limits of the commands, but its solution stopped at the budget of "
        "iterations; the command is the plan's"
    )


def test_limits_that_no_rate_can_meet_are_said_and_the_command_is_kept():
    """From the second interval on at least 10, at 2 an interval: from 9 it goes, from 3 not."""
    lower = np.array([[LOW], [10.0], [10.0], [10.0]])
    problem = tip(horizon=4, soft=(), limits=Limits(lower, HIGH, rate=40.0))
    controller = PressureMPC(robot(), problem, u0=3.0)
    for action in (*[Action.HOLD] * 4, Action.RAMP):
        u, info = controller.step(rest(3.0))
        assert info.status is ControlStatus.SOLVER_FAILED and info.action is action
        assert np.all(np.abs(u - 3.0) <= RATE) and np.all((u >= LOW) & (u <= HIGH))
    assert "has no solution within the limits; the command goes to the safe" in info.text
    controller.reset(9.0)
    u, info = controller.step(rest(9.0))
    assert info.status is ControlStatus.SOLVED and np.all(info.plan[1:] >= 10.0 - 1e-9)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"u0": 20.0}, "u0: expected a command within the limits, got [20.0]"),
        ({"u0": [1.0, 2.0]}, "u0: expected finite numbers of shape (1), got shape (2,)"),
        ({"iterations": 0}, "iterations: expected an integer from 1 to 1000000, got 0"),
        ({"hold_steps": -1}, "hold_steps: expected an integer from 0 to 1000000000, got -1"),
        ({"ramp": -1.0}, "ramp: expected a finite non-negative number, got -1.0"),
    ],
)
def test_arguments(arguments, text):
    with pytest.raises(ControlError, match=re.escape(text)):
        PressureMPC(robot(), tip(), **arguments)


@pytest.mark.slow
def test_random_faults_for_long(controller, rng):
    run_with_faults(controller, rng, 100_000)


@pytest.mark.slow
def test_in_space_a_re_centred_estimate_gives_the_same_plan(rng):
    discrete = robot("cardan")
    model, controller = discrete.model, PressureMPC(discrete, tip(horizon=20, soft=()), u0=5.0)
    x = np.zeros(31)
    x[-1] = 5.0
    for _ in range(40):
        x = discrete.compiled("step")(x, np.array([5.0]), model.theta0).x_next
    x[:30] += 0.05 * rng.normal(size=30)
    at, theta, _ = recentre(model, x, model.theta0, range(3))
    assert not np.any(at[:15]) and np.max(np.abs(x[:15])) > 0.5
    _, info = controller.step(x)
    controller.reset(5.0)
    _, again = controller.step(at, theta=theta)
    assert info.status is again.status is ControlStatus.SOLVED
    # Steps of 50 ms in other coordinates differ by their own error.
    np.testing.assert_allclose(again.plan, info.plan, atol=1e-3)
