"""The loop of steps (`dtcasadi.integrators.loop`): native C against its Python twin."""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.compile import find_compiler
from dtcasadi.events import NO_GUARDS, Guards
from dtcasadi.integrators import METHODS, ONE_STEP
from dtcasadi.integrators.loop import Loop, build_loop
from dtcasadi.integrators.loop_state import LoopState, Stop, Watched
from dtcasadi.integrators.steppers import plant_of, step_function
from dtcasadi.presets import seed_four_disc

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="the C loop needs a C compiler")
NOTHING = np.zeros(0)
Result = tuple[Stop, np.ndarray, np.ndarray, LoopState]


def state(**changes: float) -> LoopState:
    """Settings of an adaptive run of order 5 over one second."""
    usual = {
        **{"h": 1e-3, "previous": 1e-4, "t_end": 1.0, "rtol": 1e-6, "atol": 1e-8, "h_max": 1.0},
        **{"order": 5.0, "slack_max": 1e-6, "limit": np.pi / 4, "near": 1e-3, "adaptive": 1},
        **{"capacity": 10_000},
    }
    return LoopState(**(usual | changes))


def both(
    native: Loop,
    twin: Loop,
    make: Callable[[], LoopState],
    x: np.ndarray,
    guards: Guards = NO_GUARDS,
    **arrays: np.ndarray,
) -> Result:
    """The same run by both loops; times, states, stops and counters must agree."""
    results = []
    for loop in (native, twin):
        s, now = make(), x.copy()
        command = arrays.get("u", NOTHING), arrays.get("du", NOTHING)
        guard = arrays.get("guard", np.zeros((0, 2), dtype=np.int64))
        theta = arrays.get("theta", NOTHING)
        why, t, states = loop.run(s, command, theta, guard, now, guards)
        assert len(t) == len(states) == s.stored
        if len(t):
            assert np.array_equal(states[-1], now) and t[-1] == s.t
        results.append((why, t, states, s))
    (why, t, states, s), (why_twin, t_twin, states_twin, s_twin) = results
    assert why is why_twin
    for name in ("stored", "accepted", "rejected", "broken", "adaptive", "event"):
        assert getattr(s, name) == getattr(s_twin, name), name
    # Fused multiply-adds change the last digit; a step size feels it through the error estimate,
    # whose round-off is up to 1e-16 / rtol of it.
    assert np.allclose(t, t_twin, rtol=1e-8, atol=0)
    assert np.allclose(states, states_twin, rtol=1e-8, atol=1e-8)
    assert s.h == pytest.approx(s_twin.h, rel=1e-6)
    return results[0]


@pytest.fixture(scope="module")
def model() -> dtc.Model:
    return dtc.build(seed_four_disc(), chart="planar")


def loops(model: dtc.Model, name: str) -> tuple[Loop, Loop]:
    """The compiled loop of a method, and the twin around the virtual machine's step."""
    native = METHODS[name].loop(model)  # type: ignore[attr-defined]
    assert native.library is not None
    return native, Loop(step_function(ONE_STEP[name], plant_of(model.graphs[1])), None)


@pytest.mark.parametrize("name", ["tsit5", "rodas4"])
def test_twins_agree_on_the_robot(model, name):
    """Adaptive with steps refused, under a ramp; fixed; stopped by a guard and taken up again."""
    native, twin = loops(model, name)
    x = np.concatenate([[0.1, 0.0, 0.01, 0.0, 0.01, 0.0], np.zeros(6)])
    arrays = {"u": np.array([2.0]), "du": np.array([10.0]), "theta": model.theta0}
    order = ONE_STEP[name].error_order + 1

    def adaptive() -> LoopState:
        # A first step of 0.3 s is far too long: the run starts with rejections.
        return state(h=0.3, order=order, t_command=-0.1)

    why, t, _, s = both(native, twin, adaptive, x, **arrays)
    assert why is Stop.AT_END and t[-1] == 1.0 and s.rejected > 2
    assert s.accepted == s.stored == len(t) > 10

    def fixed() -> LoopState:
        return state(h=1 / 256, h_max=1 / 256, order=order, adaptive=0)

    why, t, _, s = both(native, twin, fixed, x, **arrays)
    assert why is Stop.AT_END and s.rejected == 0
    assert np.allclose(t, np.arange(1, 257) / 256, rtol=1e-14)

    def guarded() -> LoopState:
        return state(h=1e-3, order=order, limit=0.3)

    limited = np.array([(0, Watched.LIMITED), (3, Watched.LIMITED)])
    why, t, states, s = both(native, twin, guarded, x, guard=limited, **arrays)
    assert why is Stop.GUARD and t[-1] < 1.0
    assert np.max(np.abs(states[-1, [0, 3]])) > 0.3 > np.max(np.abs(states[:-1, [0, 3]]))


def test_a_full_output_is_taken_up_where_it_stopped(model):
    """In chunks of 7 steps the run is the same, to the last bit."""
    native, _ = loops(model, "tsit5")
    x = np.concatenate([[0.1, 0.0, 0.01, 0.0, 0.01, 0.0], np.zeros(6)])
    arguments = (np.array([12.0]), np.zeros(1)), model.theta0, np.zeros(0, dtype=np.int64)
    whole, once = state(), x.copy()
    _, t, _ = native.run(whole, *arguments, once)
    pieces, chunked, times = state(capacity=7), x.copy(), []
    while True:
        why, some, _ = native.run(pieces, *arguments, chunked)
        times.extend(some)
        if why is not Stop.FULL:
            break
        assert len(some) == 7
    assert why is Stop.AT_END and np.array_equal(times, t) and np.array_equal(chunked, once)
    assert (pieces.accepted, pieces.rejected) == (whole.accepted, whole.rejected)


def made(name: str, **outputs: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]) -> tuple[Loop, Loop]:
    """Both loops around a step written for the occasion: functions of x, h and u + du h."""
    x, u, du, h = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("du"), ca.SX.sym("h")
    theta = ca.SX.sym("theta", 0)
    values = [ca.densify(ca.SX(f(x, h, u))) for f in outputs.values()]
    ports = ["x", "u", "du", "h", "theta"]
    step = ca.Function(name, [x, u, du, h, theta], values, ports, list(outputs))
    native = build_loop(step, lambda: step)
    assert native.library is not None
    return native, Loop(step, None)


def test_a_state_that_is_not_finite_is_never_accepted():
    """x' = x^2 from 1 ends at t = 1; its linearization x / (1 - h x) in a step gives x < 0 there.

    The logarithm turns that into NaN: adaptive steps shrink until they are too small.
    """
    native, twin = made(
        "loop_blow_up",
        x_next=lambda x, h, u: x * (1 + ca.exp(ca.log(h * x) - ca.log(1 - h * x))),
        error=lambda x, h, u: 1e-9 * x,
        slack=lambda x, h, u: 0,
    )
    start = np.array([1.0, 1.0])
    arrays = {"u": np.zeros(1), "du": np.zeros(1)}
    why, t, states, s = both(native, twin, lambda: state(t_end=2.0, capacity=500), start, **arrays)
    assert why is Stop.NOT_FINITE and s.broken > 10 and s.rejected >= s.broken
    assert np.all(np.isfinite(states)) and t[-1] == pytest.approx(1.0, abs=1e-6)
    why, t, states, s = both(
        native,
        twin,
        lambda: state(t_end=2.0, adaptive=0, h=0.03, h_max=0.03),
        start,
        **arrays,
    )
    assert why is Stop.NOT_FINITE and s.rejected == 0 and np.all(np.isfinite(states))


def test_a_step_that_does_not_converge():
    """The slack grows with h: adaptive steps get by with smaller ones, fixed ones stop."""
    native, twin = made(
        "loop_newton",
        x_next=lambda x, h, u: x + h * u,
        error=lambda x, h, u: 0 * x,
        slack=lambda x, h, u: ca.if_else(h > 1e-2, np.nan, 0),
    )
    start, arrays = np.zeros(2), {"u": np.ones(1), "du": np.ones(1)}
    why, _, states, s = both(native, twin, lambda: state(h=0.5), start, **arrays)
    assert why is Stop.AT_END and s.broken > 3
    # Explicit Euler on x' = 1 + t: below the 1.5 by h / 2.
    assert 1.5 - 6e-3 < states[-1, 0] < 1.5
    why, t, _, _ = both(native, twin, lambda: state(h=0.5, h_max=0.5, adaptive=0), start, **arrays)
    assert why is Stop.NEWTON and len(t) == 0


def test_a_step_too_small_for_the_tolerances():
    """An error that does not fall with the step ends the run instead of hanging it."""
    native, twin = made(
        "loop_stuck",
        x_next=lambda x, h, u: x + h,
        error=lambda x, h, u: 1 + 0 * x,
        slack=lambda x, h, u: 0,
    )
    arrays = {"u": np.zeros(1), "du": np.zeros(1)}
    why, t, _, s = both(native, twin, state, np.zeros(2), **arrays)
    assert why is Stop.TOO_SMALL and len(t) == 0 and 5 < s.rejected < 100


def test_pi_control_reaches_the_tolerance():
    """With error = 1e-3 h^5 / rtol over x = 1 the step settles at 0.9^(5/4) of error size one.

    h_new / h = 0.9 e^(-0.7/5) e^(0.4/5) = 1 at e = 0.9^(1 / 0.06); a step is never more than five
    times the last.
    """
    native, twin = made(
        "loop_control",
        x_next=lambda x, h, u: x,
        error=lambda x, h, u: 1e3 * h**5 * ca.SX.ones(2),
        slack=lambda x, h, u: 0,
    )
    arrays = {"u": np.zeros(1), "du": np.zeros(1)}
    start = np.ones(2)
    why, t, _, _ = both(
        native, twin, lambda: state(h=1e-5, t_end=2.0, h_max=2.0, atol=1e-12), start, **arrays
    )
    sizes = np.diff(np.concatenate([[0.0], t]))
    assert why is Stop.AT_END
    assert np.max(sizes[1:] / sizes[:-1]) < 5 + 1e-9
    settled = 0.9 ** (1 / 0.06) * 1e-6 / 1e3
    assert sizes[-2] == pytest.approx(settled ** (1 / 5), rel=1e-3)
    assert t[-1] == 2.0
