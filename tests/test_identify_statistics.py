"""What the data leave open, whether intervals hold, and whether a wrong model is noticed."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from linear_toy import LinearDiscrete
from recordings import covered, noisy, sensed, toy, toy_log

import dtcasadi as dtc
from dtcasadi.errors import LogError
from dtcasadi.identify import Experiment, Settings, build, solve
from dtcasadi.identify.data import gridded
from dtcasadi.identify.problem import Problem, node_steps, wanted_of
from dtcasadi.identify.shooting import Point, Stages, shoot, simulated
from dtcasadi.identify.suspicions import check_units
from dtcasadi.identify.whiteness import residual_tests
from dtcasadi.logs import Log
from dtcasadi.recording import experiment, experiment_of
from dtcasadi.sensors import IMU, Marker

THETA, X0 = np.array([0.7, -1.2]), np.array([0.5, -0.3, 0.8])
TRUE = {"springs.stiffness": 1.2, "damping.c_a": 80.0}


def pair(names: tuple[str, str], share: float, theta0: tuple[float, float]) -> LinearDiscrete:
    """A toy whose second parameter acts as `share` times the first."""
    discrete = toy()
    B = np.column_stack([discrete.B[:, 0], share * discrete.B[:, 0]])
    measured = {name: (H, 0 * H_theta, R) for name, (H, H_theta, R) in discrete.measured.items()}
    blocks = {name: slice(k, k + 1) for k, name in enumerate(names)}
    return LinearDiscrete(discrete.F, discrete.G, B, measured, np.array(theta0), blocks)


@pytest.mark.parametrize(
    ("names", "share", "sentence"),
    [
        (
            ("springs.stiffness", "chambers.areas"),
            -1.0,
            "springs.stiffness and chambers.areas: only their ratio shows; all may grow by the "
            "same factor",
        ),
        (
            ("springs.stiffness", "chambers.areas"),
            1.0,
            "springs.stiffness and chambers.areas: only their product shows",
        ),
        (
            ("springs[1].stiffness", "springs[3].stiffness"),
            1.0,
            "springs[1].stiffness and springs[3].stiffness: only their sum or product shows",
        ),
        (
            ("springs.stiffness", "chambers.areas"),
            0.0,
            "chambers.areas: the data say nothing about it",
        ),
        (
            ("springs.stiffness", "forces[1].magnitude"),
            -0.5,
            "springs.stiffness and forces[1].magnitude: may change together without a trace, in "
            "units of their starting values: +0.5",
        ),
    ],
)
def test_what_cannot_be_told_apart_is_said_in_words(names, share, sentence):
    discrete = pair(names, share, (1.0, 1.0))
    log = toy_log(discrete, np.array([1.0, 1.0]), X0, 60)
    found = solve(build(discrete, [Experiment(log)], names))
    assert found.success and len(found.unidentifiable) == 1
    assert found.unidentifiable[0].startswith(sentence)
    lost = [share != 0.0, True]
    assert np.all(np.isinf(found.sigma) == lost)
    assert found.intervals[1, 1] == np.inf
    assert "the data tell 1 of 2 parameters or combinations" in found.message


def test_a_prior_settles_what_the_data_leave_open():
    names = ("springs.stiffness", "chambers.areas")
    discrete = pair(names, -1.0, (1.0, 1.0))
    log = toy_log(discrete, np.array([1.0, 1.0]), X0, 60)
    found = solve(build(discrete, [Experiment(log)], names, priors={names[0]: (1.1, 0.05)}))
    assert found[names[0]] == pytest.approx(1.1, rel=1e-4)
    assert np.all(np.isfinite(found.sigma)) and len(found.unidentifiable) == 1


def test_intervals_of_a_linear_model_cover_the_truth():
    discrete = toy()
    logs = [toy_log(discrete, THETA, X0, 20, seed=seed) for seed in range(200)]
    problem = build(discrete, [Experiment(logs[0])], ("a", "b"), settings=Settings(nodes=2))
    # 0.95 within 2.6 deviations of a share of 200.
    assert np.all(np.abs(covered(problem, THETA, logs) - 0.95) < 0.04)


class Bench(NamedTuple):
    """A robot to identify, and what it does with other numbers."""

    problem: Problem
    clean: Callable[[Mapping[str, float]], Log]

    def log(self, values: Mapping[str, float], seed: int = 0, noise: float = 0.01) -> Log:
        """Readings with noise."""
        return noisy(self.clean(values), {"tip": noise, "mid": noise}, seed)

    def on(self, log: Log) -> Problem:
        """The problem with another log."""
        (data,) = self.problem.data
        wanted = wanted_of(self.problem.discrete, self.problem.sensors)
        data = gridded(Experiment(log, data.x0, data.sigma), wanted)
        return replace(self.problem, data=(data,), nodes=(node_steps(data.n, 5),))


@pytest.fixture(scope="module")
def bench():
    tip, mid = Marker(name="tip", disc=4, noise=0.01), Marker(name="mid", disc=3, noise=0.01)
    scene = sensed(dtc.load_scene("seed_four_disc"), tip, mid)
    silent = sensed(scene, replace(tip, noise=1e-12), replace(mid, noise=1e-12))
    free = (*TRUE, "discs[2].mass")
    fine = silent.build(parameters=free).discrete(0.04, sensors=silent.sensors)

    @cache
    def moved(values):
        return experiment_of(silent, fine, t_end=4.0, values=dict(values))

    def clean(values):
        return moved(tuple(values.items()))

    log = noisy(clean(TRUE), {"tip": 0.01, "mid": 0.01}, 0)
    found = dtc.identify(scene, log, tuple(TRUE), settings=Settings(nodes=5))
    return Bench(found.problem, clean)


@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_intervals_of_a_robot_cover_the_truth(bench, count):
    logs = [bench.log(TRUE, seed) for seed in range(count)]
    one = bench.on(logs[0])
    share = covered(one, np.array([*TRUE.values()]), logs)
    # Of 20 draws with a chance of 0.95 each, 15 or less come up once in 390.
    assert np.all(share >= (0.9 if count == 200 else 0.8)) and np.all(share <= 1.0)
    assert count < 200 or np.all(share <= 0.99)


def test_a_wrong_model_is_noticed(bench):
    right = solve(bench.on(bench.log(TRUE, seed=5)))
    wrong = solve(bench.on(bench.log({**TRUE, "discs[2].mass": 4.0}, seed=5)))
    assert right.tests.passed and not right.tests.findings
    assert not wrong.tests.passed and wrong.tests.p_large < 1e-6
    assert any("not white" in finding for finding in wrong.tests.findings)
    assert "the residuals are not what the stated noise would leave" in wrong.message


def test_noise_overstated_is_noticed(bench):
    found = solve(bench.on(bench.log(TRUE, noise=0.004)))
    assert any("the intervals are too wide" in finding for finding in found.tests.findings)


def test_readings_in_a_mistaken_unit_are_refused(bench):
    log = bench.log(TRUE)
    channels = {n: c * (1e3 if n.startswith("tip") else 1) for n, c in log.channels.items()}
    with pytest.raises(LogError, match="tip: expected readings of about .* a thousand times"):
        check_units(bench.on(replace(log, channels=channels)))
    check_units(bench.on(log))


def test_white_noise_passes_as_often_as_it_should():
    rng = np.random.default_rng(0)
    passed = []
    for _ in range(400):
        e = rng.normal(size=(120, 3))
        passed.append(residual_tests([e], "abc", ["m"] * 3, np.ones(3), e.ravel(), 0).passed)
    # Five tests share a chance of 1 %: at most 4 false alarms of 400 are expected, 11 are 0.3 %.
    assert 400 - sum(passed) <= 11


def shots_of(one: Problem, point: Point) -> tuple[Stages, ...]:
    shots = shoot(one, point)
    assert shots is not None
    return shots


def check_derivatives(one: Problem) -> None:
    """Residuals and the motion to the next node against central differences."""
    point = simulated(one, np.array([0.1, -0.2]))
    assert point is not None
    shots = shots_of(one, point)
    step = 1e-6  # central: 1e-12 of truncation, 1e-10 of round-off over the noise of 0.01
    for j in range(len(point.nodes[0])):
        for k in range(one.n_x + one.n_p):
            ends = []
            for side in (1, -1):
                nodes, z = point.nodes[0].copy(), point.z.copy()
                if k < one.n_x:
                    nodes[j, k] += side * step
                else:
                    z[k - one.n_x] += side * step
                ends.append(shots_of(one, point._replace(z=z, nodes=(nodes,)))[0][j])
            r, x = (
                (getattr(ends[0], part) - getattr(ends[1], part)) / (2 * step)
                for part in ("r", "jump")
            )
            exact = shots[0][j]
            J = np.hstack([exact.J_s, exact.J_p])[:, k]
            F = np.hstack([exact.X, exact.G])[:, k]
            np.testing.assert_allclose(r, J, rtol=1e-5, atol=1e-5 * np.abs(exact.J_s).max())
            if j + 1 < len(point.nodes[0]):
                np.testing.assert_allclose(x, F, rtol=1e-5, atol=1e-6 * np.abs(exact.X).max())


def test_derivatives_are_those_of_differences(bench):
    check_derivatives(bench.problem)


@pytest.mark.slow
def test_derivatives_hold_where_coordinates_re_centre():
    sensors = (Marker(name="tip", disc=4, noise=0.01), IMU(name="chip", disc=3, noise=0.01))
    scene = sensed(dtc.load_scene("seed_four_disc"), *sensors)
    q0, qd0 = np.zeros(15), np.zeros(15)
    # One second thread angle beyond 45 degrees: re-centred in the first stage.
    q0[[0, 1, 6, 11]] = 0.3, 0.8, 0.5, 0.7
    scene = replace(scene, q0=q0, qd0=qd0, initial_chart="cardan", options={"chart": "cardan"})
    log = experiment(scene, 0.005, t_end=0.1)
    found = dtc.identify(scene, log, tuple(TRUE), step_s=0.0025, settings=Settings(nodes=4))
    point = simulated(found.problem, np.zeros(2))
    assert point is not None
    assert len(np.unique(point.frames[0], axis=0)) > 1  # some node has other centres
    check_derivatives(found.problem)
