"""Compliant contact: distances, the law by hand, exact derivatives, energy, statics, records."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.forces import state
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import dtcasadi as dtc
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.contact.compliant import CompliantContact
from dtcasadi.contact.record import pairs
from dtcasadi.contact.shapes import towards
from dtcasadi.forces import DiscState
from dtcasadi.forces.walls import taken_up

TURNED = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
SHAPES = (
    dtc.HalfSpace((0.1, -0.2, 0.3), (1, 2, -2)),
    dtc.Sphere((0.1, -0.2, 0.3), 0.7),
    dtc.Capsule((0.1, -0.2, 0.3), (0.8, 0.5, 0.1), 0.4),
    dtc.Box((0.1, -0.2, 0.3), (1.0, 0.6, 0.8), TURNED, 0.1),
)


def distance(shape: Any, place: np.ndarray) -> tuple[float, np.ndarray]:
    """Signed distance and its gradient as numbers."""
    at = ca.SX.sym("at", 3)
    function = ca.Function("distance", [at], list(towards(type(shape), ca.DM(shape.numbers), at)))
    gap, normal = function(place)
    return float(gap), np.array(normal).ravel()


@pytest.mark.parametrize("shape", SHAPES[1:], ids=lambda s: type(s).__name__)
def test_distances_of_convex_hulls_of_balls(rng, shape):
    """By minimizing over the hull's weights, for places outside the core."""
    balls = shape.balls()
    n = len(balls.centres)
    checked = 0
    for place in rng.uniform(-2, 2, (12, 3)):
        found = minimize(
            lambda w, place=place: np.sum((w @ balls.centres - place) ** 2),
            np.full(n, 1 / n),
            bounds=[(0, 1)] * n,
            constraints={"type": "eq", "fun": lambda w: w.sum() - 1},
            options={"ftol": 1e-14, "maxiter": 500},
        )
        away = np.sqrt(found.fun)
        if away < 0.05:
            continue
        gap, normal = distance(shape, place)
        assert gap == pytest.approx(away - balls.radius, abs=1e-5)  # the minimizer's accuracy
        expected = (place - found.x @ balls.centres) / away
        assert normal == pytest.approx(expected, abs=1e-3)
        checked += 1
    assert checked > 8


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_normals_are_unit_and_match_differences(rng, shape):
    for place in rng.uniform(-2, 2, (10, 3)):
        _, normal = distance(shape, place)
        assert np.linalg.norm(normal) == pytest.approx(1.0, rel=1e-12)
        for k, step in enumerate(1e-6 * np.eye(3)):
            slope = (distance(shape, place + step)[0] - distance(shape, place - step)[0]) / 2e-6
            assert slope == pytest.approx(normal[k], abs=1e-6)  # curvature 1/0.05 at most


def test_a_box_from_inside_and_from_its_face():
    box = dtc.Box((0, 0, 0), (2, 2, 2), rounding=0.25)
    assert distance(box, [0.9, 0.1, 0.0])[0] == pytest.approx(-0.1, rel=1e-12)
    assert distance(box, [0.5, 0.1, 0.0])[0] == pytest.approx(-0.5, rel=1e-12)
    assert distance(box, [0.5, 0.1, 0.0])[1] == pytest.approx([1, 0, 0])
    corner = 0.75 + 0.25 / np.sqrt(3)
    assert distance(box, [corner] * 3)[0] == pytest.approx(0.0, abs=1e-12)


def test_the_law_by_hand(rng):
    """One point with known velocity: push, dissipation and drag, all from their formulas."""
    obstacle = dtc.Obstacle(
        dtc.HalfSpace((0, 0, 0), (0, 1, 0)), 0.02, 5.0, 0.7, slip_speed=0.1, dissipation=0.4
    )
    point = np.array([[0.3, -0.2, 0.1]])
    contact = CompliantContact.of(obstacle, 2, point)
    for _ in range(5):
        R = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
        w, v = rng.normal(size=(2, 3))
        arm = R @ point[0]
        r = np.array([0.4, -0.015 - arm[1], -0.7])  # 0.015 below the plane
        disc = DiscState(ca.DM(R), ca.DM(r), own_rates=(ca.DM(R.T @ w), ca.DM(R.T @ v)))
        wrench = contact.wrenches(disc)
        speed = v + np.cross(w, arm)
        h = 0.02 * (0.75**3 - 0.75**4 / 2)
        bent = [(s + np.hypot(s, 0.1)) / 2 for s in (1 - 0.4 * speed[1], 1.0)]
        push = 2 * 5.0 / 0.02 * h * bent[0] / bent[1]
        along = np.array([speed[0], 0, speed[2]])
        force = push * (np.array([0, 1, 0]) - 0.7 * along / np.hypot(np.linalg.norm(along), 0.1))
        assert error(ca.evalf(wrench.force).full(), force) < 1e-12
        assert error(ca.evalf(wrench.moment).full(), np.cross(arm, force)) < 1e-12


def among(robot: dtc.Robot, **options: Any) -> dtc.Robot:
    """The robot with one obstacle of each shape where it may well sink in."""
    shapes = (
        dtc.HalfSpace((0, 0.4, 0), (0.1, 1, 0)),
        dtc.Sphere((0.2, 1.0, 1.5), 1.6),
        dtc.Capsule((1, 0, 1), (-1, 0.5, 1), 1.2),
        dtc.Box((0, 1.0, 1.5), (3, 3, 2.5), TURNED, 1.0),
    )
    fields: dict[str, Any] = {"penetration": 0.5, "load": 2.0, "rim_points": 3, "dissipation": 0.1}
    obstacles = tuple(dtc.Obstacle(shape, **(fields | options)) for shape in shapes)
    return replace(robot, obstacles=obstacles)


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_derivatives_are_exact(rng, assembly):
    """By recursion against differentiation of the flat function, all shapes at once."""
    charts = ("cardan", "paper")
    model = dtc.build(among(cases.robot(3)), chart=list(charts), assembly=assembly)
    q, qd, qdd = state(rng, charts)
    gap, _, force = numbers(model.contacts, q, qd, model.theta0)
    assert np.sum(gap < 0) > 4 and np.all(np.any(force != 0, axis=0) == (gap < 0))
    ports = [ca.MX.sym(name, model.n_q) for name in ("q", "qd", "qdd")]
    rest = np.ones(model.n_u), model.theta0
    tau = model.inverse_dynamics(*ports, *rest)
    exact = ca.Function("exact", ports, [ca.jacobian(tau, port) for port in ports[:2]])
    found = numbers(model.inverse_dynamics_jacobian, q, qd, qdd, *rest)
    for mine, reference in zip(found, numbers(exact, q, qd, qdd), strict=True):
        assert error(mine, reference) < 1e-11


def test_the_energy_is_the_potential_of_the_forces_at_rest(rng):
    charts = ("cardan", "paper")
    model = dtc.build(among(cases.robot(3)), chart=list(charts))
    q, qd, _ = state(rng, charts)
    symbol = ca.SX.sym("q", model.n_q)
    slope = ca.gradient(model.potential_energy(symbol, model.theta0), symbol)
    slope = numbers(ca.Function("slope", [symbol], [slope]), q)
    at_rest = numbers(model.forces, q, 0 * qd, model.theta0)
    assert np.any(at_rest)
    static = numbers(model.gravity, q, model.theta0) + numbers(model.spring, q, model.theta0)
    assert error(static - at_rest, slope) < 1e-11
    moving = numbers(model.forces, q, qd, model.theta0)
    assert qd @ (moving - at_rest) < 0  # friction and dissipation only take


def test_forces_and_places_add_up(rng):
    """`model.contacts` against the generalized forces, by virtual power on its own places."""
    charts = ("cardan", "paper")
    model = dtc.build(among(cases.robot(3)), chart=list(charts))
    q, qd, _ = state(rng, charts)
    at, rates = (ca.MX.sym(name, model.n_q) for name in ("q", "qd"))
    _, place, force = model.contacts(at, rates, model.theta0)
    power = ca.mtimes(ca.jacobian(ca.vec(place), at).T, ca.vec(force))
    assert len(pairs(model)) == place.shape[1] == 4 * 2 * 3
    expected = numbers(ca.Function("power", [at, rates], [power]), q, qd)
    assert error(numbers(model.forces, q, qd, model.theta0), expected) < 1e-12


def test_numbers_of_obstacles_as_parameters(rng):
    robot = among(cases.robot(3))
    model = dtc.build(robot, parameters=("obstacles.friction", "obstacles[2].geometry"))
    assert model.theta0[model.theta_blocks["obstacles.friction"]].tolist() == [0.5] * 4
    theta = model.theta0.copy()
    theta[model.theta_blocks["obstacles.friction"]] = 0.2
    theta[model.theta_blocks["obstacles[2].geometry"]] = [0.0, 0.9, 2.1, 0.8]
    changed = [replace(obstacle, friction=0.2) for obstacle in robot.obstacles]
    changed[1] = replace(changed[1], shape=dtc.Sphere((0.0, 0.9, 2.1), 0.8))
    other = dtc.build(replace(robot, obstacles=tuple(changed)))
    q, qd, _ = state(rng, ("cardan",) * 2)
    expected = numbers(other.forces, q, qd, other.theta0)
    assert error(numbers(model.forces, q, qd, theta), expected) < 1e-12


def lever(floor: float, load: float | None = None) -> dtc.Robot:
    """One solid disc of radius 1 on a hinge, upright in the way of a floor below it."""
    disc = dtc.Disc.solid(2.0, 1.0)
    wall = dtc.Obstacle(
        dtc.HalfSpace((0, floor, 0), (0, 1, 0)), 1e-3, load, rim_points=1, friction=0.3
    )
    return dtc.Robot((disc, disc), (dtc.Thread(1.0),), obstacles=(wall,), gravity=9.81)


def test_the_stated_penetration_under_the_stated_load():
    """A hinge carries a disc whose rim point nearest to the thread rests on the floor.

    The thread of length 1 lies at the angle b below the horizontal, the weight acts at the
    disc's centre: F l cos b = W (l cos b + rho sin b) gives the load F, from which b follows as
    sin b = 1e-3 + 0.2 for a floor at -0.2.
    """
    sine = 0.2 + 1e-3
    cosine = np.sqrt(1 - sine**2)
    weight = 2.0 * 9.81
    load = weight * (cosine + sine) / cosine
    model = dtc.build(lever(-0.2, load), chart="hinge")
    found = dtc.equilibrium(model, guess=[np.arcsin(sine)])
    assert found.success, found.message
    gap, _, force = numbers(model.contacts, found.q, [0.0], model.theta0)
    assert gap[0] == pytest.approx(-1e-3, rel=1e-9)
    assert force[1] == pytest.approx(load, rel=1e-9)


def test_what_is_taken_up_at_the_stated_penetration():
    assert float(taken_up(ca.DM(0.02), ca.DM(0.02)).h) == pytest.approx(0.01, rel=1e-14)
    robot = lever(-0.2)
    assert robot.obstacles[0].load == robot.weight == pytest.approx(19.62)
    assert robot.obstacles[0].stiffness == pytest.approx(2 * 19.62 / 1e-3)


def test_a_run_against_a_floor():
    """The seed robot lands on a floor: its balance closes, and the record tells what touched."""
    floor = dtc.Obstacle(dtc.HalfSpace((0, 3, 0), (0, -1, 0)), 0.02, rim_points=4, dissipation=0.2)
    seed = replace(seed_robot(4), up=(0, -1, 0), obstacles=(floor,))
    model = dtc.build(seed, chart="planar")
    x0 = np.concatenate([np.tile([0.1, 0.0], 3), np.zeros(6)])
    run = dtc.simulate(model, x0, pressure=0.0, t_end=4.0, rtol=1e-8, atol=1e-10, method="dopri5")
    assert run.success, run.message
    turned = np.ptp(run.energy["potential"])
    assert np.max(np.abs(run.energy["residual"])) < 1e-5 * turned
    assert np.all(np.diff(run.energy["dissipated"]) >= 0)
    contacts = run.contacts
    assert len(contacts) and np.all(np.diff(contacts.t) >= 0)
    assert contacts.place[:, 1] - 3 == pytest.approx(-contacts.gap, abs=1e-12)
    assert np.all(contacts.force[:, 1] < 0) and np.all(contacts.gap < 0)
    # A disc's rim point that touches is at the place that the pose gives.
    last = np.searchsorted(run.t, contacts.t[-1])
    R, r = run.poses([last])
    disc = contacts.disc[-1] - 1
    angle = np.pi / 2 * (contacts.point[-1] - 1)
    point = np.array([np.sin(angle), 1 - np.cos(angle), 0.0])
    assert r[0, disc] + R[0, disc] @ point == pytest.approx(contacts.place[-1], abs=1e-12)
    assert "of discs" in repr(contacts)
    assert repr(run.at([0.0]).contacts) == "Contacts(none)"


@pytest.mark.parametrize("name", ["ode", "ode_jacobian", "power", "potential_energy", "forces"])
def test_without_obstacles_nothing_is_paid(name):
    """The graph has the instructions it had before there were obstacles at all."""
    seed = seed_robot(3)
    model, with_one = (
        dtc.build(replace(seed, obstacles=o), chart="planar")
        for o in ((), (dtc.Obstacle(dtc.Sphere((0, 0, 9), 1), 0.1),))
    )
    plain = dtc.build(seed, chart="planar").function(name).expand()
    found = model.function(name).expand()
    assert found.n_instructions() == plain.n_instructions()
    assert found.n_instructions() < with_one.function(name).expand().n_instructions()
    assert model.contacts.size_out("place") == (3, 0)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: dtc.Sphere((0, 0, 0), -1), "radius: expected a finite positive number, got -1"),
        (lambda: dtc.Capsule((0, 0, 0), (0, 0, 0), 1), "end: expected another point than start"),
        (lambda: dtc.Box((0, 0, 0), (1, 1, 0)), "size: expected three positive numbers"),
        (
            lambda: dtc.Box((0, 0, 0), (1, 1, 1), rounding=0.6),
            "rounding: expected at most half the shortest edge, got 0.6",
        ),
        (lambda: dtc.Obstacle("floor", 0.1), "shape: expected one of HalfSpace, Sphere, Capsule"),
        (lambda: dtc.Obstacle(SHAPES[0], 0.0), "penetration: expected a finite positive number"),
        (
            lambda: dtc.Obstacle(SHAPES[0], 0.1, discs=(3, 2)),
            r"discs: expected disc numbers in rising order, got \(3, 2\)",
        ),
        (
            lambda: replace(seed_robot(3), obstacles=(dtc.Obstacle(SHAPES[0], 1, discs=(4,)),)),
            r"obstacles\[1\].discs: expected discs from 2 to 3, got \(4,\)",
        ),
        (
            lambda: replace(seed_robot(3), gravity=0, obstacles=(dtc.Obstacle(SHAPES[0], 1),)),
            r"obstacles\[1\].load: expected a positive number, as the robot has no weight",
        ),
        (
            lambda: replace(seed_robot(3), obstacles=(SHAPES[0],)),
            r"obstacles\[1\]: expected a Obstacle, got HalfSpace",
        ),
    ],
)
def test_what_is_refused(make, text):
    with pytest.raises(dtc.errors.RobotError, match=text):
        make()
