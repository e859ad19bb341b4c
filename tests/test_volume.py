"""Inflation `volume`: V by an independent mesh, its wrench, what it conserves."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.forces import state
from oracles.mesh import polygon, volumes
from test_derivatives import exact

import dtcasadi as dtc
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.robot import Robot

CHARTS = ("cardan", "paper", "ball")
ROUND_OFF = 1e-12  # of some thousand operations, relative to the largest entry


def robot(n: int, compliance: float = 0.0) -> Robot:
    """Several chambers over one, two and all segments, their sections different on every disc."""
    plain = cases.robot(n)
    chambers = [replace(c, radial_compliance=compliance * k) for k, c in enumerate(plain.chambers)]
    return replace(plain, chambers=tuple(chambers))


@pytest.mark.parametrize("assembly", ["flat", "graph"])
@pytest.mark.parametrize("compliance", [0.0, 0.02])
def test_volume_by_a_mesh(rng, assembly, compliance):
    """The mesh of a polygon is exact: its walls are the surfaces of straight lines themselves."""
    model = dtc.build(robot(4, compliance), chart=list(CHARTS), assembly=assembly)
    for corners in (3, 7):
        q, _, _ = state(rng, CHARTS)
        pressure = rng.uniform(1.0, 5.0, model.n_u)
        poses = numbers(model.poses, q, model.theta0)
        expected = volumes(model.robot, *poses, polygon(corners, 1.0, rng), pressure)
        assert error(numbers(model.volume, q, pressure, model.theta0), expected) < ROUND_OFF


def test_circles_by_a_fine_mesh(rng):
    """Of the paper's robot: the error of the rim's polygon, 2 pi^2 / (3 n^2) of the area."""
    model = dtc.build(seed_robot(4))
    q, _, _ = state(rng, ("cardan",) * 3)
    n = 1000
    angles = 2 * np.pi * np.arange(n) / n
    circle = np.column_stack([np.cos(angles), np.sin(angles)]) / np.sqrt(np.pi)
    poses = numbers(model.poses, q, model.theta0)
    expected = volumes(model.robot, *poses, circle, np.zeros(1))
    lost = 2 * np.pi**2 / (3 * n**2)
    volume = numbers(model.volume, q, [0.0], model.theta0)
    assert volume[0] * (1 - lost) == pytest.approx(expected[0], rel=1e-9)


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_force_is_pressure_times_slope_of_the_mesh(rng, assembly):
    """Central differences of the mesh's volume: h^2 and round-off / h, 1e-9 together."""
    model = dtc.build(robot(4, 0.02), chart=list(CHARTS), assembly=assembly, inflation="volume")
    q, _, _ = state(rng, CHARTS)
    pressure = rng.uniform(1.0, 5.0, model.n_u)
    outline = polygon(5, 1.0, rng)
    h = 1e-5

    def enclosed(at: np.ndarray) -> np.ndarray:
        R, r = numbers(model.poses, at, model.theta0)
        return volumes(model.robot, R, r, outline, pressure)

    columns = [(enclosed(q + h * e) - enclosed(q - h * e)) / (2 * h) for e in np.eye(len(q))]
    Q = numbers(model.inflation, q, pressure, model.theta0)
    assert error(Q, np.array(columns) @ pressure) < 1e-8
    symbol = ca.SX.sym("q", len(q)) if assembly == "flat" else ca.MX.sym("q", len(q))
    slope = ca.jacobian(model.volume(symbol, pressure, model.theta0), symbol)
    slope = numbers(ca.Function("slope", [symbol], [slope]), q)
    assert error(Q, slope.T @ pressure) < ROUND_OFF


def cycle(rng, n_q: int, samples: int = 256) -> tuple[np.ndarray, np.ndarray]:
    """A random smooth closed path through random poses: q and dq/ds at equal steps of s."""
    s = 2 * np.pi * np.arange(samples) / samples
    a, b = 0.15 * rng.normal(size=(2, 3, n_q))
    waves = [(k + 1) * s for k in range(3)]
    q, slope = np.zeros((2, samples, n_q))
    for k, w in enumerate(waves):
        q += np.outer(np.cos(w), a[k]) + np.outer(np.sin(w), b[k])
        slope += (k + 1) * (np.outer(np.cos(w), b[k]) - np.outer(np.sin(w), a[k]))
    return q, slope * 2 * np.pi / samples


@pytest.mark.parametrize("chart", ["cardan", "planar"])
def test_no_net_work_round_closed_cycles(rng, chart):
    """The trapezoidal rule is exact to round-off on smooth closed paths; `last_disc` does work."""
    models = [
        dtc.build(seed_robot(4), chart=chart, inflation=kind) for kind in ("volume", "last_disc")
    ]
    for _ in range(5):
        q, dq = cycle(rng, models[0].n_q)
        q += 0.4 * rng.normal(size=models[0].n_q)
        works = []
        for model in models:
            Q = np.array(model.inflation(q.T, 12.0, model.theta0)).T
            power = np.einsum("ij,ij->i", Q, dq)
            works.append(power.sum() / np.abs(power).sum())
        assert abs(works[0]) < 1e-13
        assert abs(works[1]) > 1e-3


def test_net_work_of_the_last_disc_by_hand():
    """One planar segment: Q_beta = pA(rho + l sin psi), Q_psi = pA rho, so round the rectangle
    0..a in beta, 0..b in psi (beta first) the work is -pA l a sin b.
    """
    p, a, b = 12.0, 0.3, 0.5
    seed = seed_robot(2)
    area = seed.discs[0].area
    node, weight = np.polynomial.legendre.leggauss(12)
    node, weight = (node + 1) / 2, weight / 2
    works = {}
    for kind in ("last_disc", "volume"):
        model = dtc.build(seed, chart="planar", inflation=kind)
        total, corners = 0.0, [(0, 0), (a, 0), (a, b), (0, b), (0, 0)]
        for start, end in zip(corners, corners[1:], strict=False):
            way = np.subtract(end, start)
            path = np.array(start)[:, None] + np.outer(way, node)
            total += float(way @ np.array(model.inflation(path, p, model.theta0)) @ weight)
        works[kind] = total
    assert works["last_disc"] == pytest.approx(-p * area * a * np.sin(b), rel=1e-12)
    assert abs(works["volume"]) < 1e-13 * p * area


def test_straight_robots_feel_both_alike(rng):
    """At the straight pose the two are equal; they part at first order in bending."""
    seed = seed_robot(4)
    chambers = (dtc.Chamber((1, 2)), dtc.Chamber((2, 4)), dtc.Chamber((1, 4)))
    charts = ("cardan",) * 3
    stiffened = [replace(c, radial_compliance=0.01) for c in chambers]
    for parts in (chambers, stiffened):
        both = [
            dtc.build(replace(seed, chambers=parts), inflation=kind)
            for kind in ("volume", "last_disc")
        ]
        pressure = rng.uniform(1.0, 5.0, 3)
        straight = np.zeros(both[0].n_q)
        volume, last = (numbers(m.inflation, straight, pressure, m.theta0) for m in both)
        assert error(volume, last) < 1e-14 and np.max(np.abs(last)) > 1
        direction, _, _ = state(rng, charts)
        gaps = []
        for size in (1e-3, 1e-4):
            volume, last = (
                numbers(m.inflation, size * direction, pressure, m.theta0) for m in both
            )
            gaps.append(np.max(np.abs(volume - last)) / size)
        assert gaps[1] == pytest.approx(gaps[0], rel=0.01) and gaps[1] > 0.1


def test_chambers_in_series_share_their_disc(rng):
    """At one pressure two of them are one; straight, the shared disc feels the difference."""
    seed = seed_robot(4)
    parts = (dtc.Chamber((1, 3)), dtc.Chamber((3, 4)))
    series = dtc.build(replace(seed, chambers=parts), inflation="volume")
    one = dtc.build(seed, inflation="volume")
    q, _, _ = state(rng, ("cardan",) * 3)
    Q = numbers(series.inflation, q, [7.0, 7.0], series.theta0)
    assert error(Q, numbers(one.inflation, q, [7.0], one.theta0)) < ROUND_OFF
    # (p1 - p2) A z on disc 3 and p2 A z on disc 4.
    straight = np.zeros(series.n_q)
    Q = numbers(series.inflation, straight, [7.0, 5.0], series.theta0)
    shared = replace(
        seed,
        chambers=(),
        forces=(
            dtc.FollowerLoad(
                3, (7.0 - 5.0) * seed.discs[2].area, (0, 0, 1), seed.discs[2].centroid
            ),
            dtc.FollowerLoad(4, 5.0 * seed.discs[3].area, (0, 0, 1), seed.discs[3].centroid),
        ),
    )
    loads = dtc.build(shared)
    assert error(Q, numbers(loads.forces, straight, straight, loads.theta0)) < ROUND_OFF


@pytest.mark.parametrize(
    "options",
    [
        {"chart": ["cardan", "paper"]},
        {"chart": ["cardan", "paper"], "assembly": "graph"},
        {"chart": "planar", "actuator": "regulator"},
    ],
    ids=["flat", "graph", "planar_regulator"],
)
def test_derivatives_are_exact(rng, options):
    """With radial compliance, by which the force is not proportional to the pressure."""
    model = dtc.build(
        robot(3, 0.03),
        inflation="volume",
        parameters=["chambers.areas", "chambers[2].radial_compliance"],
        **options,
    )
    x = 0.5 * rng.normal(size=model.n_x)
    x[2 * model.n_q :] = 3.0  # inside the regulator's limits
    arguments = x, rng.uniform(2.0, 4.0, model.n_u), model.theta0
    xdot, *value = numbers(model.ode_jacobian, *arguments)
    for mine, reference in zip(value, exact(model.ode, arguments, 2), strict=True):
        assert error(mine, reference.reshape(mine.shape)) < 1e-9  # cond(M), up to 1e4 here
    q, qd = x[: model.n_q], x[model.n_q : 2 * model.n_q]
    arguments = q, qd, xdot[model.n_q : 2 * model.n_q], *arguments[1:]
    value = numbers(model.inverse_dynamics_jacobian, *arguments)
    for mine, reference in zip(value, exact(model.inverse_dynamics, arguments, 2), strict=True):
        assert error(mine, reference) < 1e-11


def test_energy_of_robot_and_air_is_conserved():
    """Undamped at constant pressure T + V - p volume stays; so does the balance of the run."""
    seed = replace(seed_robot(4), damping=dtc.Damping())
    model = dtc.build(seed, chart="planar", inflation="volume")
    x0 = np.concatenate([[0.1, 0.2, 0.3, 0.1, 0.2, 0.1], np.zeros(6)])
    accuracy = {"rtol": 1e-10, "atol": 1e-12, "method": "dopri5"}
    run = dtc.simulate(model, x0, pressure=12.0, t_end=1.0, **accuracy)
    assert run.success, run.message
    at = np.searchsorted(run.t, run.energy["t"])
    V = np.array(model.volume(run.q[:, at], 12.0, model.theta0)).ravel()
    total = run.energy["kinetic"] + run.energy["potential"] - 12.0 * V
    assert np.ptp(12.0 * V) > 1
    assert np.ptp(total) < 1e-8 * np.ptp(run.energy["kinetic"])  # rtol over some 100 steps
    assert np.max(np.abs(run.energy["residual"])) < 1e-8 * np.ptp(run.energy["kinetic"])


def test_free_areas_of_zero_have_finite_slopes():
    seed = seed_robot(3)
    model = dtc.build(
        replace(seed, chambers=(dtc.Chamber((1, 3), np.zeros(3)),)),
        inflation="volume",
        parameters=["chambers.areas"],
    )
    theta = ca.SX.sym("theta", len(model.theta0))
    slope = ca.jacobian(model.volume(0.1 * np.ones(model.n_q), 1.0, theta), theta)
    assert np.all(np.isfinite(numbers(ca.Function("slope", [theta], [slope]), model.theta0)))


def test_other_numbers_of_a_chamber_by_theta(rng):
    """Areas and compliance at other values are the robot that has them."""
    first, second = robot(3), robot(3, 0.05)
    grown = [replace(c, areas=1.5 * np.array(c.areas)) for c in second.chambers]
    second = replace(second, chambers=grown)
    paths = ("chambers.areas", "chambers.radial_compliance")
    models = [dtc.build(r, parameters=paths, inflation="volume") for r in (first, second)]
    q, _, _ = state(rng, ("cardan",) * 2)
    pressure = rng.uniform(1.0, 5.0, models[0].n_u)
    plain = dtc.build(second, inflation="volume")
    value = numbers(models[0].inflation, q, pressure, models[1].theta0)
    assert error(value, numbers(plain.inflation, q, pressure, plain.theta0)) < ROUND_OFF
