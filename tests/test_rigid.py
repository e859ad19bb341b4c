"""Rigid contact: rest, sliding, restitution, energy, penetration, cone, Zeno."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from rigid_robots import RADIUS, G, swing

import dtcasadi as dtc
from dtcasadi.contact import Plates
from dtcasadi.contact.kernels import detection
from dtcasadi.contact.report import stepped
from dtcasadi.contact.shapes import towards
from dtcasadi.contact.start import rims
from dtcasadi.errors import SimulationError
from dtcasadi.rim import circle, rim_points

SLOW = pytest.mark.slow
# Turns the disc's axis from along the thread to across it: the disc lies flat beside the thread.
FLAT = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def slab(angle: float, friction: float) -> dtc.Model:
    """A disc flat on a slope, mass and outline centred on the thread's end, the thread level."""
    disc = dtc.Disc(
        1.0,
        1e-2 * np.diag([0.25, 0.25, 0.5]),
        outline=circle(np.zeros(3), RADIUS),
    )
    slope = dtc.Obstacle(dtc.HalfSpace((0, 0, 0), (0, 1, 0)), friction=friction)
    up = (np.sin(angle), np.cos(angle), 0)
    robot = dtc.Robot((disc, disc), (dtc.Thread(1.0, twist=FLAT),), up=up, obstacles=(slope,))
    return dtc.build(robot)


def rested(steps: int) -> tuple[dtc.Run, float]:
    """A run just below the angle of friction, and how far the disc has crept."""
    run = dtc.simulate(slab(np.arctan(0.999 * 0.5), 0.5), np.zeros(10), t_end=steps * 1e-3)
    assert run.success and run.method == "moreau", run.message
    _, r = run.poses([0, -1])
    return run, float(np.linalg.norm(r[1, 1] - r[0, 1]))


@SLOW
def test_at_rest_on_a_slope():
    run, creep = rested(1000)
    assert creep < 1e-9 * RADIUS
    force = run.contacts.force[run.contacts.t == run.t[-1]].sum(axis=0)
    up = run.model.robot.up
    assert force[:2] == pytest.approx(G * up[:2], rel=1e-3)  # along the thread it may share
    assert run.touched.defect < 1e-8


@pytest.mark.slow
def test_at_rest_for_a_hundred_thousand_steps():
    assert rested(100_000)[1] < 1e-9 * RADIUS


@SLOW
@pytest.mark.parametrize("friction", [0.5])
def test_sliding_sets_in_at_the_angle_of_friction(friction):
    """0.1 % beyond atan(mu) it slides with g (sin - mu cos), at first along the fall line."""
    angle = np.arctan(1.001 * friction)
    run = dtc.simulate(slab(angle, friction), np.zeros(10), t_end=0.2)
    _, r = run.poses([0, -1])
    acceleration = G * (np.sin(angle) - friction * np.cos(angle))
    expected = acceleration * (0.2**2 + 0.2 * 1e-3) / 2  # of the implicit Euler rule
    assert r[1, 1] - r[0, 1] == pytest.approx([-expected, 0, 0], rel=1e-3, abs=1e-3 * expected)


@pytest.mark.parametrize(
    "restitution", [0.4, pytest.param(0.0, marks=SLOW), pytest.param(1.0, marks=SLOW)]
)
def test_restitution(restitution):
    """At the impact the point's normal velocity is turned round, times the coefficient."""
    model = swing(restitution, friction=0.0)
    q = np.arcsin(0.3) - 1e-4
    x = np.array([q, 1.5])
    x_next = stepped(model)(x, [], [], [1e-3], model.theta0)[0]
    free = dtc.build(replace(model.robot, obstacles=()), chart="hinge")
    (before,) = numbers(free.discrete(1e-3, method="moreau").step, x, [], [])[0][1:]
    # Without restitution it stops at the floor at the end of the step, where it stays.
    expected = -restitution * before if restitution else 1e-4 / 1e-3
    assert x_next[1] == pytest.approx(expected, rel=1e-3)  # the gap at the end, to first order
    assert x_next[0] == pytest.approx(np.arcsin(0.3), abs=1e-7)


def test_zeno():
    """Infinitely many bounces in a finite time end at rest, in as many steps as any others."""
    run = dtc.simulate(swing(0.7), np.zeros(2), t_end=5.0)
    assert run.success and run.steps == 5000
    assert abs(run.qd[0, -1]) < 1e-12
    assert abs(run.at([4.9995]).qd[0, 0]) < 1e-12  # at rest within a step, too
    peaks = [k for k in range(1, run.steps) if run.qd[0, k] < -0.05 and run.qd[0, k - 1] > 0.05]
    speeds = np.abs(run.qd[0, peaks])
    assert len(speeds) > 5
    # Each bounce at 0.7 of the one before, but for what the forces do in a step: g h over v.
    ratios = speeds[1:] / speeds[:-1]
    assert np.all(np.abs(ratios - 0.7) < 3 * G * 1e-3 / speeds[1:])
    assert run.touched.loss.max() <= 0


def tumbling(n: int = 3, **options: Any) -> dtc.Model:
    """A chain of hoops over a floor and a ball, with nothing that dissipates but contact."""
    shapes = dtc.HalfSpace((0, -1.2, 0), (0.1, 1, 0.2)), dtc.Sphere((0, 0.5, 2.5), 0.6)
    fields = {"friction": 0.4, "restitution": 0.6, "rim_points": 8} | options
    robot = dtc.Robot(
        (dtc.Disc.hoop(1.0, 0.3),) * n,
        (dtc.Thread(0.8),) * (n - 1),
        obstacles=tuple(dtc.Obstacle(shape, **fields) for shape in shapes),
    )
    return dtc.build(robot, chart="planar")


def dropped(model: dtc.Model, rng: np.random.Generator) -> dtc.Run:
    """A run from a random pose and random rates, one that touches something."""
    while True:
        x0 = np.concatenate([0.5 * rng.normal(size=model.n_q), 2 * rng.normal(size=model.n_q)])
        try:
            run = dtc.simulate(model, x0, t_end=0.6, step_s=1e-3)
        except SimulationError:
            continue
        if run.touched is not None and len(run.touched.loss):
            return run


def check_drop(run: dtc.Run) -> None:
    touched = run.touched
    assert touched is not None
    # Impulses only take; round-off of their size is all that may be left.
    assert touched.loss.max() <= 1e-13 * max(1.0, np.abs(touched.loss).max())
    assert touched.defect < 1e-8
    energy = run.energy
    total = energy["kinetic"] + energy["potential"] - energy["projected"]
    turned = np.ptp(energy["kinetic"])
    # The smooth steps' own error, first order: 1e-3 s over motion of some 0.1 s.
    assert np.max(total - np.minimum.accumulate(total)) < 2e-2 * turned
    gaps = lowest(run)
    assert gaps > -1e-4 * 0.3


def lowest(run: dtc.Run) -> float:
    """The least signed distance of any rim point from any obstacle at any step."""
    R, r = run.poses()
    least = np.inf
    robot = run.model.robot
    at = ca.SX.sym("at", 3)
    for obstacle in robot.obstacles:
        shape = obstacle.shape
        distance, _ = towards(type(shape), ca.DM(shape.numbers), at)
        function = ca.Function("distance", [at], [distance])
        for k in range(1, robot.n_discs):
            points = rim_points(robot.discs[k], obstacle.rim_points)
            places = r[:, k, None] + np.einsum("tij,pj->tpi", R[:, k], points)
            least = min(least, float(np.array(function(places.reshape(-1, 3).T)).min()))
    return least


@pytest.mark.slow
def test_energy_never_grows_over_a_thousand_drops(rng):
    model = tumbling()
    for _ in range(1000):
        check_drop(dropped(model, rng))


def test_penetration_falls_with_the_square_of_the_step():
    """Before the projection; after it there is next to none.

    The point swings up against a plane on its pivot's side, where its path bends into the obstacle,
    and is half a step's way off when it is stopped.
    """
    model = swing(0.0, friction=0.0)
    above = dtc.Obstacle(dtc.HalfSpace((0, -0.3, 0), (0, -1, 0)), friction=0.0, rim_points=1)
    model = dtc.build(replace(model.robot, obstacles=(above,)), chart="hinge")
    left = []
    for step in (4e-3, 2e-3, 1e-3):
        x = np.array([np.arcsin(0.3) + 0.5 * step * 3.0, -3.0])
        x_next, *_, shift = stepped(model)(x, [], [], [step], model.theta0)
        assert abs(np.sin(x_next[0]) - 0.3) < 1e-6 * RADIUS * (step / 1e-3) ** 4
        left.append(abs(shift[0]))
    assert left[2] < 1e-4 * RADIUS
    assert left[:2] == pytest.approx([16 * left[2], 4 * left[2]], rel=0.05)


@pytest.mark.parametrize("chart", ["planar", pytest.param("cardan", marks=SLOW)])
def test_candidates_against_distances_and_differences(rng, chart):
    """Gaps by the compliant shapes' distances, Jacobians by differences of the places."""
    shapes = (
        dtc.HalfSpace((0, -0.5, 0), (0.1, 1, 0)),
        dtc.Sphere((0.2, 1.0, 3.0), 0.4),
        dtc.Capsule((1, 0, 1), (-1, 0.5, 1), 0.2),
        dtc.Box((0, 2.5, 2.5), (1, 0.5, 1), FLAT, 0.1),
    )
    robot = replace(
        cases.robot(3),
        obstacles=tuple(dtc.Obstacle(shape, rim_points=2) for shape in shapes),
        plates=Plates(rim_points=2),
    )
    model = dtc.build(robot, chart=chart)
    known = rims(model)
    assert known is not None
    q, v = 0.4 * rng.normal(size=(2, model.n_q))
    find = detection(known.candidates, model.n_q, native=False)
    sq = ca.MX.sym("q", model.n_q)
    function = ca.Function("found", [sq], find(*known.places(sq, model.theta0), v, 1e-3))
    gap, J, mu, who, frame, place = numbers(function, q)
    at = ca.SX.sym("at", 3)
    for s, number in enumerate(who.astype(int)):
        if number == 0:
            continue
        disc, obstacle, _, _ = known.candidates.who[number - 1]
        axes = frame[:, s].reshape(3, 3)
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
        if not obstacle:
            continue
        shape = robot.obstacles[obstacle - 1].shape
        both = towards(type(shape), ca.DM(shape.numbers), at)
        distance, normal = numbers(ca.Function("towards", [at], list(both)), place[:, s])
        assert gap[s] == pytest.approx(distance[0], abs=1e-12)
        assert axes[0] == pytest.approx(normal, abs=1e-9)
        point = known.candidates.points[number - 1]
        _, r = model.poses(sq, model.theta0)
        R, r = model.poses(sq, model.theta0)
        moved = r[:, disc - 1] + ca.mtimes(R[:, 3 * disc - 3 : 3 * disc], ca.DM(point))
        slope = numbers(ca.Function("slope", [sq], [ca.jacobian(moved, sq)]), q)
        assert error(J[3 * s : 3 * s + 3], axes @ slope) < 1e-10


@pytest.mark.slow
def test_discs_do_not_pass_through_each_other():
    """The seed robot curls onto itself: every rim stays on its side of every plate."""
    seed = dtc.load_scene("seed_four_disc_up")
    robot = replace(seed.robot, plates=Plates(friction=0.3, rim_points=8))
    model = dtc.build(robot, chart="planar")
    run = dtc.simulate(model, seed.x0(model), pressure=12.0, t_end=3.0)
    assert run.success, run.message
    R, r = run.poses(np.arange(0, run.steps, 5))
    for a in range(4):
        points = rim_points(robot.discs[a], 8)
        places = r[:, a, None] + np.einsum("tij,pj->tpi", R[:, a], points)
        for b in range(4):
            if a == b:
                continue
            local = np.einsum("tji,tpj->tpi", R[:, b], places - r[:, b, None])
            inside = np.hypot(local[..., 0], local[..., 1] - 1) < 0.99
            # From one look to the next no point has changed sides within the rim.
            stays = inside[1:] & inside[:-1]
            assert np.all((local[1:, :, 2] * local[:-1, :, 2])[stays] > 0)
    assert len(run.contacts) and set(run.contacts.obstacle) == {0}
    without = dtc.simulate(seed, t_end=1.0)
    assert not len(without.contacts)


def test_without_contact_the_method_is_implicit_euler():
    """x' = v, M v' = f linearized: order one against a converged run."""
    seed = dtc.load_scene("seed_four_disc")
    model = seed.build()
    exact = dtc.simulate(model, seed.x0(model), pressure=12.0, t_end=0.5, method="rodas4").x[:, -1]
    off = [
        np.max(np.abs(dtc.simulate(seed, t_end=0.5, method="moreau", step_s=h).x[:, -1] - exact))
        for h in (4e-3, 2e-3)
    ]
    assert off[0] / off[1] == pytest.approx(2, abs=0.2)
