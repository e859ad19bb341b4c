"""The controller as exported C in single precision, beside double precision and through faults."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from c_compilers import needs_compiler
from control_robot import robot, tip
from control_toy import cart
from exported import Library, built

import dtcasadi as dtc
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from ocp import Action, ControlStatus, Effort, Limits, PressureMPC, Problem, Tracking

pytestmark = needs_compiler
EPS = float(np.finfo(np.float32).eps)


def of_cart() -> PressureMPC:
    """A cart that is pushed; limits and rate limits are active in half of its steps."""
    problem = Problem(10, Tracking("place", weight=10.0), Effort(0.05), Limits(-1.0, 3.0, 10.0))
    return PressureMPC(cart(), problem, u0=np.zeros(1))


def of_robot() -> PressureMPC:
    """Four discs in the plane, a soft limit of the tip."""
    return PressureMPC(robot(method="ros2"), tip(), u0=np.zeros(1))


CASES = [of_cart, pytest.param(of_robot, marks=pytest.mark.slow)]
# References that are stepped between, in reach.
WISHES = {of_cart: (0.5, 1.2), of_robot: (2.45, 2.75)}


class Single:
    """The exported controller and its memory."""

    def __init__(self, library: Library, rows: int):
        self._library, self._rows = library, rows
        status, (self.memory,) = library.call("control_start", [np.zeros(1)])
        assert status == 0

    def step(self, x: np.ndarray, theta: np.ndarray, wish: float) -> dict[str, np.ndarray]:
        """Outputs by name."""
        rows = np.full((1, self._rows), wish)
        _, found = self._library.call("control", [x, theta, rows, self.memory])
        names = [port["name"] for port in self._library.ports("control")[1]]
        outputs = dict(zip(names, found, strict=True))
        self.memory = outputs["memory_next"]
        return outputs


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> Callable[[Callable], tuple[PressureMPC, Library]]:
    @cache
    def made(case: Callable[[], PressureMPC]) -> tuple[PressureMPC, Library]:
        controller, folder = case(), tmp_path_factory.mktemp("single")
        functions = controller.functions()
        kept = {name: functions[name] for name in ("control_start", "control")}
        written = dtc.export_c(kept, folder / "c", name="mpc", single=True)
        library = built(written, ["-O1", "-Wall", "-Werror"], folder / "lib")
        return controller, Library(written, library, single=True)

    return made


@pytest.mark.parametrize("case", CASES)
def test_commands_are_those_of_double_precision(exported, case):
    controller, library = exported(case)
    s = controller.stages
    move = Bound(twin(s.discrete.step, source=s.discrete.native("step")))
    theta = s.discrete.theta0
    x, single = np.zeros(s.n_x), Single(library, s.horizon + 1)
    controller.reset(0.0)
    gaps, commands = [], []
    for k in range(300):
        wish = WISHES[case][k // 60 % 2]
        u, _ = controller.step(x, reference=wish)
        found = single.step(x, theta, wish)
        assert found["outcome"] == ControlStatus.SOLVED
        gaps.append(abs(float(found["u"][0]) - u[0]))
        commands.append(u[0])
        x = move(x, u, theta).x_next
    # Round-off of the states, through a quadratic program whose condition is some hundreds.
    assert np.max(gaps) < 500 * EPS * np.ptp(commands)


@pytest.mark.parametrize("case", CASES)
def test_the_contract_holds_through_faults(exported, case, rng):
    controller, library = exported(case)
    s = controller.stages
    single, last = Single(library, s.horizon + 1), np.float32(0)
    lower, upper, rate = (np.float32(side[0, 0]) for side in (s.lower, s.upper, s.rate))
    bad = (np.nan, np.inf, -np.inf, 1e30)
    seen = set()
    for k in range(400):
        x, theta, wish = 0.1 * rng.normal(size=s.n_x), s.discrete.theta0, WISHES[case][k // 60 % 2]
        fault = rng.choice(bad)
        if rng.random() < 0.3:
            x = np.where(rng.random(s.n_x) < 0.5, fault, x)
        elif rng.random() < 0.2:
            wish = fault
        found = single.step(x, theta, wish)
        u = found["u"][0]
        assert np.isfinite(u) and lower <= u <= upper
        assert abs(u - last) <= rate * (1 + 2 * EPS) + 2 * EPS * abs(last)
        sound = bool(np.all(np.isfinite(x)) and np.isfinite(wish) and np.max(np.abs(x)) < 1e15)
        sound &= abs(wish) < 1e15
        assert (found["outcome"] <= ControlStatus.BUDGET) == (found["action"] == Action.PLAN)
        assert sound or found["action"] != Action.PLAN
        seen.add(int(found["outcome"][0]))
        last = u
    assert {0, ControlStatus.NO_ESTIMATE, ControlStatus.NO_REFERENCE} <= seen
