"""The paper's four-disc robot: the shipped scenes move as an independent planar program says.

Its states have an error of 1e-11; the numbers below are rounded to the digits shown. (y, z) are
coordinates in the root's frame, heights count along `up`.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
from moving import DOWN, FORCE, TIGHT, UP
from moving import scene_model as model
from oracles.cases import numbers

import dtcasadi as dtc

ALL = (DOWN, UP, FORCE)


def run_of(name: str, t_end: float) -> dtc.Run:
    """The scene by its own method and tolerances."""
    scene, m = dtc.load_scene(name), model(name)
    start: dict[str, Any] = {"pressure": scene.pressure, "rtol": scene.rtol, "atol": scene.atol}
    run = dtc.simulate(m, scene.x0(m), t_end=t_end, **start)
    assert run.success, run.message
    return run


@cache
def own_run(name: str) -> dtc.Run:
    """The scene as it is shipped."""
    return run_of(name, dtc.load_scene(name).t_end)


def states(name: str, times: tuple[float, ...], **options: str) -> list[np.ndarray]:
    """Accurate states at some times, each run continuing the one before."""
    scene, m = dtc.load_scene(name), model(name, **options)
    x, before, found = scene.x0(m), 0.0, []
    for t in times:
        # Explicit while the motion is fast; towards rest only stability limits such steps.
        method = "DOP853" if t <= 5 else "LSODA"
        start: dict[str, Any] = {"t_end": t - before, "method": method, **TIGHT}
        run = dtc.simulate(m, x, pressure=scene.pressure, **start)
        assert run.success, run.message
        x, before = run.x[:, -1], t
        found.append(x)
    return found


def origin(m: dtc.Model, x: np.ndarray) -> np.ndarray:
    """Where the thread joins disc 4, (y, z)."""
    return numbers(m.poses, x[: m.n_q], m.theta0)[1][1:, 3]


def centre(m: dtc.Model, x: np.ndarray) -> np.ndarray:
    """Centre of disc 4, (y, z)."""
    R, r = numbers(m.poses, x[: m.n_q], m.theta0)
    return (r[:, 3] + R[:, 9:] @ m.robot.discs[3].centre_of_mass)[1:]


def heights(run: dtc.Run) -> tuple[np.ndarray, np.ndarray]:
    """Heights of every frame's origin, (n, 4), and of disc 4's centre, (n,)."""
    R, r = run.poses()
    up = run.model.robot.up
    offset = R[:, 3] @ run.model.robot.discs[3].centre_of_mass
    return r @ up, (r[:, 3] + offset) @ up


@pytest.mark.parametrize(
    ("name", "times", "place", "expected"),
    [
        (
            UP,
            (0.5, 1.0, 2.0, 3.0),
            origin,
            [(-1.41016, 2.60795), (-2.63405, 0.39544), (0.59003, -1.81884), (0.08101, 0.34290)],
        ),
        (
            UP,
            (0.5, 1.0, 2.0, 3.0),
            centre,
            [(-0.7208, 3.33237), (-3.46129, 0.95729), (1.19813, -2.61271), (0.20233, 1.33552)],
        ),
        (
            DOWN,
            (0.5, 1.0, 2.0, 3.0, 5.0),
            centre,
            [
                *((1.30807, 3.15972), (2.34998, 2.71531), (3.19555, 2.01211)),
                *((2.42879, 2.94063), (1.76662, 3.31026)),
            ],
        ),
    ],
    ids=["up_origin", "up_centre", "down_centre"],
)
def test_reference_motion(name, times, place, expected):
    value = [place(model(name), x) for x in states(name, times)]
    # Half a unit of the fifth decimal, and as much again for our own error at 3 s.
    np.testing.assert_allclose(value, expected, rtol=0, atol=1e-5)


def test_it_falls_is_lifted_and_settles_curled():
    """up = -y, pressure 12: what the paper's text says, over a minute."""
    times = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 20.0, 60.0)
    y, z = np.array([centre(model(DOWN), x) for x in states(DOWN, times)]).T
    height = [-1.31, -2.35, -3.20, -2.43, -1.77, -2.31, -2.46, -2.59]
    np.testing.assert_allclose(-y, height, rtol=0, atol=0.0051)
    along = [3.16, 2.72, 2.01, 2.94, 3.31, 3.05, 2.92, 2.75]
    np.testing.assert_allclose(z, along, rtol=0, atol=0.0051)


@pytest.mark.parametrize(
    ("terms", "expected"), [("paper", (-2.650, 0.228)), ("none", (-2.592, -0.044))]
)
def test_velocity_terms_differ_visibly(terms, expected):
    """up = +y, origin of disc 4 at 1 s; with the full terms it is at (-2.634, 0.395)."""
    value = origin(model(UP, velocity_terms=terms), states(UP, (1.0,), velocity_terms=terms)[0])
    np.testing.assert_allclose(value, expected, rtol=0, atol=5.1e-4)


@pytest.mark.parametrize("name", ALL)
def test_the_shipped_settings_are_accurate(name):
    """The default method at the scene's own tolerances, against the accurate motion at 3 s."""
    accurate = states(name, (3.0,))[0]
    # rtol = 1e-6 a step, grown by the unstable motion of the fall.
    assert np.max(np.abs(run_of(name, 3.0).q[:, -1] - accurate[:6])) < 1e-3


def test_a_scene_alone_is_enough_to_run():
    run = dtc.simulate(dtc.load_scene(DOWN))
    assert run.success and run.t[-1] == 10.0
    assert np.array_equal(run.x, own_run(DOWN).x)


def test_thread_on_top_falls_then_rises():
    run = own_run(DOWN)
    _, height = heights(run)
    lowest = int(np.argmin(np.where(run.t < 5.5, height, np.inf)))
    assert height[0] - np.min(height[run.t <= 2.2]) > 2
    assert 1.5 < run.t[lowest] < 2.5
    assert height[lowest] == pytest.approx(-3.197, abs=1e-3)
    rise = height[(run.t > run.t[lowest]) & (run.t < 5.5)]
    assert np.max(rise) - height[lowest] > 1
    assert np.max(rise) == pytest.approx(-1.486, abs=1e-3)
    tilt = run.q.sum(axis=0)
    assert np.min(tilt) > -0.3 and np.max(tilt) < 1.3


def test_thread_below_curls_through_itself():
    run = own_run(UP)
    origins, _ = heights(run)
    lowest = int(np.argmin(np.where(run.t < 2.2, origins.min(axis=1), np.inf)))
    assert 0.9 < run.t[lowest] < 1.15
    assert origins[lowest].min() < -2.5
    rise = origins[(run.t > run.t[lowest]) & (run.t < 2.2), 3]
    assert np.max(rise) - origins[lowest, 3] > 3


@pytest.mark.parametrize("name", ALL)
def test_the_first_thread_turns_fastest_in_the_fall(name):
    run = own_run(name)
    origins, _ = heights(run)
    fall = run.t <= run.t[np.argmin(np.where(run.t < 2.5, origins[:, 3], np.inf))]
    peaks = np.max(np.abs(run.qd[::2, fall]), axis=1)  # beta1, beta2, beta3
    assert peaks[0] > max(peaks[1:])


def test_where_the_scenes_settle():
    """After 200 s; rates about 1e-6 there with the thread on top."""
    settled = (-1.2107, 1.2308, -1.0029, 1.1753, -0.5933, 1.5081)
    run = run_of(DOWN, 200.0)
    np.testing.assert_allclose(run.q[:, -1], settled, rtol=0, atol=1e-4)
    assert np.max(np.abs(run.qd[:, -1])) < 3e-6
    run = run_of(FORCE, 200.0)
    settled = (1.74, 1.37, -1.33, 1.39, -1.28, 1.57)
    np.testing.assert_allclose(run.q[:, -1], settled, rtol=0, atol=0.005)
    # Curled through itself: the equilibrium at 12 with two extra turns.
    run = run_of(UP, 200.0)
    unwound = (1.983, 1.117, -0.942, 1.169, -0.587, 1.508)
    turns = (run.q[:, -1] - unwound) / (2 * np.pi)
    np.testing.assert_allclose(turns, [0, 0, 1, 0, 1, 0], rtol=0, atol=1e-3)


def check_it_stays_in_its_plane(name: str, method: str) -> None:
    """Not even round-off may grow: fused products need not keep an exact zero."""
    scene, m = dtc.load_scene(name), model(name, chart="cardan")
    plane = ("thread_x", "disc_x")
    out = [k for k, n in enumerate(m.coordinate_names) if not n.startswith(plane)]
    assert len(out) == 9
    pressure, x0 = scene.pressure, scene.x0(m)
    run = dtc.simulate(m, x0, pressure=pressure, t_end=10.0, method=method)
    assert run.success, run.message
    assert np.max(np.abs(run.q[out])) < 1e-12
    # In the plane it is the planar model's motion.
    planar = run_of(name, 2.0)
    spatial = dtc.simulate(m, x0, pressure=pressure, t_end=2.0, method=method)
    assert np.max(np.abs(spatial.poses()[1][-1] - planar.poses()[1][-1])) < 1e-3
    x0[out] = 1e-9
    run = dtc.simulate(m, x0, pressure=pressure, t_end=5.0, method=method)
    assert run.success, run.message
    assert 0 < np.max(np.abs(run.q[out])) < 1e-7


@pytest.mark.parametrize("name", ALL)
def test_spatial_motion_stays_in_its_plane(name):
    check_it_stays_in_its_plane(name, "DOP853")


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("method", ["auto", "rodas4", "LSODA"])
def test_spatial_motion_stays_in_its_plane_by_every_kind_of_method(name, method):
    check_it_stays_in_its_plane(name, method)


@pytest.mark.parametrize("name", ALL)
def test_both_dampings_are_the_same_in_the_plane(rng, name):
    """The scenes' c_a = c_b = 100 is the paper's b = 100 on every coordinate rate."""
    physical, coordinate = model(name), model(name, damping="coordinate")
    for x in rng.normal(size=(20, 12)):
        damping = numbers(physical.damping, x[:6], x[6:], physical.theta0)
        np.testing.assert_allclose(damping, 100 * x[6:], rtol=1e-12, atol=1e-12)
        rates = [numbers(m.ode, x, 12.0, m.theta0) for m in (physical, coordinate)]
        # Round-off of forces near 1e3 through M^-1, near 10.
        np.testing.assert_allclose(*rates, rtol=1e-11, atol=1e-9)
