"""Walls that act one way: what is taken up, against quadrature, hand formulas and energy."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.forces import Motion, slope, state, with_forces

import dtcasadi as dtc
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.forces import FabricBunching, WallSpring
from dtcasadi.forces.walls import taken_up

CHARTS = ("cardan", "paper")
ROUND_OFF = 1e-12  # of some thousand operations, relative to the largest entry


def stretch(x: np.ndarray, width: float) -> np.ndarray:
    """h by its parts: 0, w (s^3 - s^4 / 2), x - w / 2."""
    s = np.clip(x / width, 0, 1)
    return np.where(x < width, width * (s**3 - s**4 / 2), x - width / 2)


def integral(x: float, width: float, power: int) -> float:
    """Of h^power from 0 to x, by Gauss on both parts, exact for polynomials up to degree 23."""
    node, weight = np.polynomial.legendre.leggauss(12)
    total, edges = 0.0, [0.0, min(x, width), x]
    for a, b in zip(edges, edges[1:], strict=False):
        places = a + (b - a) * (node + 1) / 2
        total += (b - a) / 2 * weight @ stretch(places, width) ** power
    return total


@pytest.mark.parametrize("x", [1e-3, 0.1, 0.2, 0.25, 0.7, 3.0])
def test_what_is_taken_up(x):
    width = 0.25
    h, once, cubed = (float(value) for value in taken_up(ca.DM(x), ca.DM(width)))
    assert h == pytest.approx(stretch(np.array(x), width), rel=1e-14)
    assert once == pytest.approx(integral(x, width, 1), rel=1e-13)
    assert cubed == pytest.approx(integral(x, width, 3), rel=1e-13)


def test_it_starts_smoothly():
    """Value and two derivatives are continuous at both ends."""
    x = ca.SX.sym("x")
    h = taken_up(x, 0.25).h
    first = ca.jacobian(h, x)
    at = ca.Function("at", [x], [h, first, ca.jacobian(first, x)])
    for place in (0.0, 0.25):
        below, above = numbers(at, place - 1e-9), numbers(at, place + 1e-9)
        for a, b in zip(below, above, strict=True):
            assert abs(a[0] - b[0]) < 1e-6  # 2e-9 times a third derivative of up to 96


def one(force: dtc.Force) -> dtc.Model:
    """The force alone on two planar discs of radius 1 with a thread of length 1."""
    seed = replace(seed_robot(2), chambers=(), springs=(), damping=dtc.Damping())
    return dtc.build(with_forces(seed, force), chart="planar", parameters=("forces.stiffness",))


def test_wall_spring_by_hand():
    """Disc 2 turned by psi about the end of the thread: the strip from the top of both discs.

    Ends (2, 0) and (2 cos psi, 1 + 2 sin psi) in (y, z): the pull k h (1 + b h^2) times the
    lever dL/dpsi; slack for psi < 0, exactly zero.
    """
    k, b, w = 3.0, 0.7, 0.05
    wall = WallSpring((1, 2), (0, 2, 0), (0, 2, 0), k, stiffening=b, smoothing=w)
    model = one(wall)
    assert model.robot.forces[0].rest_length == pytest.approx(1.0, rel=1e-15)
    for psi in (0.01, 0.1, 0.8):
        d = np.array([2 * np.cos(psi) - 2, 1 + 2 * np.sin(psi)])
        length = np.hypot(*d)
        lever = d @ [-2 * np.sin(psi), 2 * np.cos(psi)] / length
        h = stretch(np.array(length - 1.0), w)
        Q = numbers(model.forces, [0.0, psi], [0.0, 0.0], model.theta0)
        assert Q[1] == pytest.approx(-k * h * (1 + b * h**2) * lever, rel=1e-12)
    for psi in (-0.3, -0.5):
        Q = numbers(model.forces, [0.0, psi], [0.3, 0.4], model.theta0)
        assert not np.any(Q)
        energy = float(model.potential_energy([0.0, psi], model.theta0))
        assert energy == weight(model, psi)


def weight(model: dtc.Model, psi: float) -> float:
    """Gravity's energy of the same robot without the wall."""
    bare = dtc.build(replace(model.robot, forces=()), chart="planar")
    return float(bare.potential_energy([0.0, psi], bare.theta0))


def test_bunching_by_hand():
    """The same turn closes the space 1 + 2 sin psi, measured along the mean of both axes.

    d = (2 cos psi - 2, 1 + 2 sin psi), n = (-sin psi, 1 + cos psi) / 2 in (y, z).
    """
    k, b, w, gap = 3.0, 0.7, 0.05, 0.8
    model = one(FabricBunching((1, 2), (0, 2, 0), (0, 2, 0), k, gap, b, w))

    def space(psi: float) -> float:
        d = np.array([2 * np.cos(psi) - 2, 1 + 2 * np.sin(psi)])
        return float(d @ [-np.sin(psi), 1 + np.cos(psi)]) / 2

    for psi in (-0.11, -0.3, -1.2):  # the last one: through the other disc
        lever = (space(psi + 1e-6) - space(psi - 1e-6)) / 2e-6
        h = stretch(np.array(gap - space(psi)), w)
        Q = numbers(model.forces, [0.0, psi], [0.0, 0.0], model.theta0)
        assert Q[1] == pytest.approx(k * h * (1 + b * h**2) * lever, rel=1e-8)
        assert Q[1] > 0
    assert not np.any(numbers(model.forces, [0.0, -0.05], [0.0, 0.0], model.theta0))


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_walls_in_space_are_the_slope_of_their_energy(rng, assembly):
    """Against -dU/dq of the hand-written energy on independent kinematics."""
    start, end = rng.normal(size=(2, 3))
    wall = WallSpring((1, 2), start, end, 2.0, 0.4, 0.3, 0.5)
    bunch = FabricBunching((2, 3), start, end, 3.0, 4.0, 0.2, 2.0)
    plain = cases.robot(3)

    def energy(at: Motion) -> ca.SX:
        length = ca.norm_2(at.place(2, end) - at.place(1, start))
        d = at.place(3, end) - at.place(2, start)
        left = ca.dot(d, at.R(2)[:, 2] + at.R(3)[:, 2]) / 2
        total = ca.SX(0)
        for force, x in ((wall, length - 0.4), (bunch, 4.0 - left)):
            _, once, cubed = taken_up(x, force.smoothing)
            total += force.stiffness * (once + force.stiffening * cubed)
        return total

    model = dtc.build(with_forces(plain, wall, bunch), chart=list(CHARTS), assembly=assembly)
    q, qd, _ = state(rng, CHARTS)
    Q = numbers(model.forces, q, qd, model.theta0)
    assert np.min(np.abs(Q).reshape(2, 5).max(axis=1)) > 1e-3  # both are taut
    assert error(Q, slope(plain, CHARTS, energy)(q)) < ROUND_OFF
    symbol = ca.SX.sym("q", len(q)) if assembly == "flat" else ca.MX.sym("q", len(q))
    rise = ca.gradient(model.potential_energy(symbol, model.theta0), symbol)
    rise = numbers(ca.Function("rise", [symbol], [rise]), q)
    static = numbers(model.gravity, q, model.theta0) + numbers(model.spring, q, model.theta0)
    assert error(static - Q, rise) < 1e-11


def test_energy_is_conserved():
    """A robot that falls on its bunches and is caught by its wall, without damping."""
    seed = replace(seed_robot(3), chambers=(), damping=dtc.Damping())
    parts = [
        part
        for i in (1, 2)
        for part in (
            WallSpring((i, i + 1), (0, 2, 0), (0, 2, 0), 5.0, stiffening=1.0),
            FabricBunching((i, i + 1), (0, 2, 0), (0, 2, 0), 200.0, 0.5),
        )
    ]
    model = dtc.build(with_forces(seed, *parts), chart="planar")
    start = [0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
    run = dtc.simulate(model, start, t_end=2.0, rtol=1e-10, atol=1e-12, method="dopri5")
    assert run.success, run.message
    assert np.max(np.abs(run.energy["residual"])) < 1e-8 * np.ptp(run.energy["kinetic"])
    tilts = run.q[1::2]
    assert tilts.max() > 0.05 or tilts.min() < -0.3  # something was taken up


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda e: WallSpring((1, 3), e, e, 1.0), r"discs: expected neighbours \(i, i \+ 1\), got"),
        (lambda e: WallSpring((1, 2), e, e, -1.0), "stiffness: expected a finite non-negative"),
        (lambda e: WallSpring((1, 2), e, e, 1.0, 0.0), "rest_length: expected a finite positive"),
        (lambda e: WallSpring((1, 2), e, e, 1.0, smoothing=0.0), "smoothing: expected a finite p"),
        (lambda e: FabricBunching((1, 2), e, e, 1.0, 0.0), "gap: expected a finite positive"),
        (lambda e: FabricBunching((1, 2), e, e, 1.0, 1.0, -1.0), "stiffening: expected a finite n"),
    ],
)
def test_walls_refuse(make, text):
    with pytest.raises(dtc.errors.RobotError, match=text):
        make((0.0, 1.0, 0.0))
