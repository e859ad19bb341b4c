"""Robots from tubes and rods: segments, rest shape, mass, symmetry, pressure."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

import math

import numpy as np
import pytest
from oracles.cases import numbers
from scipy.linalg import expm
from tubes import EI, GA, GJ, NU, RHO, SHAPES, E, L, R, T, centres, hessian, tube

import dtcasadi as dtc
from dtcasadi.parts import Chamber
from dtcasadi.robot import Robot
from dtcasadi.rod import Cell


def energy(K: np.ndarray, length: float, bend=(0, 0), shear=(0, 0), twist=0.0) -> float:
    """q^T K q of one segment: the thread leans by half the bend plus the shear, the disc back."""
    half = np.array(bend) / 2
    lean, back = half + np.array(shear), half - np.array(shear)
    q = np.array([*lean, *back, twist])
    return float(q @ K @ q)


# ---- one segment ---------------------------------------------------------------------------------


@pytest.mark.parametrize("aspect", [0.5, 5.0, 20.0])
@pytest.mark.parametrize("posts", [4, 6])
@pytest.mark.parametrize("fabric", ["strip", "axis"])
def test_a_segment_stores_the_tubes_energy(fabric, posts, aspect):
    length = aspect * R
    made = Robot.from_tube(length, R, T, E, NU, RHO, 2, fabric, posts=posts, gravity=0.0)
    K = hessian(made)
    about_fabric = 3 * EI if fabric == "strip" else EI
    near = {"rel": 1e-9}  # round-off of springs that cancel
    assert energy(K, length, bend=(1, 0)) == pytest.approx(about_fabric / length, **near)
    assert energy(K, length, bend=(0, 1)) == pytest.approx(EI / length, **near)
    assert energy(K, length, shear=(1, 0)) == pytest.approx(GA * length, **near)
    assert energy(K, length, shear=(0, 1)) == pytest.approx(GA * length, **near)
    # Twist about the section's centre: with the thread on the wall that leans the thread along.
    slide = (0.0, R / length) if fabric == "strip" else (0.0, 0.0)
    assert energy(K, length, shear=slide, twist=1.0) == pytest.approx(GJ / length, **near)


@pytest.mark.parametrize("shear_over_bending", [1e1, 1e4, 1e8])
def test_a_segment_stores_the_rods_energy(shear_over_bending):
    length, bending, torsion = 0.4, 2.0, 1.5
    shear = shear_over_bending * bending / length**2
    K = hessian(Robot.from_rod(length, bending, shear, torsion, 1.0, 2, gravity=0.0))
    # The stiffest diagonals leave their round-off in the rest: 1e-16 * GA l / c, see `rod`.
    near = {"rel": 1e-13 * shear_over_bending + 1e-10}
    for axis in np.eye(2):
        assert energy(K, length, bend=axis) == pytest.approx(bending / length, **near)
        assert energy(K, length, shear=axis) == pytest.approx(shear * length, **near)
    assert energy(K, length, twist=1.0) == pytest.approx(torsion / length, **near)


@pytest.mark.parametrize(
    ("made", "coefficients"),
    [
        (tube(4, fabric="axis"), (EI, EI)),
        (Robot.from_rod(L, 1.0, 1e6, 0.5, 1.0, 2, gravity=0.0), (1.0, 1.0)),
        (tube(5), (3 * EI, None)),
    ],
    ids=["axis", "rod", "strip"],
)
def test_the_moment_is_linear_in_a_large_bend(made, coefficients):
    """Posts from disc to disc would give sin(w): 1.5 % less at 0.3 rad."""
    model = dtc.build(made)
    length = made.length / (made.n_discs - 1)
    for axis, stiffness in enumerate(coefficients):
        if stiffness is None:
            continue
        q = np.zeros(model.n_q)
        for bend in (-0.3, 0.3):
            q[axis::5] = q[axis + 2 :: 5] = bend / 2
            force = numbers(model.spring, q, model.theta0)
            moment = (force[axis] + force[axis + 2]) / 2
            assert moment == pytest.approx(stiffness * bend / length, rel=8e-3)


# ---- rest shape, mass, symmetry ------------------------------------------------------------------


@pytest.mark.parametrize("fabric", ["strip", "axis"])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_rest_shape_is_a_helix_whatever_the_number_of_discs(fabric, shape):
    bend, twist = SHAPES[shape]
    (x, y), z = bend, twist
    rates = np.array([[0, -z, y, 0], [z, 0, -x, 0], [-y, x, 0, L], [0, 0, 0, 0]])
    for n_discs in (2, 3, 6):
        found = centres(tube(n_discs, fabric=fabric, bend=bend, twist=twist))
        for point, share in zip(found, np.linspace(0, 1, n_discs), strict=True):
            exact = expm(rates * share)[:3, 3] + found[0]
            assert point == pytest.approx(exact, abs=1e-15)


def test_springs_are_without_force_at_rest():
    made = tube(5, bend=(0.7, 0.5), twist=1.5)
    model = dtc.build(made)
    force = numbers(model.spring, np.zeros(model.n_q), model.theta0)
    assert np.max(np.abs(force)) < 1e-12 * E * R**3


@pytest.mark.parametrize("n_discs", [2, 5, 8])
def test_mass_is_all_there_and_in_its_place(n_discs):
    made = tube(n_discs, payload=0.25)
    masses = np.array([disc.mass for disc in made.discs])
    whole = 2 * math.pi * R * T * RHO * L
    assert masses.sum() == pytest.approx(whole + 0.25)
    masses[-1] -= 0.25
    assert masses[0] == pytest.approx(whole / (n_discs - 1) / 2)
    assert masses @ np.linspace(0, L, n_discs) == pytest.approx(whole * L / 2)
    for disc, mass in zip(made.discs, masses, strict=True):
        assert disc.inertia == pytest.approx(mass * R**2 * np.diag([0.5, 0.5, 1.0]))


def test_a_strip_tube_is_symmetric_about_its_plane():
    """Planar motion stays planar, with the planar chart's stiffness."""
    made = tube(4, bend=0.6)
    flat = hessian(made, "planar")
    full = hessian(made)
    in_plane = [5 * i + k for i in range(3) for k in (0, 2)]
    aside = [k for k in range(15) if k not in in_plane]
    assert full[np.ix_(in_plane, in_plane)] == pytest.approx(flat, rel=1e-9)
    assert np.max(np.abs(full[np.ix_(in_plane, aside)])) < 1e-12 * np.max(np.abs(full))
    model = dtc.build(made)
    q = np.zeros(15)
    q[in_plane] = np.random.default_rng(1).uniform(-0.3, 0.3, 6)
    force = numbers(model.spring, q, model.theta0)
    assert np.max(np.abs(force[aside])) < 1e-12 * np.max(np.abs(force))


def test_viscosity_is_proportional_to_stiffness():
    made = tube(4, retardation_time=0.03, fabric="axis")
    model = dtc.build(made)
    still = np.zeros(15)
    blocks = numbers(
        model.inverse_dynamics_jacobian, still, still, still, np.zeros(1), model.theta0
    )
    assert blocks[1] == pytest.approx(0.03 * blocks[0], abs=1e-12 * np.max(np.abs(blocks[0])))


# So low that `last_disc`, which parts from the pressure on the walls at first order in bending, is
# as good.
PRESSURE = 0.5


# ---- pressure ------------------------------------------------------------------------------------


def rest_under(robot: Robot, pressure: np.ndarray, chart: str = "planar") -> np.ndarray:
    """Coordinates of the equilibrium near rest, by Newton's method with the springs' slope."""
    model, slope = dtc.build(robot, chart=chart), hessian(robot, chart)
    q = still = np.zeros(model.n_q)
    for _ in range(6):
        force = numbers(model.inverse_dynamics, q, still, still, pressure, model.theta0)
        q = q - np.linalg.solve(slope, force)
    return q


@pytest.mark.parametrize("n_discs", [2, 4, 8])
def test_pressure_bends_a_strip_tube_into_an_arc(n_discs):
    """Curvature p / (3 E t): the moment p pi r^2 r over 3 pi E r^3 t, whatever the discs."""
    q = rest_under(tube(n_discs), np.array([PRESSURE]))
    angle = PRESSURE * L / (3 * E * T)
    # The last disc's force has a lever that grows by angle * L / 2: 4e-4 of R.
    assert q == pytest.approx(np.full(len(q), angle / len(q)), rel=1e-3)


def test_chambers_in_series_and_strips_set_round():
    """Each chamber bends its own part, to its own strip's side; the straight tube stays straight.

    Strips at -y, then 90 degrees on at +x, then 180 more at -x: bends about x, y and -y.
    """
    made = tube(7, chambers=3, strip_turns=(math.pi / 2, math.pi))
    assert [chamber.discs for chamber in made.chambers] == [(1, 3), (3, 5), (5, 7)]
    assert centres(made) == pytest.approx(np.outer(np.linspace(0, L, 7), [0, 0, 1]) + [0, R, 0])
    for k, (axis, sign) in enumerate(((0, 1), (1, 1), (1, -1))):
        q = rest_under(made, PRESSURE * np.eye(3)[k], "cardan").reshape(6, 5)
        angle = PRESSURE * L / (3 * E * T) / 12
        q[2 * k : 2 * k + 2, [axis, axis + 2]] -= sign * angle
        assert np.max(np.abs(q)) < 1e-3 * angle
    # Unequal numbers of segments: still equal chambers.
    made = tube(9, chambers=3)
    lengths = [thread.length for thread in made.threads]
    assert sum(lengths[:3]) == sum(lengths[3:6]) == pytest.approx(sum(lengths[6:]))


def test_cells_beside_a_rods_axis_turn_its_end():
    pair = (Cell(1e-3, (0.0, 0.04)), Cell(1e-3, (0.0, -0.04)))
    made = Robot.from_rod(L, 2.0, 1e5, 1.0, 1.0, 5, cells=pair, gravity=0.0)
    assert isinstance(made.chambers[0], Chamber) and made.chambers[0].discs == (1, 5)
    angles = [rest_under(made, p).sum() for p in np.diag([5.0, 5.0])]
    # Moment p A y over EI / L; the force's lever grows by 1e-4 of y.
    assert angles == pytest.approx([3e-5, -3e-5], rel=1e-3)
