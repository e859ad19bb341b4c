"""Tests of the shapes of discs: dtcasadi.robot.Disc, dtcasadi.polygon and dtcasadi.presets."""

import math

import numpy as np
import pytest

from dtcasadi.presets import rim, seed_four_disc
from dtcasadi.robot import Disc


def fan_moments(corners: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Area, centroid, inertia per unit mass about it of a convex polygon, triangle by triangle.

    A uniform triangle has the moments of a third of its mass at each edge's midpoint.
    """
    area, first, second = 0.0, np.zeros(2), np.zeros((2, 2))
    a = corners[0]
    for b, c in zip(corners[1:-1], corners[2:], strict=True):
        (ux, uy), (vx, vy) = b - a, c - a
        share = (ux * vy - uy * vx) / 2
        area += share
        for midpoint in ((a + b) / 2, (b + c) / 2, (c + a) / 2):
            first = first + share / 3 * midpoint
            second = second + share / 3 * np.outer(midpoint, midpoint)
    centroid = first / area
    mean = second / area - np.outer(centroid, centroid)
    inertia = np.zeros((3, 3))
    inertia[:2, :2] = np.trace(mean) * np.eye(2) - mean
    inertia[2, 2] = np.trace(mean)
    return area, centroid, inertia


@pytest.mark.parametrize(("make", "rings"), [(Disc.hoop, [1.0]), (Disc.solid, None)])
def test_round_discs_against_the_integral_over_their_mass(make, rings):
    mass, radius = 3.0, 0.7
    disc = make(mass, radius)
    # Gauss-Legendre in r^2 and equal angles integrate these polynomials exactly.
    nodes, weights = np.polynomial.legendre.leggauss(4)
    if rings is None:
        rings, weights = np.sqrt((nodes + 1) / 2), weights / 2
    else:
        weights = np.ones(1)
    angles = np.arange(12) * 2 * np.pi / 12
    tensor = np.zeros((3, 3))
    for ring, weight in zip(rings, weights, strict=True):
        for angle in angles:
            p = radius * ring * np.array([math.cos(angle), math.sin(angle), 0.0])
            tensor += mass * weight / 12 * (p @ p * np.eye(3) - np.outer(p, p))
    np.testing.assert_allclose(disc.inertia, tensor, atol=1e-15)
    assert disc.centre_of_mass.tolist() == disc.centroid.tolist() == [0.0, radius, 0.0]
    assert disc.area == pytest.approx(math.pi * radius**2, rel=1e-15)
    distance = np.linalg.norm(disc.outline - disc.centroid, axis=1)
    np.testing.assert_allclose(distance, radius, rtol=1e-15)
    np.testing.assert_allclose(disc.outline[0], 0.0, atol=1e-16)  # where the thread joins


def test_a_rectangle_has_the_textbook_moments():
    a, b, mass = 2.0, 0.5, 3.0
    plate = Disc.polygon(mass, [[1, 1], [1 + a, 1], [1 + a, 1 + b], [1, 1 + b]])
    moments = mass / 12 * np.array([b * b, a * a, a * a + b * b])
    np.testing.assert_allclose(plate.inertia, np.diag(moments), atol=1e-15)
    np.testing.assert_allclose(plate.centroid, [2.0, 1.25, 0.0], rtol=1e-15)
    assert plate.area == pytest.approx(a * b, rel=1e-15)
    assert np.array_equal(plate.centre_of_mass, plate.centroid)


def test_convex_polygons_against_the_sum_of_their_triangles(rng):
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 9)))
        stretch, shift = np.diag(rng.uniform(0.2, 2.0, 2)), rng.normal(size=2)
        corners = np.column_stack([np.cos(angles), np.sin(angles)]) @ stretch + shift
        mass = rng.uniform(0.1, 5.0)
        area, centroid, inertia = fan_moments(corners)
        if area < 0.05:
            continue
        for order in (corners, corners[::-1], np.roll(corners, 2, axis=0)):
            plate = Disc.polygon(mass, order)
            assert plate.area == pytest.approx(area, rel=1e-12)
            np.testing.assert_allclose(plate.centroid[:2], centroid, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(plate.inertia, mass * inertia, atol=1e-12 * mass)


def test_a_plate_that_is_not_convex_is_the_sum_of_its_parts():
    corners = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]]
    parts = [[[0, 0], [2, 0], [2, 1], [0, 1]], [[0, 1], [1, 1], [1, 3], [0, 3]]]
    whole = Disc.polygon(4.0, corners)
    tensor = np.zeros((3, 3))
    for part in parts:
        plate = Disc.polygon(2.0, part)  # both have the area 2
        d = plate.centroid - whole.centroid
        tensor += plate.inertia + 2.0 * (d @ d * np.eye(3) - np.outer(d, d))
    np.testing.assert_allclose(whole.inertia, tensor, rtol=1e-14, atol=1e-15)


def test_a_regular_polygon_tends_to_the_solid_disc():
    corners = [rim(0.3, angle)[:2] for angle in np.linspace(0, 2 * np.pi, 721)[:-1]]
    plate, disc = Disc.polygon(2.0, corners), Disc.solid(2.0, 0.3)
    np.testing.assert_allclose(plate.inertia, disc.inertia, rtol=1e-4, atol=1e-16)
    assert plate.area == pytest.approx(disc.area, rel=1e-4)


def test_a_small_plate_far_away_loses_no_digits():
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]) * 2.0**-10
    near, far = Disc.polygon(1.0, corners), Disc.polygon(1.0, corners + 2.0**10)
    np.testing.assert_allclose(far.inertia, near.inertia, rtol=1e-12, atol=1e-20)


def test_rim_points_run_counterclockwise_from_the_thread():
    points = [rim(2.0, math.radians(angle)) for angle in (0, 90, 180, 270, 360)]
    expected = [[0, 0, 0], [2, 2, 0], [0, 4, 0], [-2, 2, 0], [0, 0, 0]]
    assert np.array_equal(points, expected)  # exactly: a symmetric robot must stay symmetric
    assert rim(2.0, math.radians(30)) == pytest.approx([1.0, 2 - math.sqrt(3), 0.0])
    np.testing.assert_allclose(Disc.hoop(1.0, 2.0).outline[5], rim(2.0, 2 * math.pi * 5 / 32))


def test_the_papers_robot_is_straight_and_without_force_at_rest():
    made = seed_four_disc()
    assert [disc.mass for disc in made.discs] == [2.0, 2.0, 2.0, 4.0]
    assert made.length == 3.0 and made.gravity == 9.81
    assert made.up.tolist() == [0.0, -1.0, 0.0]
    assert seed_four_disc(up=(0, 1, 0)).up.tolist() == [0.0, 1.0, 0.0]
    assert [spring.discs for spring in made.springs] == [(1, 2)] * 3 + [(2, 3)] * 3 + [(3, 4)] * 3
    assert {spring.rest_length for spring in made.springs} == {1.0}
    assert [chamber.discs for chamber in made.chambers] == [(1, 4)]
    np.testing.assert_allclose(made.discs[3].inertia, np.diag([2.0, 2.0, 4.0]))
