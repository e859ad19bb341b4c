"""`dtcasadi.Run`: what it gives access to and what it saves."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

import dataclasses

import numpy as np
import pytest
from moving import cranked, full, full_theta, seed, seed_x0, swift
from oracles.cases import numbers

import dtcasadi as dtc


@pytest.fixture(scope="module")
def regulated() -> dtc.Run:
    """One coordinate and a lagging pressure: the state holds three kinds of numbers."""
    model = cranked("regulator")
    profile = dtc.Profile([0.0, 0.3], [12.0, 20.0])
    return dtc.simulate(model, [0.1, 0.2, 3.0], pressure=profile, t_end=0.5, method="DOP853")


@pytest.fixture(scope="module")
def re_centred() -> dtc.Run:
    start = {"x0": swift(full()), "theta": full_theta(), "t_end": 0.5}
    return dtc.simulate(full(), pressure=[3.0, 2.0, 1.0], **start, method="tsit5")


@pytest.fixture(scope="module")
def failed() -> dtc.Run:
    start = {"x0": seed_x0(), "pressure": 12.0, "t_end": 10.0}
    return dtc.simulate(seed(), **start, method="rk4", step_s=0.1, force=True)


def test_parts_of_the_state(regulated):
    run, n = regulated, len(regulated.t)
    assert run.x.shape == (3, n) and run.y is run.x
    assert np.array_equal(run.q, run.x[:1]) and np.array_equal(run.qd, run.x[1:2])
    assert np.array_equal(run.pressure, run.x[2:])
    assert run.u.shape == (1, n) and set(run.u[0]) == {12.0, 20.0}
    assert run.x[:, 0].tolist() == [0.1, 0.2, 3.0]
    assert run.step_sizes == pytest.approx(np.diff(run.t))
    assert run.wall_time > 0 and run.steps == n - 1


def test_its_arrays_do_not_change_with_the_start():
    x0 = seed_x0()
    run = dtc.simulate(seed(), x0, t_end=0.01, method="rk4", step_s=1e-3)
    x0[:] = 9.0
    assert np.array_equal(run.x[:, 0], seed_x0())
    with pytest.raises(dataclasses.FrozenInstanceError):
        run.success = False


def test_poses_are_the_models(re_centred):
    run = re_centred
    assert run.recentrings and len(np.unique(run.thetas, axis=1).T) > 1
    R, r = run.poses()
    n = len(run.t)
    assert R.shape == (n, 3, 3, 3) and r.shape == (n, 3, 3)
    for k in (0, n // 2, n - 1):
        expected = numbers(full().poses, run.q[:, k], run.thetas[:, k])
        assert np.array_equal(np.hstack(list(R[k])), expected[0])
        assert np.array_equal(r[k].T, expected[1])
    # Continuous over a re-centring, which the coordinates are not.
    assert np.max(np.abs(np.diff(r, axis=0))) < 0.5 < np.max(np.abs(np.diff(run.q)))
    some = run.poses(np.array([0, n - 1]))
    assert np.array_equal(some[0], R[[0, n - 1]]) and np.array_equal(some[1], r[[0, n - 1]])
    assert [part.shape for part in run.poses(np.array([], dtype=int))] == [(0, 3, 3, 3), (0, 3, 3)]


SAVED = (
    *("t", "x", "u", "q", "qd", "pressure", "thetas", "success", "message", "method"),
    *("condition", "steps", "rejected", "evaluations", "wall_time"),
)


@pytest.mark.parametrize("which", ["regulated", "re_centred", "failed"])
def test_saved_and_loaded(tmp_path, request, which):
    run = request.getfixturevalue(which)
    path = run.save(tmp_path / "run.npz")
    assert path == tmp_path / "run.npz"
    with np.load(path) as file:  # arrays only: nothing in it may need pickle
        saved = dict(file)
    for name in SAVED:
        assert np.array_equal(saved[name], getattr(run, name)), name
    for name, values in run.energy.items():
        assert np.array_equal(saved[f"energy_{name}"], values, equal_nan=True)
    assert saved["recentrings"].tolist() == [time for time, _ in run.recentrings]
    segments = [tuple(row[row > 0]) for row in saved["recentred_segments"]]
    assert segments == [segments for _, segments in run.recentrings]
    assert tuple(saved["state_names"]) == run.model.state_names
    assert saved["success"] == (which != "failed") and str(saved["message"]) == run.message


@pytest.mark.parametrize(
    ("given", "name"), [("run", "run.npz"), ("run.npz", "run.npz"), ("run.v2", "run.v2.npz")]
)
def test_the_files_name(tmp_path, regulated, given, name):
    assert regulated.save(str(tmp_path / given)) == tmp_path / name
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_a_failure_leaves_the_old_file(tmp_path, regulated, monkeypatch):
    path = regulated.save(tmp_path / "run.npz")
    before = path.read_bytes()

    def breaks(file, **arrays):
        file.write(b"half of it")
        raise OSError("no space left on device")

    monkeypatch.setattr(np, "savez_compressed", breaks)
    with pytest.raises(OSError, match="no space left"):
        regulated.save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]


def test_places_that_cannot_be_written(tmp_path, regulated):
    with pytest.raises(FileNotFoundError, match="nowhere/run.npz"):
        regulated.save(tmp_path / "nowhere" / "run.npz")
    with pytest.raises(IsADirectoryError, match=tmp_path.name):
        regulated.save(tmp_path)
    assert not list(tmp_path.iterdir())
