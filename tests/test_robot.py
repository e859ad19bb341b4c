"""Tests of dtcasadi.robot: what it refuses, what it fills in."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays, and wrong types are the subject.

import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dtcasadi.errors import DtcasadiError, RobotError
from dtcasadi.presets import seed_four_disc
from dtcasadi.robot import Chamber, Damping, Disc, Robot, Spring, Thread

HOOP = Disc.hoop(2.0, 1.0)
I3 = np.eye(3)
BAD_NUMBERS = [math.nan, math.inf, -math.inf, 1e31, 10**400, 1j, True, np.True_, "1", None, [1.0]]


def robot(**changes) -> Robot:
    """Three discs, changed."""
    fields = {"discs": [HOOP] * 3, "threads": [Thread(1.0)] * 2} | changes
    return Robot(**fields)


def turn(axis: int, angle: float) -> np.ndarray:
    """Rotation about a coordinate axis, shape (3, 3)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = math.cos(angle)
    matrix[j, i], matrix[i, j] = math.sin(angle), -math.sin(angle)
    return matrix


# ---- what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Disc.hoop(-1, 1), "mass: expected a finite positive number, got -1"),
        (lambda: Disc.hoop(1, 0), "radius: expected a finite positive number, got 0"),
        (lambda: Disc.solid(1, 1e-31), "radius: expected a finite positive number from 1e-30 to"),
        (lambda: Disc.solid(1, 1e200), "radius: expected a finite positive number from 1e-30 to"),
        (lambda: Disc(0, I3), "mass: expected a finite positive number, got 0"),
        (lambda: Disc(1, np.eye(2)), "inertia: expected finite numbers of shape (3, 3), got shape"),
        (lambda: Disc(1, np.zeros((3, 3))), "inertia: expected positive principal moments, each"),
        (lambda: Disc(1, np.diag([1, 1, 2.1])), "inertia: expected positive principal moments, ea"),
        (lambda: Disc(1, np.diag([1, 1, -1.0])), "inertia: expected positive principal moments"),
        (lambda: Disc(1, I3 + np.eye(3, k=1)), "inertia: expected a symmetric tensor, got [["),
        (lambda: Disc(1, I3 * math.nan), "inertia: expected finite numbers of shape (3, 3), got"),
        (lambda: Disc(1, I3, centre_of_mass=[0, 1]), "centre_of_mass: expected finite numbers of "),
        (lambda: Disc(1, I3, area=-1), "area: expected a finite non-negative number, got -1"),
        (lambda: Disc(1, I3, centroid="xyz"), "centroid: expected finite numbers of shape (3), go"),
        (lambda: Disc(1, I3, outline=[[0, 0]]), "outline: expected finite numbers of shape (n, 3)"),
        (lambda: Disc.polygon(1, [[0, 0], [1, 0]]), "vertices: expected at least 3 corners, got 2"),
        (
            lambda: Disc.polygon(1, [[0, 0], [1, 1], [2, 2]]),
            "vertices: expected corners that enclose an area, got [[0.0, 0.0], [1.0, 1.0], [2.0,",
        ),
        (
            lambda: Disc.polygon(1, [[0, 0], [2, 2], [2, 0], [0, 3]]),
            "vertices: expected edges that do not cross, got [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0]",
        ),
        (lambda: Disc.polygon(1, [[1e-200, 0], [0, 1e-200], [0, 0]]), "vertices: expected corners"),
        (lambda: Thread(0.0), "length: expected a finite positive number, got 0.0"),
        (lambda: Thread(math.nan), "length: expected a finite positive number, got nan"),
        (lambda: Thread(1, exit_point=[0, 0]), "exit_point: expected finite numbers of shape (3)"),
        (lambda: Thread(1, bend=2 * I3), "bend: expected a rotation matrix (R^T R = 1, det R = 1)"),
        (lambda: Thread(1, twist=-I3), "twist: expected a rotation matrix (R^T R = 1, det R = 1)"),
        (lambda: Spring((1, 3), [0] * 3, [0] * 3, 1), "discs: expected neighbours (i, i + 1), got"),
        (lambda: Spring((2, 1), [0] * 3, [0] * 3, 1), "discs: expected neighbours (i, i + 1), got"),
        (lambda: Spring((0, 1), [0] * 3, [0] * 3, 1), "discs: expected an integer from 1 to"),
        (lambda: Spring((1.0, 2.0), [0] * 3, [0] * 3, 1), "discs: expected an integer from 1 to"),
        (
            lambda: Spring(1, [0] * 3, [0] * 3, 1),
            "discs: expected two neighbouring disc numbers, g",
        ),
        (lambda: Spring((1, 2), [0], [0] * 3, 1), "start: expected finite numbers of shape (3), g"),
        (lambda: Spring((1, 2), [0] * 3, [0, 0, math.inf], 1), "end: expected finite numbers of "),
        (lambda: Spring((1, 2), [0] * 3, [0] * 3, -1), "stiffness: expected a finite non-negative"),
        (lambda: Spring((1, 2), [0] * 3, [0] * 3, 1, -1), "rest_length: expected a finite non-neg"),
        (lambda: Spring((1, 2), [0] * 3, [0] * 3, 1, 1, -1), "damping: expected a finite non-nega"),
        (lambda: Chamber((2, 2)), "discs: expected first < last, got (2, 2)"),
        (lambda: Chamber((1,)), "discs: expected the first and last disc number, got (1,)"),
        (lambda: Chamber((1, 2), areas=[1, -1]), "areas: expected non-negative numbers, got [1.0"),
        (lambda: Chamber((1, 2), areas=[1]), "areas: expected finite numbers of shape (2), got s"),
        (lambda: Chamber((1, 2), centroids=[[0, 0, 0]]), "centroids: expected finite numbers of s"),
        (lambda: Damping(c_w=-1), "c_w: expected a finite non-negative number, got -1"),
        (lambda: robot(discs=[HOOP]), "discs: expected at least 2 discs, the root included, got 1"),
        (lambda: robot(discs=HOOP), "discs: expected a sequence of Disc, got Disc("),
        (lambda: robot(discs=[HOOP, 3, HOOP]), "discs[2]: expected a Disc, got 3"),
        (lambda: robot(threads=[Thread(1)]), "threads: expected 2 threads for 3 discs, got 1"),
        (lambda: robot(damping=[Damping()]), "damping: expected one Damping, or 2, got 1"),
        (lambda: robot(up=[0, 0, 0]), "up: expected a direction (3 numbers, not all zero), got ["),
        (lambda: robot(up=[0, math.nan, 0]), "up: expected finite numbers of shape (3), got [0, "),
        (lambda: robot(gravity=-9.81), "gravity: expected a finite non-negative number, got -9.81"),
        (
            lambda: robot(springs=[Spring((3, 4), [0] * 3, [0] * 3, 1)]),
            "springs[1].discs: expected discs from 1 to 3, got (3, 4)",
        ),
        (
            lambda: robot(chambers=[Chamber((1, 2)), Chamber((1, 4))]),
            "chambers[2].discs: expected discs from 1 to 3, got (1, 4)",
        ),
        (
            lambda: robot(springs=[Spring((1, 2), [1e30, 0, 0], [-1e30, 0, 0], 1)]),
            "springs[1].rest_length: expected a finite non-negative number up to 1e+30, got 2e+30",
        ),
    ],
)
def test_errors_name_field_expectation_and_gift(make, message):
    with pytest.raises(RobotError) as caught:
        make()
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value) and isinstance(caught.value, DtcasadiError)


@pytest.mark.parametrize("value", BAD_NUMBERS, ids=lambda v: type(v).__name__)
@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("mass", lambda v: Disc.hoop(v, 1.0)),
        ("radius", lambda v: Disc.solid(1.0, v)),
        ("area", lambda v: Disc(1.0, I3, area=v)),
        ("length", lambda v: Thread(v)),
        ("stiffness", lambda v: Spring((1, 2), [0] * 3, [0] * 3, v)),
        ("c_r", lambda v: Damping(c_r=v)),
        ("gravity", lambda v: robot(gravity=v)),
        ("exit_point", lambda v: Thread(1.0, exit_point=[0.0, v, 0.0])),
        ("up", lambda v: robot(up=[0.0, v, 1.0])),
    ],
)
def test_what_is_no_number_is_refused_by_name(field, make, value):
    with pytest.raises(RobotError) as caught:
        make(value)
    assert caught.value.field == field


# ---- what is filled in ---------------------------------------------------------------------------


def test_a_rest_length_is_the_distance_in_the_rest_pose(rng):
    bend, twist = turn(0, 0.3) @ turn(1, -0.2), turn(2, 0.7) @ turn(0, 0.1)
    exit_point, start, end = rng.normal(size=(3, 3))
    thread = Thread(0.8, exit_point, bend, twist)
    made = robot(
        threads=[Thread(1.0), thread],
        springs=[Spring((2, 3), start, end, 5.0), Spring((2, 3), start, end, 5.0, rest_length=0.1)],
    )
    disc_origin = exit_point + bend @ [0, 0, 0.8]
    distance = np.linalg.norm(disc_origin + bend @ twist @ end - start)
    assert made.springs[0].rest_length == pytest.approx(distance, rel=1e-15)
    assert made.springs[1].rest_length == 0.1


def test_a_chamber_takes_what_it_lacks_from_its_discs():
    discs = [Disc.hoop(1.0, radius) for radius in (1.0, 2.0, 3.0)]
    whole, own = robot(
        discs=discs, chambers=[Chamber((1, 3)), Chamber((2, 3), areas=[4.0, 5.0])]
    ).chambers
    assert whole.areas.tolist() == [disc.area for disc in discs]
    assert np.array_equal(whole.centroids, [disc.centroid for disc in discs])
    assert own.areas.tolist() == [4.0, 5.0]
    assert np.array_equal(own.centroids, [disc.centroid for disc in discs[1:]])


def test_up_is_stored_as_a_unit_vector_and_damping_for_each_segment():
    made = robot(up=[0, -3, 4], damping=Damping(c_a=2.0))
    np.testing.assert_allclose(made.up, [0, -0.6, 0.8], rtol=1e-15)
    assert [damping.c_a for damping in made.damping] == [2.0, 2.0]
    assert made.n_discs == 3 and made.length == 2.0


def test_a_tensor_is_made_symmetric_to_the_last_bit():
    tensor = np.diag([1.0, 1.0, 1.5])
    tensor[0, 1] = 1e-12
    inertia = Disc(1.0, tensor).inertia
    assert np.array_equal(inertia, inertia.T)


def test_nothing_can_be_changed_and_nothing_is_shared_with_the_caller():
    tensor = np.eye(3)
    disc = Disc(1.0, tensor)
    tensor[0, 0] = 99.0
    assert disc.inertia[0, 0] == 1.0
    made = seed_four_disc()
    for part in (made, *made.discs, *made.threads, *made.springs, *made.chambers, *made.damping):
        for field in dataclasses.fields(part):
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(part, field.name, None)
            value = getattr(part, field.name)
            if isinstance(value, np.ndarray):
                with pytest.raises(ValueError, match="read-only"):
                    value[...] = 0.0


def test_an_error_survives_the_way_back_from_a_worker_process():
    error = RobotError("discs[2].mass", "a finite positive number", -1)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.field) == (str(error), error.field)


# ---- properties ----------------------------------------------------------------------------------

lengths = st.floats(1e-3, 1e3)
numbers = st.floats(-1e3, 1e3)
points = st.tuples(numbers, numbers, numbers)
derandomized = settings(derandomize=True, max_examples=60, deadline=None)


@st.composite
def bodies(draw) -> Disc:
    """A disc whose tensor is that of some cloud of points."""
    cloud = np.array(draw(st.lists(points, min_size=4, max_size=6)))
    cloud = (
        cloud - cloud.mean(axis=0) + 1e-3 * np.vstack([np.eye(3), np.zeros((len(cloud) - 3, 3))])
    )
    tensor = sum(p @ p * np.eye(3) - np.outer(p, p) for p in cloud)
    scale = float(np.abs(tensor).max())
    tensor = tensor + 1e-3 * scale * np.eye(3)  # safely positive definite
    return Disc(draw(lengths), tensor, draw(points), draw(lengths), draw(points))


@derandomized
@given(st.lists(bodies(), min_size=2, max_size=4), st.data())
def test_random_robots_are_accepted_and_complete(discs, data):
    n = len(discs)
    threads = [Thread(data.draw(lengths), data.draw(points)) for _ in range(n - 1)]
    pairs = data.draw(st.lists(st.integers(1, n - 1), max_size=4))
    springs = [
        Spring((i, i + 1), data.draw(points), data.draw(points), data.draw(lengths)) for i in pairs
    ]
    made = Robot(discs, threads, springs, [Chamber((1, n))])
    assert made.n_discs == n == len(made.damping) + 1
    assert all(spring.rest_length >= 0 for spring in made.springs)
    for disc in made.discs:
        moments = np.linalg.eigvalsh(disc.inertia)
        assert moments[0] > 0 and moments[2] <= (moments[0] + moments[1]) * (1 + 1e-9)


@derandomized
@given(
    bodies(), st.sampled_from(["mass", "inertia", "centre_of_mass", "centroid", "area"]), st.data()
)
def test_a_spoiled_field_is_refused_by_its_name(disc, field, data):
    spoilt = np.array(getattr(disc, field), dtype=float)
    wrong = data.draw(st.sampled_from([math.nan, math.inf, -math.inf]))
    spoilt.flat[data.draw(st.integers(0, spoilt.size - 1))] = wrong
    value = spoilt if spoilt.ndim else float(spoilt)
    with pytest.raises(RobotError) as caught:
        dataclasses.replace(disc, **{field: value})
    assert caught.value.field == field


@derandomized
@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists, max_leaves=8))
def test_any_value_gives_a_disc_or_a_robot_error(value):
    for make in (
        lambda: Disc(value, I3),
        lambda: Disc(1.0, value),
        lambda: Disc.hoop(1.0, value),
        lambda: Disc.polygon(1.0, value),
        lambda: Thread(1.0, value),
        lambda: Spring(value, [0] * 3, [0] * 3, 1.0),
        lambda: Chamber((1, 2), value),
        lambda: robot(threads=value),
        lambda: robot(up=value),
    ):
        try:
            make()
        except RobotError as error:
            assert "\n" not in str(error)
