"""A tumbling run that no single chart holds, against maximal coordinates with constraints."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracles.chain import cartesian_velocities, spread
from oracles.maximal import Maximal
from oracles.robots import random_robot

import dtcasadi as dtc
from dtcasadi.commands import command_pieces
from dtcasadi.integrators import METHODS, Problem
from dtcasadi.recentring import LIMIT, unwound
from dtcasadi.robot import Damping

N, CHARTS = 3, spread("cardan", 3)


@cache
def model() -> dtc.Model:
    """Offset bodies with full tensors on two springs a segment, every kind of damping but little.

    Damping of every kind takes a third of the energy in the run, so that a wrong wrench is seen.
    """
    rng = np.random.default_rng(1)
    robot = random_robot(rng, N)
    return dtc.build(
        replace(
            robot,
            chambers=(),
            springs=tuple(replace(spring, damping=0.01) for spring in robot.springs),
            damping=tuple(Damping(*rng.uniform(0.01, 0.05, 4)) for _ in range(N - 1)),
        )
    )


@cache
def start() -> np.ndarray:
    rng = np.random.default_rng(6)
    return np.concatenate([rng.uniform(-0.6, 0.6, 10), rng.uniform(-3.0, 3.0, 10)])


@cache
def tumbling(t_end: float, rtol: float, method: str = "tsit5") -> dtc.Run:
    run = dtc.simulate(model(), start(), t_end=t_end, method=method, rtol=rtol, atol=rtol)
    assert run.success, run.message
    return run


def gaps(run: dtc.Run, rtol: float, samples: int) -> np.ndarray:
    """Largest differences in positions [m], rotations and energy [J] at some of the steps."""
    m, at = run.model, np.unique(np.linspace(0, len(run.t) - 1, samples).astype(int))
    R, r = run.poses(at)
    v, w = (part.full().T for part in cartesian_velocities(m.robot, CHARTS)(*np.split(start(), 2)))
    oracle = Maximal(m.robot)
    states = oracle.run(oracle.state(R[0], r[0], v, w), run.t[at], rtol)
    rows = []
    for y, turn, origin, k in zip(states, R, r, at, strict=True):
        kinetic = m.kinetic_energy(run.q[:, k], run.qd[:, k], run.thetas[:, k])
        total = float(kinetic + m.potential_energy(run.q[:, k], run.thetas[:, k]))
        rows.append(
            [
                np.max(np.abs(oracle.origins(y) - origin)),
                np.max(np.abs(oracle.bodies(y).R - turn)),
                abs(oracle.energy(y) - total),
            ]
        )
    return np.max(rows, axis=0)


def test_agrees_with_maximal_coordinates():
    """To 1e-6: the tolerances of 1e-9 times the growth of neighbouring motions, 1e2 here."""
    run = tumbling(1.5, 1e-9)
    assert len(run.recentrings) > 5
    assert {segment for _, segments in run.recentrings for segment in segments} == {1, 2}
    assert np.max(gaps(run, 1e-9, 10)) < 1e-6
    energy = run.energy
    assert energy["dissipated"][-1] > 0.2 * np.ptp(energy["kinetic"])
    assert np.max(np.abs(energy["residual"])) < 1e-7


@pytest.mark.slow
def test_agrees_with_maximal_coordinates_for_longer():
    run = tumbling(4.0, 1e-11)
    assert len(run.recentrings) > 25
    assert np.max(gaps(run, 1e-11, 40)) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rodas4", "auto"])
def test_other_methods_agree(method):
    """At 1e-9 the orders 4 and 5 end 1e-6 apart; both are within 1e-5 of the finer run."""
    run, fine = tumbling(1.5, 1e-9, method), tumbling(1.5, 1e-11)
    last = [r.poses(np.array([len(r.t) - 1])) for r in (run, fine)]
    for value, expected in zip(*last, strict=True):
        assert np.max(np.abs(value - expected)) < 1e-5
    assert len(run.recentrings) > 5


def test_no_single_chart_holds_it():
    """About the robot's own centres, both spatial charts come close to their singularities."""
    run = tumbling(1.5, 1e-9)
    k = slice(None, None, 5)
    q, _ = unwound(run.model, run.x[:, k], run.thetas[:, k], "cardan")
    angles = q.reshape(2, 5, -1)
    assert np.min(np.abs(np.cos(angles[:, [1, 3]]))) < 0.05
    q, _ = unwound(run.model, run.x[:, k], run.thetas[:, k], "paper")
    angles = q.reshape(2, 5, -1)
    assert min(np.min(np.abs(np.sin(angles[:, 1]))), np.min(np.abs(np.cos(angles[:, 3])))) < 0.05
    # Re-centred, the middle angles stay near 45 degrees and no pose is singular.
    middle = run.q.reshape(2, 5, -1)[:, [1, 3]]
    assert np.max(np.abs(middle)) < LIMIT + 0.05
    assert np.max(run.condition) < 5e3


def test_poses_are_continuous_across_recentrings():
    """The state before and after each, through its own A and B: the same discs, to round-off."""
    m = model()
    problem = Problem(m, start(), m.theta0, command_pieces(0.0, m.n_u, 1.5), 1e-9, 1e-9)
    run = METHODS["tsit5"].integrate(problem)
    assert not run.failure and len(run.recentrings) > 5
    n = m.n_q
    for time, segments in run.recentrings:
        k = int(np.flatnonzero(run.t == time)[0])
        before, after = run.x_end[:, k - 1], run.x[:, k]
        old, new = run.thetas[:, k - 1], run.thetas[:, k]
        for segment in segments:
            place = slice(5 * segment - 5, 5 * segment)
            assert not np.any(after[place]) and np.max(np.abs(before[place][[1, 3]])) > LIMIT
        for value, expected in zip(m.poses(after[:n], new), m.poses(before[:n], old), strict=True):
            assert np.max(np.abs(np.array(value - expected))) < 1e-13
        energies = [
            float(m.kinetic_energy(x[:n], x[n:], theta) + m.potential_energy(x[:n], theta))
            for x, theta in ((before, old), (after, new))
        ]
        assert energies[1] == pytest.approx(energies[0], rel=1e-12)


def test_the_oracle_conserves_and_keeps_its_threads():
    """Without damping: its energy to its tolerance, and threads to Baumgarte's share of that."""
    robot = model().robot
    free = replace(
        robot,
        damping=Damping(),
        springs=tuple(replace(spring, damping=0.0) for spring in robot.springs),
    )
    oracle, m = Maximal(free), model()
    R, r = (np.array(part) for part in m.poses(start()[:10], m.theta0))
    v, w = (part.full().T for part in cartesian_velocities(robot, CHARTS)(*np.split(start(), 2)))
    y = oracle.state(R.reshape(3, N, 3).transpose(1, 0, 2), r.T, v, w)
    states = oracle.run(y, np.linspace(0.0, 0.5, 4), 1e-9)
    energies = [oracle.energy(state) for state in states]
    assert np.ptp(energies) < 1e-6 * abs(energies[0])
    for state in states:
        b, origins = oracle.bodies(state), oracle.origins(state)
        for i, thread in enumerate(free.threads):
            gap = origins[i + 1] - origins[i] - b.R[i] @ thread.exit_point
            assert np.linalg.norm(gap) == pytest.approx(thread.length, abs=1e-8)
