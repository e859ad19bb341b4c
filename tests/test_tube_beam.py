"""Robots from tubes against beams curved in space, and similar tubes of all sizes."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

import math
from functools import cache

import numpy as np
import pytest
from oracles.cases import numbers
from scipy.linalg import expm, null_space
from scipy.spatial.transform import Rotation
from tubes import EA, EI, GA, GJ, SHAPES, L, R, hessian, tube

import dtcasadi as dtc
from dtcasadi.robot import Robot
from dtcasadi.tube import Tube

# ---- many segments against a beam curved in space ------------------------------------------------


def section(fabric: str, angles: np.ndarray, length: float) -> np.ndarray:
    """Compliance density for (Gamma, K), shape (6, 6): fabric forbids one combination of them.

    Gamma: strain of the section's centre, K: change of curvature and twist, both in its frame.
    The fabric runs at -R y; its strain is t . (Gamma - K x R y), t its direction at rest.
    """
    offset = np.array([0.0, -R, 0.0]) if fabric == "strip" else np.zeros(3)
    return _with_fabric(np.diag([GA, GA, EA, EI, EI, GJ]), offset, angles / length)


def section_of(tube: Tube, angles: np.ndarray) -> np.ndarray:
    """The same of any tube with a strip."""
    r, t, E, G = tube.radius, tube.wall_thickness, tube.youngs_modulus, tube.shear_modulus
    stretch, bend, shear, twist = 2 * E, E * r**2, G, 2 * G * r**2
    stiffness = math.pi * r * t * np.diag([shear, shear, stretch, bend, bend, twist])
    return _with_fabric(stiffness, np.array([0.0, -r, 0.0]), angles / tube.length)


def _with_fabric(stiffness: np.ndarray, offset: np.ndarray, rates: np.ndarray) -> np.ndarray:
    t = np.array([0.0, 0.0, 1.0]) + np.cross(rates, offset)
    t /= np.linalg.norm(t)
    free = null_space(np.concatenate([t, np.cross(offset, t)])[np.newaxis])
    return free @ np.linalg.inv(free.T @ stiffness @ free) @ free.T


def curved_beam(fabric: str, angles: np.ndarray, length: float = L) -> np.ndarray:
    """Motion (displacement, rotation) of the end's centre per wrench there, both in its frame.

    Bresse's integral over the section compliances (Hodges 2006, Nonlinear Composite Beam Theory,
    section 5), 64 Gauss points.
    """
    x, y, z = angles
    twist = np.array([[0, -z, y, 0], [z, 0, -x, 0], [-y, x, 0, length], [0, 0, 0, 0]], dtype=float)
    density = section(fabric, angles, length)
    total = np.zeros((6, 6))
    for node, weight in zip(*np.polynomial.legendre.leggauss(64), strict=True):
        rest = expm(twist * (1 - node) / 2)  # from the section to the end
        rotation, way = rest[:3, :3], rest[:3, 3]
        # A force and a moment at the end, in the section's frame about its centre.
        lever = np.column_stack([np.cross(way, column) for column in rotation.T])
        carry = np.block([[rotation, np.zeros((3, 3))], [lever, rotation]])
        total += weight / 2 * length * carry.T @ density @ carry
    return total


def compliance(robot: Robot, centre: np.ndarray) -> np.ndarray:
    """The same of the last disc of a robot, its motion by central differences (error 1e-9)."""
    model = dtc.build(robot)

    def end(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation, origin = numbers(model.poses, q, model.theta0)
        return rotation[:, -3:], origin[:, -1] + rotation[:, -3:] @ centre

    rest, step, columns = end(np.zeros(model.n_q))[0], 1e-5, []
    for q in step * np.eye(model.n_q):
        (turned, moved), (turned_back, moved_back) = end(q), end(-q)
        spin = rest.T @ (turned - turned_back)
        motion = [*rest.T @ (moved - moved_back), spin[2, 1], spin[0, 2], spin[1, 0]]
        columns.append(np.array(motion) / (2 * step))
    J = np.column_stack(columns)
    return J @ np.linalg.solve(hessian(robot), J.T)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("fabric", ["strip", "axis"])
def test_compliances_of_tubes_converge_with_order_two(fabric, shape):
    bend, twist = SHAPES[shape]
    exact = curved_beam(fabric, np.array([*bend, twist]))
    # The disc's frame stays with the wall, the section's above goes with the fabric.
    unwound = Rotation.from_rotvec([0.0, 0.0, twist]).as_matrix()
    both = np.kron(np.eye(2), unwound)
    exact = both @ exact @ both.T
    centre = unwound @ [0.0, R if fabric == "strip" else 0.0, 0.0]
    # Metres and radians, newtons and newton metres on one scale.
    scale = np.diag([1 / L] * 3 + [1.0] * 3)
    norm = np.linalg.norm(scale @ exact @ scale)
    errors = []
    for n_discs in (4, 8):
        made = compliance(tube(n_discs, fabric=fabric, bend=bend, twist=twist), centre)
        errors.append(np.linalg.norm(scale @ (made - exact) @ scale) / norm)
    assert errors[-1] < 6e-3
    assert math.log(errors[0] / errors[1], 7 / 3) == pytest.approx(2.0, abs=0.1)


# ---- scale ---------------------------------------------------------------------------------------


@cache
def scaled(size: float, shape: str) -> dtc.Model:
    """Geometrically similar tubes with the same weight over stiffness and damping ratio."""
    bend, twist = SHAPES[shape]
    made = Robot.from_tube(
        *(size, size / 15, size / 150, 4e6 * size, 0.5, 1000.0, 3),
        bend=bend,
        twist=twist,
        payload=0.5 * size**3,
        retardation_time=0.02 * math.sqrt(size),
        up=(0.0, -1.0, 0.0),
    )
    return dtc.build(made)


@pytest.mark.parametrize("shape", ["straight", "bent", "wound", "helix"])
def test_nothing_depends_on_the_scale(shape, rng):
    """From 30 mm to 3 m: forces go with length^4 at equal angles, times with its square root."""
    q, qd, qdd = rng.uniform(-0.2, 0.2, (3, 10))
    found = []
    for size in (0.03, 0.3, 3.0):
        model = scaled(size, shape)
        ports = (q, qd / math.sqrt(size), qdd / size, [3e4 * size], model.theta0)
        found.append(numbers(model.inverse_dynamics, *ports) / size**4)
    for other in found[1:]:
        assert other == pytest.approx(found[0], rel=1e-9, abs=1e-9 * np.max(np.abs(found[0])))


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["straight", "helix"])
def test_motions_of_similar_tubes_are_similar(shape):
    ends = []
    for size in (0.03, 3.0):
        model = scaled(size, shape)
        x0 = np.zeros(model.n_x)
        # Relative and absolute tolerance on angles; the rates differ by the scale of time.
        run = dtc.simulate(
            model, x0, pressure=4e3 * size, t_end=0.5 * math.sqrt(size), rtol=1e-9, atol=1e-10
        )
        assert run.success, run.message
        ends.append(run.poses(np.array([-1]))[1][0, -1] / size)
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)
    assert np.linalg.norm(ends[0] - [0, 0, 1]) > 0.02
