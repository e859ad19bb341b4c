"""dtcasadi.bound: arrays in, arrays out, wrong arrays refused."""

import gc

import casadi as ca
import numpy as np
import pytest

from dtcasadi.bound import Bound
from dtcasadi.errors import ModelError


@pytest.fixture
def bound() -> Bound:
    a, b, c = ca.SX.sym("a", 2), ca.SX.sym("b", 2, 3), ca.SX.sym("c")
    return Bound(ca.Function("mixed", [a, b, c], [c * b, a], ["a", "b", "c"], ["d", "e"]))


def test_arrays_in_arrays_out(bound):
    b = np.arange(6.0).reshape(2, 3)
    for order in ("C", "F"):
        d, e = result = bound([1, 2], np.array(b, order=order), 2)
        np.testing.assert_array_equal(d, 2 * b)
        np.testing.assert_array_equal(e, [1, 2])
        assert result.d is d and result.e is e
    # columns, integers, strided views, booleans and casadi's own matrices
    np.testing.assert_array_equal(bound([[1], [2]], b[:, ::-1], [2.0]).d, 2 * b[:, ::-1])
    np.testing.assert_array_equal(bound(ca.DM([1, 2]), ca.DM(b), True).d, b)


def test_results_are_fresh_and_views_are_not(bound):
    first = bound(np.ones(2), np.ones((2, 3)), 1.0)
    bound(np.zeros(2), np.zeros((2, 3)), 0.0)
    assert np.all(first.d == 1) and np.all(first.e == 1)
    view = bound.outputs.d
    bound.inputs.c[:] = 3
    bound.inputs.b[1, 2] = 5
    bound.run()
    assert view is bound.outputs.d and view[1, 2] == 15 and np.sum(view) == 15


def test_run_keeps_what_it_points_to():
    q = ca.SX.sym("q", 3)
    bound = Bound(ca.Function("gravity", [q], [-9.81 * ca.sin(q)], ["q"], ["force"]))
    run, inputs, outputs = bound.run, bound.inputs, bound.outputs
    del bound
    gc.collect()
    junk = [np.full(3, 7.0) for _ in range(100)]
    inputs.q[:] = np.pi / 2
    run()
    np.testing.assert_allclose(outputs.force, -9.81)
    assert junk


def test_a_single_output_is_an_array_and_a_vector_has_one_axis():
    x = ca.SX.sym("x", 3)
    total = Bound(ca.Function("total", [x], [ca.sum1(x)]))([1, 2, 3])
    assert isinstance(total, np.ndarray) and total.shape == (1,) and total[0] == 6


def test_named_matrices_keep_two_axes_with_one_column():
    q = ca.SX.sym("q")
    function = ca.Function("mass_matrix", [q], [2 + ca.cos(q)], ["q"], ["M"])
    assert Bound(function)(0).shape == (1,)
    assert Bound(function, matrices=["M"])(0).shape == (1, 1)
    with pytest.raises(ModelError) as caught:
        Bound(function, matrices=["m"])
    assert str(caught.value) == "mass_matrix: matrices: expected ports of q, M, got 'm'"


def test_ports_of_size_zero_and_names_that_are_keywords():
    x, z = ca.SX.sym("x"), ca.SX.sym("z", 0, 3)
    bound = Bound(ca.Function("odd", [x, z], [x, z, ca.SX(0, 1)], ["lambda", "z"], ["a", "b", "c"]))
    a, b, c = bound(1, np.zeros((0, 3)))
    assert (a.shape, b.shape, c.shape) == ((1,), (0, 3), (0,))
    assert bound.inputs._fields == ("_0", "z")


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (([1, 2],), "expected 3 arguments (a, b, c), got 1"),
        (([1], np.ones((2, 3)), 1), "a: expected shape (2,), got (1,)"),
        ((1, np.ones((2, 3)), 1), "a: expected shape (2,), got ()"),
        (([[1, 2]], np.ones((2, 3)), 1), "a: expected shape (2,), got (1, 2)"),
        ((np.ones(3), np.ones((2, 3)), 1), "a: expected shape (2,), got (3,)"),
        ((np.ones(2), np.ones((3, 2)), 1), "b: expected shape (2, 3), got (3, 2)"),
        ((np.ones(2), np.ones(6), 1), "b: expected shape (2, 3), got (6,)"),
        ((np.ones(2), np.ones((1, 2, 3)), 1), "b: expected shape (2, 3), got (1, 2, 3)"),
        ((np.ones(2), np.ones((2, 3, 1)), 1), "b: expected shape (2, 3), got (2, 3, 1)"),
        ((np.ones(2), np.ones((2, 3)), []), "c: expected shape (1,), got (0,)"),
        ((["1", "2"], np.ones((2, 3)), 1), "a: expected real numbers, got ['1', '2']"),
        (([1j, 0], np.ones((2, 3)), 1), "a: expected real numbers, got [1j, 0]"),
        (([[1, 2], 3], np.ones((2, 3)), 1), "a: expected real numbers, got [[1, 2], 3]"),
        ((None, np.ones((2, 3)), 1), "a: expected real numbers, got None"),
    ],
)
def test_arguments_that_are_refused(bound, arrays, message):
    with pytest.raises(ModelError) as caught:
        bound(*arrays)
    assert str(caught.value) == f"mixed: {message}"


def test_a_failed_evaluation_is_an_error():
    x, p = ca.MX.sym("x"), ca.MX.sym("p")
    solver = ca.rootfinder("no_root", "newton", {"x": x, "p": p, "g": x**2 + p**2 + 1})
    bound = Bound(ca.Function("root", [p], [solver(1, p)]))
    with pytest.raises(ModelError, match="^root: evaluation failed: "):
        bound(1.0)
