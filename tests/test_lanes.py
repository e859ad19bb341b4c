"""native/lanes.hpp: arithmetic of several robots in one number, against NumPy and long doubles."""

import casadi as ca
import numpy as np
import pytest
from c_compilers import QUICK_CXX, needs_cxx

import dtcasadi as dtc

pytestmark = needs_cxx


def on_lanes(name: str, *expressions: ca.SX, of: tuple[ca.SX, ...]) -> dtc.Batch:
    batch = dtc.batch(ca.Function(name, list(of), list(expressions)), flags=QUICK_CXX)
    assert batch.lanes > 1, batch.why
    return batch


def points(rng: np.random.Generator, limit: float) -> np.ndarray:
    """Angles below a limit: anywhere, tiny ones, and ones near the zeros of sin and cos."""
    anywhere = rng.uniform(-limit, limit, 200_000)
    tiny = np.exp(rng.uniform(-700, 0, 1000))
    quarters = np.round(rng.uniform(-limit, limit, 50_000) / (np.pi / 2)) * (np.pi / 2)
    return np.concatenate([anywhere, tiny, quarters * (1 + rng.uniform(-1e-6, 1e-6, 50_000)), [0]])


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 60, reason="no longer double to compare with")
@pytest.mark.parametrize("limit", [0.8, 3.0, 100.0, 1e6])
def test_sine_and_cosine_to_the_last_place(limit, rng):
    x = ca.SX.sym("x")
    batch = on_lanes("waves", ca.sin(x), ca.cos(x), of=(x,))
    angles = points(rng, limit)
    angles = angles[np.abs(angles) < limit]
    for mine, exact in zip(batch(angles[None]), (np.sin, np.cos), strict=True):
        reference = exact(angles.astype(np.longdouble))
        clear = np.abs(reference) > 1e-12  # nearer to a zero only the absolute error is bounded
        error = np.abs(mine[0] - reference)
        assert np.max(error[clear] / np.spacing(np.abs(mine[0, clear]))) <= 1.0
        # Beyond the second part of pi/2: 6e5 quarters times 1.5e-33.
        assert np.max(error[~clear], initial=0.0) <= 1e-26


def test_sine_and_cosine_far_out(rng):
    x = ca.SX.sym("x")
    batch = on_lanes("waves", ca.sin(x), ca.cos(x), of=(x,))
    angles = rng.uniform(-1e9, 1e9, 10_000)
    for mine, exact in zip(batch(angles[None]), (np.sin, np.cos), strict=True):
        assert np.max(np.abs(mine[0] - exact(angles))) <= 1e-15
    beyond = np.array([[1e19, np.inf, -np.inf, np.nan]])
    with np.errstate(invalid="ignore"):
        for mine, exact in zip(batch(beyond), (np.sin, np.cos), strict=True):
            # Not a number, or without fused multiply-add the C library's answer.
            assert np.isnan(mine[0, 1:]).all()
            assert np.isnan(mine[0, 0]) or abs(mine[0, 0] - exact(1e19)) < 1e-15


def test_every_other_function(rng):
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    pairs = [
        (a + b, np.add),
        (a - b, np.subtract),
        (a * b, np.multiply),
        (a / b, np.divide),
        (ca.fmin(a, b), np.fmin),
        (ca.fmax(a, b), np.fmax),
        (ca.atan2(a, b), np.arctan2),
        (ca.hypot(a, b), np.hypot),
        (ca.fmod(a, b), np.fmod),
        (ca.copysign(a, b), np.copysign),
        (ca.fabs(a) ** b, lambda a, b: np.abs(a) ** b),
        (a < b, np.less),
        (a <= b, np.less_equal),
        (a == b, np.equal),
        (a != b, np.not_equal),
        (ca.logic_and(a > 0, b > 0), lambda a, b: (a > 0) & (b > 0)),
        (ca.logic_or(a > 0, b > 0), lambda a, b: (a > 0) | (b > 0)),
        (ca.logic_not(a > 0), lambda a, b: ~(a > 0)),
    ]
    single = "fabs sqrt exp log tan asin acos atan sinh cosh tanh asinh acosh atanh".split()
    single += "floor ceil expm1 log1p erf".split()
    batch = on_lanes("pairs", *(each for each, _ in pairs), of=(a, b))
    left, right = rng.uniform(-3, 3, (2, 1, 41))
    right[0, :5] = left[0, :5]
    for mine, (_, exact) in zip(batch(left, right), pairs, strict=True):
        # Two C libraries may differ by a unit or two in the last place.
        np.testing.assert_allclose(mine[0], exact(left[0], right[0]), rtol=1e-15)
    unary = ca.Function("unary", [a], [getattr(ca, name)(a) for name in single])
    batch = on_lanes("unary", *unary.call([a]), of=(a,))
    where = np.concatenate([rng.uniform(0, 1, 19), rng.uniform(1, 3, 20)])
    for name, mine in zip(single, batch(where[None]), strict=True):
        expected = [float(getattr(ca, name)(value)) for value in where]
        np.testing.assert_allclose(mine[0], expected, rtol=1e-15, err_msg=name)


def test_minima_pass_over_what_is_not_a_number():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    batch = on_lanes("extremes", ca.fmin(a, b), ca.fmax(a, b), of=(a, b))
    left, right = np.array([[np.nan, 1.0, np.nan]]), np.array([[2.0, np.nan, np.nan]])
    for mine in batch(left, right):
        np.testing.assert_array_equal(mine[0], [2.0, 1.0, np.nan])
