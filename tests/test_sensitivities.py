"""Derivatives of a step for state, command and parameters, exact and cheaper ones."""

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from linear_plant import damped
from oracles.robots import planar_robot, random_robot

import dtcasadi as dtc
from dtcasadi.integrators import ONE_STEP
from dtcasadi.integrators.step import Plant
from dtcasadi.integrators.steppers import plant_of, symbols

EXPLICIT = ("euler", "heun", "rk4", "dopri5", "tsit5")
SYMPLECTIC = ("gauss2", "gauss4")
# Methods with a cheaper form; the others give exact derivatives either way.
INEXACT = tuple(n for n in ONE_STEP if n not in (*EXPLICIT, *SYMPLECTIC, "moreau"))
H = 0.01


def linearization(name: str, plant: Plant, *, exact: bool) -> ca.Function:
    """x, u, du, h, theta -> x_next, F_x, F_u, F_theta (without the block `frames`)."""
    at = symbols(plant)
    still = at._replace(du=at.zeros(at.u.shape[0]))
    step, by = ONE_STEP[name].sensitivity(plant, still, exact=exact)
    return ca.Function("linearization", list(at), [ca.densify(v) for v in (step.x_next, *by)])


def differences(f: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Central differences, shape (len(f), len(at)); e^2 f''' / 6 and round-off / e: 1e-10 here."""
    e = 1e-5
    columns = [(f(at + e * v) - f(at - e * v)) / (2 * e) for v in np.eye(len(at))]
    return np.array(columns).reshape(len(at), -1).T


FREE = ("springs.stiffness", "discs[2].mass", "damping.c_a", "gravity")


@cache
def planar(n: int, actuator: str) -> tuple[dtc.Model, Plant]:
    """A planar robot with springs, dampers, a pressure and free parameters: one flat SX graph."""
    robot = planar_robot(np.random.default_rng(n), n)
    model = dtc.build(robot, chart="planar", actuator=actuator, parameters=FREE, wrenches=(n,))
    return model, plant_of(model.graphs[1])


@cache
def spatial() -> tuple[dtc.Model, Plant]:
    """Three discs in space, ten coordinates: MX graphs that call Functions."""
    robot = random_robot(np.random.default_rng(3), 3)
    model = dtc.build(robot, actuator="regulator", parameters=FREE, wrenches=(3,))
    return model, plant_of(model.graphs[1])


def state(rng: np.random.Generator, model: dtc.Model) -> tuple[np.ndarray, ...]:
    """A state in motion, pressures inside their limits, loads that are not zero."""
    x, u = rng.uniform(-0.3, 0.3, model.n_x), rng.uniform(1.0, 3.0, model.n_u)
    x[2 * model.n_q :] += 2.0
    theta = model.theta0.copy()
    theta[model.theta_blocks["wrench"]] = rng.normal(size=6)
    return x, u, theta


def check(model: dtc.Model, function: ca.Function, rng: np.random.Generator) -> None:
    """F_x, F_u and F_theta of a step against central differences of its x_next."""
    x, u, theta = state(rng, model)
    n_frames = model.theta_blocks.get("frames", slice(0, 0)).stop

    def step(x: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
        return function(x, u, 0 * u, H, theta)[0].full()[:, 0]

    _, F_x, F_u, F_theta = (value.full() for value in function(x, u, 0 * u, H, theta))
    expected = (
        differences(lambda v: step(v, u, theta), x),
        differences(lambda v: step(x, v, theta), u),
        differences(lambda v: step(x, u, np.append(theta[:n_frames], v)), theta[n_frames:]),
    )
    for value, wanted in zip((F_x, F_u, F_theta), expected, strict=True):
        assert value.shape == wanted.shape
        assert np.max(np.abs(wanted)) > 1e-4  # there is something to compare
        assert np.max(np.abs(value - wanted)) < 1e-9 * max(1.0, np.max(np.abs(wanted)))


@pytest.mark.parametrize("name", [name for name in ONE_STEP if name not in SYMPLECTIC])
def test_exact_derivatives_in_the_plane(rng, name):
    model, plant = planar(3, "regulator")
    check(model, linearization(name, plant, exact=True), rng)


@pytest.mark.parametrize("name", SYMPLECTIC)
def test_exact_derivatives_of_symplectic_steps(rng, name):
    model, plant = planar(2, "direct")
    check(model, linearization(name, plant, exact=True), rng)


@pytest.mark.parametrize("name", ["rk4", "sdirk2"])
def test_exact_derivatives_in_space(rng, name):
    model, plant = spatial()
    check(model, linearization(name, plant, exact=True), rng)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in ONE_STEP if n not in ("rk4", "sdirk2", *SYMPLECTIC)])
def test_exact_derivatives_in_space_of_the_rest(rng, name):
    model, plant = spatial()
    check(model, linearization(name, plant, exact=True), rng)


@pytest.mark.slow
@pytest.mark.parametrize("name", SYMPLECTIC)
def test_exact_derivatives_of_symplectic_steps_in_space(rng, name):
    robot = random_robot(rng, 3)
    model = dtc.build(robot, parameters=("gravity",), wrenches=(3,))
    check(model, linearization(name, plant_of(model.graphs[1]), exact=True), rng)


def gaps(rng: np.random.Generator, name: str, model: dtc.Model, plant: Plant) -> np.ndarray:
    """Largest differences of the two forms in F_x, F_u, F_theta at three sizes, shape (3, 3)."""
    x, u, theta = state(rng, model)
    forms = [linearization(name, plant, exact=exact) for exact in (True, False)]
    rows = []
    for h in (0.004, 0.002, 0.001):
        values = [[v.full() for v in f(x, u, 0 * u, h, theta)] for f in forms]
        assert np.array_equal(values[0][0], values[1][0])  # the same step
        rows.append([np.max(np.abs(a - b)) for a, b in zip(*values, strict=True)][1:])
    return np.array(rows)


def slope(errors: np.ndarray) -> float:
    """Order of the fall over the last halving."""
    return float(np.log2(errors[-2] / errors[-1])) if errors[-1] else np.inf


@pytest.mark.parametrize("name", INEXACT)
def test_error_of_the_cheaper_derivatives(rng, name):
    """O(h^2) in F_x and F_theta, as documented; O(h^3) in F_u, whose own size is O(h)."""
    rows = gaps(rng, name, *planar(3, "regulator"))
    F_x, F_u, F_theta = (slope(column) for column in rows.T)
    assert abs(F_x - 2) < 0.2 and abs(F_theta - 2) < 0.2
    if name == "ros1":
        assert rows[0, 1] < 1e-14  # nothing is left out: one stage, linear in u
    else:
        assert F_u > 2.7  # 3, or more where the leading terms happen to cancel


def test_error_of_the_cheaper_derivatives_in_space(rng):
    rows = gaps(rng, "sdirk2", *spatial())
    assert abs(slope(rows[:, 0]) - 2) < 0.2 and abs(slope(rows[:, 2]) - 2) < 0.2


@pytest.mark.parametrize("name", EXPLICIT)
def test_explicit_methods_have_exact_derivatives_only(rng, name):
    model, plant = planar(2, "regulator")
    x, u, theta = state(rng, model)
    forms = [linearization(name, plant, exact=exact)(x, u, 0 * u, H, theta) for exact in (0, 1)]
    assert all(np.array_equal(a.full(), b.full()) for a, b in zip(*forms, strict=True))


@pytest.mark.parametrize("name", ONE_STEP)
def test_cheaper_derivatives_are_exact_on_a_linear_system(rng, name):
    """J is constant there: F_x = R(h F), by eigenvalues; F_u with it through xdot = F x + G u."""
    linear = damped(rng, lag=name not in SYMPLECTIC)
    F, G = linear.system()
    values, vectors = np.linalg.eig(F)
    inverse = np.linalg.inv(vectors)
    h = 0.3
    F_x = ((vectors * ONE_STEP[name].stability(h * values)) @ inverse).real
    x, u = rng.normal(size=linear.n_x), rng.normal(size=2)
    for exact in (False, True):
        function = linearization(name, linear.plant(), exact=exact)
        value = [v.full() for v in function(x, u, 0 * u, h, 1.0)]
        assert np.max(np.abs(value[1] - F_x)) < 1e-12 * np.max(np.abs(F_x))
        # x_next = R x + F^-1 (R - 1) G u for a command that is held.
        F_u = np.linalg.solve(F, (F_x - np.eye(linear.n_x)) @ G)
        assert np.max(np.abs(value[2] - F_u)) < 1e-12 * np.max(np.abs(F_u))


def test_a_wrong_derivative_is_seen(rng):
    """The cheaper form does not pass for the exact one."""
    model, plant = planar(3, "regulator")
    with pytest.raises(AssertionError):
        check(model, linearization("ros2", plant, exact=False), rng)


def numbers(values: Any) -> list[np.ndarray]:
    return [np.array(value) for value in values]


@pytest.mark.parametrize("method", ["rk4", "ros2", "sdirk2"])
def test_discrete_model(rng, method):
    """Step and linearization agree with the method's own, symbolic and compiled."""
    model, plant = planar(2, "regulator")
    discrete = model.discrete(H, method=method)
    assert (discrete.step_s, discrete.method) == (H, method)
    assert discrete.state_names == model.state_names
    assert discrete.theta_blocks == model.theta_blocks
    assert np.array_equal(discrete.theta0, model.theta0)
    x, u, theta = state(rng, model)
    expected = numbers(linearization(method, plant, exact=True)(x, u, 0 * u, H, theta))
    n, m = model.n_x, model.n_u
    assert [v.shape for v in expected] == [(n, 1), (n, n), (n, m), (n, len(theta))]
    x_next, status = discrete.step(x, u, theta)
    assert float(status) == 0
    assert np.max(np.abs(np.array(x_next) - expected[0])) < 1e-14
    compiled = discrete.compiled("linearize")(x, u, theta)
    for values in (numbers(discrete.linearize(x, u, theta)), compiled):
        for value, wanted in zip(values, expected, strict=True):
            gap = np.max(np.abs(np.reshape(value, wanted.shape, order="F") - wanted))
            assert gap < 1e-11 * np.max(np.abs(wanted))  # fused multiply-adds, cond(M) 1e2
    assert compiled.F_u.shape == (n, m)
    assert np.max(np.abs(discrete.compiled("step")(x, u, theta).x_next - expected[0][:, 0])) < 1e-12


def test_discrete_model_in_space(rng):
    """The parameters that only re-centring changes have zero columns."""
    model, plant = spatial()
    discrete = model.discrete(H, method="sdirk2", exact=False)
    x, u, theta = state(rng, model)
    expected = numbers(linearization("sdirk2", plant, exact=False)(x, u, 0 * u, H, theta))
    compiled = discrete.compiled("linearize")(x, u, theta)
    frames = model.theta_blocks["frames"]
    assert not np.any(compiled.F_theta[:, frames])
    padded = np.hstack([np.zeros((model.n_x, frames.stop)), expected[3]])
    for value, wanted in zip(compiled, [expected[0][:, 0], *expected[1:3], padded], strict=True):
        assert np.max(np.abs(value - wanted)) < 1e-10 * np.max(np.abs(wanted))
    x[1] = 1.0
    for value, wanted in zip(discrete.recentre(x, theta), model.recentre(x, theta), strict=True):
        assert np.array_equal(value, wanted)


@pytest.mark.parametrize("method", ["rk4", "ros2", "sdirk2", "radau5"])
def test_status_is_never_good_for_a_state_that_is_not_finite(method):
    """NaN or infinity anywhere, or rates whose squares overflow."""
    model, _ = planar(2, "regulator")
    discrete = model.discrete(H, method=method)
    rates = range(model.n_q, 2 * model.n_q)
    cases = [(bad, k) for bad in (np.nan, np.inf) for k in range(model.n_x)]
    for bad, k in [*cases, *((1e200, k) for k in rates)]:
        x = np.full(model.n_x, 0.1)
        good = discrete.step(x, np.ones(model.n_u), model.theta0)[1]
        x[k] = bad
        status = discrete.step(x, np.ones(model.n_u), model.theta0)[1]
        assert (float(good), float(status)) == (0, 1), (bad, model.state_names[k])


def test_discrete_model_names_what_is_wrong():
    model, _ = planar(2, "regulator")
    for arguments, text in (
        ((0.0, "rk4"), r"step_s: expected a finite positive number, got 0"),
        ((np.nan, "rk4"), r"step_s: expected a .*, got nan"),
        ((0.1, "rk5"), r"method: expected one of euler, .*, got 'rk5'"),
    ):
        with pytest.raises(dtc.errors.ModelError, match=text):
            model.discrete(arguments[0], method=arguments[1])
    expected = "expected one of step, checked, linearize, .*ode, got 'other'"
    with pytest.raises(dtc.errors.ModelError, match=expected):
        model.discrete(0.1).compiled("other")
