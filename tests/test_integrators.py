"""One-step methods (`dtcasadi.integrators`): coefficients, orders, stability, error estimates."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from linear_plant import Linear, after, damped, stepper
from scipy.integrate import solve_ivp

import dtcasadi as dtc
from dtcasadi.bound import Bound
from dtcasadi.integrators import METHODS, ONE_STEP
from dtcasadi.integrators.collocation import RADAU3, SDIRK2
from dtcasadi.integrators.rosenbrock import RODAS4, ROS2, ROS3
from dtcasadi.integrators.stability import limit_on_ray
from dtcasadi.integrators.step import Plant
from dtcasadi.integrators.steppers import plant_of
from dtcasadi.integrators.symplectic import GAUSS4
from dtcasadi.integrators.tableau import DOPRI5, HEUN, RK4, TSIT5
from dtcasadi.presets import seed_four_disc
from dtcasadi.robot import Damping

NAMES = tuple(ONE_STEP)
ESTIMATING = tuple(name for name, method in ONE_STEP.items() if method.error_order)
# Every method that takes any step of a decaying mode, and damps the fastest ones at once.
L_STABLE = ("moreau", "ros1", "ros2", "ros3", "rodas4", "radau3", "radau5", "sdirk2")
SYMPLECTIC = ("gauss2", "gauss4")
# The order an error falls with, read off numbers, is this close to the method's.
SLOPE = 0.2


def slope(sizes: np.ndarray, errors: list[float]) -> float:
    """Exponent of the power law through the errors."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def counts(order: int) -> np.ndarray:
    """Numbers of steps with which errors lie between 1e-1 and, above round-off, 1e-12."""
    return np.array([128, 256, 512] if order <= 2 else [32, 64, 128])


def test_the_methods_are_the_ones_asked_for():
    orders = {name: method.order for name, method in ONE_STEP.items()}
    assert orders == {
        **{"euler": 1, "heun": 2, "rk4": 4, "dopri5": 5, "tsit5": 5},
        **{"ros1": 1, "ros2": 2, "ros3": 3, "rodas4": 4},
        **{"sdirk2": 2, "midpoint": 2, "radau3": 3, "radau5": 5, "gauss2": 2, "gauss4": 4},
        "moreau": 1,
    }
    assert set(ESTIMATING) == {"dopri5", "tsit5", "ros2", "ros3", "rodas4"}
    assert set(METHODS) > {"auto", "LSODA", "Radau", "BDF", "DOP853", *NAMES}
    assert all(METHODS[name].name == name for name in METHODS)


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
@pytest.mark.parametrize("name", NAMES)
def test_order_on_a_linear_system(rng, name, kind):
    """Against expm of [x; u; du]: actuator states (the canonical form has none), ramped command."""
    method = ONE_STEP[name]
    linear = damped(rng, lag=name not in SYMPLECTIC)
    x, u, du = (rng.normal(size=n) for n in (linear.n_x, 2, 2))
    step, exact = stepper(method, linear.plant(kind)), linear.exact(x, u, du, 2.0)
    numbers = counts(method.order)
    errors = [np.linalg.norm(after(step, x, u, du, 2.0, n) - exact) for n in numbers]
    assert abs(slope(2.0 / numbers, errors) - method.order) < SLOPE


def test_a_method_of_lower_order_is_seen(rng):
    """Heun with the weights of Euler: the slope test above cannot pass by accident."""
    linear = damped(rng)
    x, u, du = (rng.normal(size=n) for n in (linear.n_x, 2, 2))
    spoilt = replace(ONE_STEP["heun"], tableau=ONE_STEP["euler"].tableau)
    step, exact = stepper(spoilt, linear.plant()), linear.exact(x, u, du, 2.0)
    numbers = counts(2)
    errors = [np.linalg.norm(after(step, x, u, du, 2.0, n) - exact) for n in numbers]
    assert abs(slope(2.0 / numbers, errors) - 2) > 0.8


@cache
def robot() -> tuple[dtc.Model, Plant, np.ndarray, np.ndarray, np.ndarray]:
    """The paper's robot in the plane in swift motion; its plant, a state, a ramped command.

    Without damping the eigenvalues stay of order 1, so that the leading term of the error is seen.
    """
    model = dtc.build(replace(seed_four_disc(), damping=Damping()), chart="planar")
    q, qd = [0.3, 0.2, -0.4, 0.1, 0.5, -0.2], [1.0, -0.5, 0.8, -1.0, 0.3, 0.6]
    return model, plant_of(model.graphs[1]), np.array(q + qd), np.array([12.0]), np.array([20.0])


@cache
def reference(t_end: float) -> np.ndarray:
    """The robot's state by SciPy's DOP853 at 1e-13."""
    model, _, x, u, du = robot()
    ode = Bound(model.function("ode"))

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return ode(x, u + t * du, model.theta0)

    return solve_ivp(rate, (0, t_end), x, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


@pytest.mark.parametrize("name", NAMES)
def test_order_on_the_robot(name):
    model, plant, x0, u, du = robot()
    method = ONE_STEP[name]
    # Steps at which the leading term rules, above round-off: for order 5 there are not many.
    t_end, numbers = (1.0, [384, 512, 768]) if method.order == 5 else (0.5, [128, 256, 512])
    step, errors = Bound(stepper(method, plant)), []
    for n in numbers:
        x, h = x0, t_end / n
        for k in range(n):
            x = step(x, u + k * h * du, du, h, model.theta0).x_next
        errors.append(np.linalg.norm(x - reference(t_end)))
    assert abs(slope(t_end / np.array(numbers), errors) - method.order) < SLOPE


@pytest.mark.parametrize("name", ESTIMATING)
def test_the_error_estimate_falls_as_it_says(name):
    """Like h^(error_order + 1), and above the true error of the step it is an estimate for."""
    model, plant, x, u, du = robot()
    method, sizes = ONE_STEP[name], 0.02 / 2.0 ** np.arange(4)
    step = Bound(stepper(method, plant))
    estimates, errors = [], []
    for h in sizes:
        x_next, estimate, _ = step(x, u, du, h, model.theta0)
        estimates.append(np.linalg.norm(estimate))
        errors.append(np.linalg.norm(x_next - reference(h)))
    assert abs(slope(sizes, estimates) - method.error_order - 1) < SLOPE
    assert method.order == method.error_order + 1
    assert np.all(np.array(errors) < estimates)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ESTIMATING])
def test_methods_without_an_estimate_give_none(name):
    model, plant, x, u, du = robot()
    assert not np.any(Bound(stepper(ONE_STEP[name], plant))(x, u, du, 0.01, model.theta0)[1])


@pytest.mark.parametrize("name", NAMES)
def test_stability_function_is_the_step_on_a_linear_system(rng, name):
    """F_x of a step = V R(h Lambda) V^-1 with xdot = V Lambda V^-1 x, at steps small and large."""
    method, linear = ONE_STEP[name], damped(rng, lag=False)
    F, _ = linear.system()
    values, vectors = np.linalg.eig(F)
    step = stepper(method, linear.plant())
    still = np.zeros(2)
    for h in (0.1, 1.0, 10.0):
        columns = [step(e, still, still, h, 1.0)[0].full()[:, 0] for e in np.eye(6)]
        expected = (vectors * method.stability(h * values)) @ np.linalg.inv(vectors)
        scale = np.max(np.abs(expected))
        # Round-off times cond(V), 1e1, and what cancels in the stages at |h lambda| = 20, 1e3.
        assert np.max(np.abs(np.array(columns).T - expected)) < 1e-11 * scale


@pytest.mark.parametrize("name", [name for name in NAMES if name not in SYMPLECTIC])
@pytest.mark.parametrize("z", [-0.1, -2.0, -50.0])
def test_stability_function_on_the_scalar_test_equation(name, z):
    """A plant that is nothing but the lag of its actuator: z' = lambda z."""
    none = np.zeros((0, 0))
    scalar = Linear(none, none, none, np.zeros((0, 2)), np.ones(2))
    step, still = stepper(ONE_STEP[name], scalar.plant()), np.zeros(2)
    value = step([1.0, 1.0], still, still, -z, 1.0)[0].full()[:, 0]
    expected = ONE_STEP[name].stability(np.array([z]))[0]
    assert value == pytest.approx([expected, expected], rel=1e-10)  # round-off times |z|^stages


@pytest.mark.parametrize("name", NAMES)
def test_stability_function_is_the_exponential_to_its_order(name):
    """|R(z) - exp z| falls like |z|^(order + 1) on a ray of the left half-plane."""
    method, sizes = ONE_STEP[name], np.array([0.2, 0.1, 0.05])
    z = sizes * np.exp(2.5j)
    errors = list(np.abs(method.stability(z) - np.exp(z)))
    assert slope(sizes, errors) > method.order + 1 - SLOPE


@pytest.mark.parametrize("name", NAMES)
def test_stability_regions(name):
    method = ONE_STEP[name]
    assert method.a_stable == (name not in ("euler", "heun", "rk4", "dopri5", "tsit5"))
    far = np.abs(method.stability(-np.logspace(-3, 12, 200)))
    if not method.a_stable:
        assert far[-1] > 1e10
        return
    # A-stable: the imaginary axis bounds the left half-plane, where R has no pole.
    axis = np.abs(method.stability(1j * np.logspace(-3, 4, 500)))
    assert np.max(far) <= 1 + 1e-12 and np.max(axis) <= 1 + 1e-12
    if name in L_STABLE:
        # R is c / z far out; the solve of the stages adds its round-off.
        assert far[-1] < 1e-10
    else:
        assert far[-1] == pytest.approx(1.0)
    if name in SYMPLECTIC:
        assert np.max(np.abs(axis - 1)) < 1e-12


@pytest.mark.parametrize(
    ("name", "real", "imaginary"),
    [
        # Hairer, Wanner II, section IV.2, figure 2.1; tsit5: the root of |R(-x)| = 1.
        ("euler", 2.0, 0.0),
        ("heun", 2.0, 0.0),
        ("rk4", 2.785293563, 2.0 * np.sqrt(2.0)),
        ("dopri5", 3.306567893, None),
    ],
)
def test_limits_on_rays(name, real, imaginary):
    method = ONE_STEP[name]
    assert limit_on_ray(method, -1.0 + 0j) == pytest.approx(real, abs=1e-8)
    assert limit_on_ray(method, -50.0 + 0j) == pytest.approx(real / 50, abs=1e-9)
    if imaginary is not None:
        # Near the axis Euler's and Heun's steps vanish; rk4 holds 2.83 times |lambda|.
        near = limit_on_ray(method, -1e-9 + 1j)
        assert near == pytest.approx(imaginary, abs=3e-3)


@pytest.mark.parametrize("name", L_STABLE)
def test_l_stable_methods_have_no_limit(name):
    for value in (-1.0 + 0j, -1e6 + 1e6j, -1e-3 + 1j):
        assert limit_on_ray(ONE_STEP[name], value) == np.inf


@pytest.mark.parametrize("tableau", [HEUN, RK4, DOPRI5, TSIT5], ids=lambda tableau: tableau.name)
def test_a_mistyped_tableau_cannot_be_made(tableau):
    """One digit in the ninth place, in any coefficient that the sum conditions see."""
    s = len(tableau.b)
    for i in range(s):
        b = tableau.b.copy()
        b[i] += 1e-9
        with pytest.raises(ValueError):
            replace(tableau, b=b)
    for i in range(1, s):
        a = tableau.a.copy()
        a[i, 0] += 1e-9
        if tableau.b[i]:  # the last stage of dopri5 and tsit5 only serves the error estimate
            with pytest.raises(ValueError):
                replace(tableau, a=a)
    with pytest.raises(ValueError):
        replace(tableau, a=tableau.a + 1e-3 * np.eye(s))
    if tableau.b_error is not None:
        with pytest.raises(ValueError):
            replace(tableau, b_error=tableau.b_error + 1e-9)


@pytest.mark.parametrize("method", [ROS2, ROS3, RODAS4], ids=lambda method: method.name)
def test_a_mistyped_rosenbrock_method_cannot_be_made(method):
    s = len(method.m)
    for field in ("m", "A", "C"):
        value = getattr(method, field)
        for place in np.argwhere(np.ones(s) if field == "m" else np.tri(s, s, -1)):
            wrong = value.copy()
            wrong[tuple(place)] += 1e-5
            with pytest.raises(ValueError):
                replace(method, **{field: wrong})
    for change in ({"gamma": method.gamma + 1e-6}, {"order": method.order + 1}):
        with pytest.raises((ValueError, IndexError)):
            replace(method, **change)
    e = method.e.copy()
    e[0] += 1e-5
    with pytest.raises(ValueError):
        replace(method, e=e)


@pytest.mark.parametrize("method", [SDIRK2, RADAU3, ONE_STEP["radau5"]], ids=lambda m: m.name)
def test_a_mistyped_collocation_method_cannot_be_made(method):
    for i in range(len(method.b)):
        b = method.b.copy()
        b[i] += 1e-9
        with pytest.raises(ValueError):
            replace(method, b=b)
    for place in np.argwhere(method.a):
        a = method.a.copy()
        a[tuple(place)] += 1e-9
        with pytest.raises(ValueError):
            replace(method, a=a)


def test_a_gauss_method_that_is_not_symplectic_or_of_lower_order_cannot_be_made():
    changes = [np.outer(*np.eye(2)[list(place)]) for place in np.ndindex(2, 2)]
    changes.append(np.array([[0.0, 1.0], [-1.0, 0.0]]))  # stays symplectic, of order 2
    for change in changes:
        with pytest.raises(ValueError):
            replace(GAUSS4, a=GAUSS4.a + 1e-9 * change)


def test_gauss_methods_refuse_actuator_states():
    model = dtc.build(seed_four_disc(), chart="planar", actuator="regulator")
    with pytest.raises(dtc.errors.SimulationError, match="method gauss4 is for actuator 'direct'"):
        model.discrete(0.01, method="gauss4")
