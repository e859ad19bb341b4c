"""Tests of dtcasadi.profile."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays, and wrong types are the subject.

import dataclasses
import pickle

import numpy as np
import pytest

from dtcasadi.errors import ModelError, ProfileError
from dtcasadi.profile import Profile

STEPS = Profile([1.0, 2.0, 3.0, 4.0], [10.0, 20.0, 20.0, 5.0])
RAMPS = Profile([0.0, 1.0, 2.0, 4.0], [[0, 8], [1, 6], [2, 4], [-2, 4]], "linear")


@pytest.mark.parametrize("profile", [STEPS, RAMPS])
def test_the_ends_are_held(profile):
    first, last = profile.times[[0, -1]]
    for t in (first - 1e9, first - 1e-9, first):
        assert np.array_equal(profile(t), profile.values[0])
    for t in (last, last + 1e-9, last + 1e9):
        assert np.array_equal(profile(t), profile.values[-1])


def test_a_step_is_continuous_from_the_right():
    assert STEPS(2.0) == [20.0]
    assert STEPS(np.nextafter(2.0, 0.0)) == [10.0]
    assert STEPS(4.0) == [5.0]


def test_a_linear_profile_interpolates():
    times = np.linspace(-1.0, 5.0, 97)
    for k in range(2):
        expected = np.interp(times, RAMPS.times, RAMPS.values[:, k])
        np.testing.assert_allclose(RAMPS.sample(times)[k], expected, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("profile", [STEPS, RAMPS])
def test_sample_is_the_call_at_each_time(profile):
    times = np.linspace(-1.0, 5.0, 49)
    columns = [profile(t) for t in times]
    assert profile(0.5).shape == (profile.n_u,)
    assert np.array_equal(profile.sample(times), np.column_stack(columns))


def test_breakpoints_are_where_something_changes():
    # At 1 the first value starts to hold, but it held before as well; at 3 nothing changes.
    assert STEPS.breakpoints.tolist() == [2.0, 4.0]
    # At 1 the slopes stay as they are.
    assert RAMPS.breakpoints.tolist() == [0.0, 2.0, 4.0]
    assert Profile([0.0, 1.0], [3.0, 3.0], "linear").breakpoints.size == 0
    assert Profile.constant(3.0).breakpoints.size == 0


def test_a_piece_ends_with_the_value_before_the_step():
    first, second, third = STEPS.pieces(0.0, 5.0)
    assert (first.t_start, first.t_end) == (0.0, 2.0)
    assert (second.t_start, second.t_end) == (2.0, 4.0)
    assert (third.t_start, third.t_end) == (4.0, 5.0)
    assert first(2.0) == [10.0] and second(2.0) == [20.0]
    assert second(4.0) == [20.0] and third(4.0) == [5.0]


@pytest.mark.parametrize("profile", [STEPS, RAMPS])
@pytest.mark.parametrize(("start", "end"), [(-1, 6), (0, 1), (1.5, 3.5), (2, 4), (4, 5), (-3, -2)])
def test_pieces_cover_an_interval_and_agree_with_the_profile(profile, start, end):
    pieces = profile.pieces(start, end)
    assert pieces[0].t_start == start and pieces[-1].t_end == end
    assert all(a.t_end == b.t_start for a, b in zip(pieces[:-1], pieces[1:], strict=True))
    assert not any(p.t_start < t < p.t_end for p in pieces for t in profile.breakpoints)
    for piece in pieces:
        for t in np.linspace(piece.t_start, piece.t_end, 7)[:-1]:
            np.testing.assert_allclose(piece(t), profile(t), rtol=1e-14, atol=1e-14)
        before = profile(np.nextafter(piece.t_end, -np.inf))
        np.testing.assert_allclose(piece(piece.t_end), before, rtol=1e-14, atol=1e-14)


def test_a_constant_takes_a_number_or_a_vector():
    assert Profile.constant(12.0)(3.0).tolist() == [12.0]
    assert Profile.constant(np.array([1.0, 2.0]))(-1.0).tolist() == [1.0, 2.0]
    assert Profile.constant(np.zeros(0)).n_u == 0


def test_its_arrays_are_copies_that_nobody_can_change():
    values = np.array([1.0, 2.0])
    profile = Profile(np.array([0.0, 1.0]), values)
    values[0] = 9.0
    assert profile(0.0) == [1.0]
    for array in (profile.times, profile.values):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        profile.kind = "linear"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 1], [1, 2], "cubic"), "kind: expected step or linear, got 'cubic'"),
        (([], []), "times: expected at least one time, got none"),
        (([0, 0], [1, 2]), "times: expected strictly increasing times, got [0.0, 0.0]"),
        (([0, np.nan], [1, 2]), "times: expected finite numbers of shape (n), got [0, nan]"),
        (([0, True], [1, 2]), "times: expected finite numbers of shape (n), got [0, True]"),
        (([0, 1], [1, 2, 3]), "values: expected 2 rows, one for each time, got 3"),
        (([0], [np.inf]), "values: expected finite numbers of shape (n), got [inf]"),
        (([0], [[np.inf]]), "values: expected finite numbers of shape (n, n), got [[inf]]"),
        (([0, 1], [[1, 2], [3]]), "values: expected finite numbers of shape (n, n), got [[1, 2]"),
        (
            ([0, 5e-324], [0, 1e30], "linear"),
            "times: expected intervals that give finite slopes, got [0.0, 5e-324]",
        ),
    ],
)
def test_errors_name_field_expectation_and_gift(arguments, message):
    with pytest.raises(ProfileError) as caught:
        Profile(*arguments)
    assert str(caught.value).startswith(f"profile.{message}")
    assert isinstance(caught.value, ModelError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.parametrize("end", [1.0, 0.5, np.nan])
def test_pieces_need_an_interval(end):
    with pytest.raises(ProfileError, match=r"t_end: expected a time after t_start = 1, got "):
        STEPS.pieces(1.0, end)
