"""What a robot's forces must be, and how it is said when they are not."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.forces import with_forces
from own_forces import Magnet, Tendon

import dtcasadi as dtc
from dtcasadi.forces import Couple, DiscState, FollowerLoad, Payload, PointLoad, Wrench


@dataclass(frozen=True, eq=False)
class Mute(dtc.Force):
    """Gives nothing."""

    disc: int


@dataclass(frozen=True, eq=False)
class Nowhere(dtc.Force):
    """Names no disc."""

    strength: float

    def wrenches(self, disc: DiscState) -> Wrench:
        return disc.turn((0, 0, 1))


@dataclass(frozen=True, eq=False)
class Listed(Magnet):
    """Holds what is neither number nor text."""

    names: list[str] | None = None


@dataclass(frozen=True, eq=False)
class Wrong(dtc.Force):
    """Gives a wrench too many, or of the wrong shape."""

    disc: int
    kind: str

    def wrenches(self, disc: DiscState) -> object:
        one = disc.turn((0, 0, 1))
        return [one, one] if self.kind == "two" else Wrench(ca.SX.zeros(2), ca.SX.zeros(3))


@pytest.mark.parametrize(
    ("force", "text"),
    [
        ("gravity", r"forces\[1\]: expected a Force, got 'gravity'"),
        (Mute(2), r"forces\[1\]: expected Mute with wrenches or energy .*, got none of them"),
        (Nowhere(1.0), r"forces\[1\]: expected Nowhere with a field disc or discs, got none"),
        (Magnet(5, 1.0), r"forces\[1\].disc: expected an integer from 1 to 3, got 5"),
        (Tendon((1, 4), 1.0, 0.0), r"forces\[1\].discs: expected an integer from 1 to 3, got 4"),
        (Tendon((3, 2), 1.0, 0.0), r"forces\[1\].discs: expected disc numbers in rising order"),
        (Magnet(2, np.nan), r"forces\[1\].strength: expected finite numbers, got nan"),
        (Listed(2, 1.0, names=["a"]), r"forces\[1\].names: expected finite numbers, a text or"),
    ],
)
def test_robots_refuse(force, text):
    with pytest.raises(dtc.errors.RobotError, match=text):
        with_forces(cases.robot(3), force)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: PointLoad(2, np.inf, (0, 0, 1)), "magnitude: expected a finite number, got inf"),
        (lambda: FollowerLoad(2, 1.0, (0, 0, 0)), "direction: expected a direction"),
        (lambda: PointLoad(2, 1.0, (0, 0, 1), (0, 0)), r"point: expected .* shape \(3\)"),
        (lambda: Couple(2, 1.0, (0, 0, 1), follower=1), "follower: expected True or False, got 1"),
        (lambda: Payload(2, -1.0), "mass: expected a finite non-negative number, got -1"),
        (lambda: Payload(2, 1.0, None, np.diag([1.0, 1.0, 3.0])), "inertia: expected non-negative"),
    ],
)
def test_constructors_refuse(make, text):
    with pytest.raises(dtc.errors.RobotError, match=text):
        make()


@pytest.mark.parametrize(
    ("kind", "got"),
    [("two", r"\[\(\(3, 1\), \(3, 1\)\), \(\("), ("flat", r"\[\(\(2, 1\), \(3, 1\)\)\]")],
)
def test_models_refuse_wrong_wrenches(kind, got):
    robot = with_forces(cases.robot(3), Wrong(2, kind))
    expected = rf"Wrong.wrenches: expected 1 Wrench of moment and force, .*, got {got}"
    with pytest.raises(dtc.errors.ModelError, match=expected):
        dtc.build(robot).ode  # noqa: B018
