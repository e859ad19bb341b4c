"""Identification of a linear model against least squares in closed form."""

import numpy as np
import pytest
from recordings import toy, toy_log
from scipy.linalg import lstsq

from dtcasadi.identify import Experiment, Settings, build, solve
from dtcasadi.logs import Log

THETA, X0 = np.array([0.7, -1.2]), np.array([0.5, -0.3, 0.8])
FREE = ("a", "b")


def normal_rows(discrete, log, sigma=np.inf):
    """All readings as A [x0; theta] = y in standard deviations, written out without recursion."""
    n, n_theta = len(log.t), len(discrete.theta0)
    F, G, B = discrete.F, discrete.G, discrete.B
    rows, values = [], []
    powers = [np.linalg.matrix_power(F, k) for k in range(n)]
    for k in range(n):
        u = log.channels["command1"]
        forced = sum((powers[k - 1 - i] @ G @ [u[i]] for i in range(k)), np.zeros(3))
        by_theta = sum((powers[i] @ B for i in range(k)), np.zeros((3, n_theta)))
        for name, (H_x, H_theta, R_v) in discrete.measured.items():
            y = np.array([log.channels[f"{name}.y{i}"][k] for i in range(len(R_v))])
            block = np.hstack([H_x @ powers[k], H_x @ by_theta + H_theta])
            for i in np.flatnonzero(np.isfinite(y)):
                rows.append(block[i] / np.sqrt(R_v[i, i]))
                values.append((y[i] - (H_x @ forced)[i]) / np.sqrt(R_v[i, i]))
    if np.isfinite(sigma):
        for i in range(3):
            rows.append(np.eye(3 + n_theta)[i] / sigma)
            values.append(X0[i] / sigma)
    return np.array(rows), np.array(values)


def closed_form(*pairs):
    """Least squares of experiments with first states of their own: values and covariance."""
    n_theta = pairs[0][0].shape[1] - 3
    blocks = []
    for k, (A, _) in enumerate(pairs):
        wide = np.zeros((len(A), 3 * len(pairs) + n_theta))
        wide[:, 3 * k : 3 * k + 3], wide[:, 3 * len(pairs) :] = A[:, :3], A[:, 3:]
        blocks.append(wide)
    A, b = np.vstack(blocks), np.concatenate([b for _, b in pairs])
    return lstsq(A, b)[0][-n_theta:], np.linalg.inv(A.T @ A)[-n_theta:, -n_theta:]


@pytest.mark.parametrize("nodes", [1, 7, 60])
@pytest.mark.parametrize("begin", ["data", "simulation"])
def test_values_and_covariance_are_those_of_least_squares(nodes, begin):
    discrete = toy()
    log = toy_log(discrete, THETA, X0, 60)
    found = solve(
        build(discrete, [Experiment(log)], FREE, settings=Settings(nodes=nodes, begin=begin))
    )
    values, covariance = closed_form(normal_rows(discrete, log))
    assert found.success and found.iterations <= 4  # a linear problem, steps of limited length
    np.testing.assert_allclose(found.values, values, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9)
    half = 1.959963984540054 * np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(found.intervals, np.column_stack([values - half, values + half]))


def test_what_is_known_of_the_start_weighs():
    discrete = toy()
    log = toy_log(discrete, THETA, X0, 20)
    found = solve(build(discrete, [Experiment(log, x0=X0, sigma=0.1)], FREE))
    values, covariance = closed_form(normal_rows(discrete, log, 0.1))
    np.testing.assert_allclose(found.values, values, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9)
    A, b = normal_rows(discrete, log)
    exact = lstsq(A[:, 3:], b - A[:, :3] @ X0)[0]
    known = solve(build(discrete, [Experiment(log, x0=X0, sigma=0)], FREE))
    np.testing.assert_allclose(known.values, exact, rtol=1e-9)
    np.testing.assert_array_equal(known.x0[0], X0)


def test_several_experiments_are_one_stacked():
    discrete = toy()
    logs = [toy_log(discrete, THETA, k * X0, 20 + 10 * k, seed=k) for k in (1, 2, 3)]
    found = solve(build(discrete, [Experiment(log) for log in logs], FREE))
    values, covariance = closed_form(*(normal_rows(discrete, log) for log in logs))
    np.testing.assert_allclose(found.values, values, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9)


def test_missing_readings_have_no_weight_and_are_counted():
    discrete = toy()
    log = toy_log(discrete, THETA, X0, 40)
    channels = {name: column.copy() for name, column in log.channels.items()}
    channels["left.y0"][5:15] = np.nan
    channels["right.y0"][::2] = np.nan
    gappy = Log(log.t, channels, log.units, "gappy")
    found = solve(build(discrete, [Experiment(gappy)], FREE))
    values, covariance = closed_form(normal_rows(discrete, gappy))
    np.testing.assert_allclose(found.values, values, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9)
    counts = found.problem.data[0].counts
    assert counts["left.y0"] == (31, 10, 0) and counts["right.y0"] == (20, 21, 0)


def test_a_prior_is_a_reading_of_the_parameter():
    discrete = toy()
    log = toy_log(discrete, THETA, X0, 20)
    found = solve(build(discrete, [Experiment(log)], FREE, priors={"a": (2.0, 0.01)}))
    A, b = normal_rows(discrete, log)
    A, b = np.vstack([A, [0, 0, 0, 100, 0]]), np.append(b, 200)
    np.testing.assert_allclose(found.values, lstsq(A, b)[0][3:], rtol=1e-9)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(A.T @ A)[3:, 3:], rtol=1e-9)


def test_bounds_hold_and_the_rest_is_fitted_beside_them():
    discrete = toy()
    log = toy_log(discrete, THETA, X0, 40)
    found = solve(build(discrete, [Experiment(log)], FREE, bounds={"b": (-0.5, None)}))
    assert found.values[1] == pytest.approx(-0.5, abs=1e-12) and found.at_bound == ("b",)
    A, b = normal_rows(discrete, log)
    alone = lstsq(A[:, :4], b + 0.5 * A[:, 4])[0][3]
    assert found.values[0] == pytest.approx(alone, rel=1e-9)
    assert found.covariance[1, 1] == 0


def test_huber_ignores_outliers_that_pull_least_squares_away():
    discrete = toy()
    log = toy_log(discrete, THETA, X0, 200)
    channels = {name: column.copy() for name, column in log.channels.items()}
    rng = np.random.default_rng(3)
    hit = rng.random(201) < 0.05
    channels["right.y0"][hit] += 20.0
    spoiled = [Experiment(Log(log.t, channels, log.units, "spoiled"))]
    clean = solve(build(discrete, [Experiment(log)], FREE))
    huber = solve(build(discrete, spoiled, FREE, settings=Settings(loss="huber")))
    squares = solve(build(discrete, spoiled, FREE))
    assert huber.success
    off = np.abs(huber.values - THETA) / clean.sigma
    assert np.all(off < 4) and np.any(np.abs(squares.values - THETA) / clean.sigma > 20)
    assert np.all(huber.sigma > clean.sigma) and np.all(huber.sigma < 1.5 * clean.sigma)
    assert any(f"{hit.sum()} of 603 readings are outliers" in note for note in huber.notes)
    assert huber.tests.passed and not squares.tests.passed


def test_a_full_covariance_of_the_noise_counts_as_it_should():
    discrete = toy()
    H_x, H_theta, _ = discrete.measured["left"]
    R_v = np.array([[0.01, 0.015], [0.015, 0.04]])
    from dataclasses import replace

    full = replace(discrete, measured={"left": (H_x, H_theta, R_v)})
    log = toy_log(full, THETA, X0, 50)
    found = solve(build(full, [Experiment(log)], FREE))
    L = np.linalg.cholesky(R_v)
    unit = replace(discrete, measured={"left": (H_x, H_theta, np.eye(2))})
    A, b = normal_rows(unit, log)
    apart = [np.linalg.solve(L, part.reshape(-1, 2, k)) for part, k in ((A, 5), (b, 1))]
    A, b = apart[0].reshape(-1, 5), apart[1].ravel()
    np.testing.assert_allclose(found.values, lstsq(A, b)[0][3:], rtol=1e-9)
