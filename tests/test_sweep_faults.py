"""dtcasadi.sweep: killed processes, broken executors, files of other sweeps; nothing twice."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import CancelledError

import numpy as np
import pytest
import swept
from c_compilers import needs_cxx
from swept import Forgetful, scene_of

import dtcasadi as dtc
from dtcasadi.errors import SweepError
from dtcasadi.sweep import front, schedule, store

pytestmark = needs_cxx


@pytest.fixture
def received(monkeypatch) -> list[int]:
    """Every row that comes in, in order."""
    rows: list[int] = []
    original = store.Store.receive

    def receive(self, chunk, found):
        rows.extend(chunk.tolist())
        original(self, chunk, found)

    monkeypatch.setattr(store.Store, "receive", receive)
    return rows


def assert_same(found: dtc.Sweep, whole: dtc.Sweep) -> None:
    assert np.array_equal(found.status, whole.status)
    for name, values in whole.columns.items():
        assert np.array_equal(found[name], values), name


def test_a_killed_sweep_goes_on_from_its_file(tmp_path, received):
    whole = dtc.sweep(scene_of(), swept.OVER, **swept.SETTINGS)
    received.clear()
    output = tmp_path / "results.npz"
    path = os.pathsep.join(sys.path)
    process = subprocess.Popen(
        [sys.executable, swept.__file__, str(output)], env={**os.environ, "PYTHONPATH": path}
    )
    made = np.zeros(0)
    while process.poll() is None and made.sum() < 40:
        if output.exists():
            made = np.load(output)["status"] == 0
        time.sleep(0.01)
    process.kill()
    process.wait()
    made = np.load(output)["status"] == 0
    assert 40 <= made.sum() < 400, "killed in the middle"
    assert [file.name for file in tmp_path.iterdir() if "." not in file.name[:1]] == [output.name]
    found = dtc.sweep(scene_of(), swept.OVER, output=output, **swept.SETTINGS)
    assert sorted(received) == np.flatnonzero(~made).tolist()
    assert_same(found, whole)
    received.clear()
    again = dtc.sweep(scene_of(), swept.OVER, output=output, **swept.SETTINGS)
    assert not received
    assert_same(again, whole)


def test_a_worker_killed_on_this_machine(monkeypatch, received):
    whole = dtc.sweep(scene_of(), swept.OVER, **swept.SETTINGS)
    received.clear()
    pools = []
    original = schedule.local_pool

    def killed(workers):
        pool = original(workers)
        pools.append(workers)
        if len(pools) == 1:
            pool.submit(time.sleep, 0)  # starts a process
            os.kill(next(iter(pool._processes)), signal.SIGKILL)
        return pool

    monkeypatch.setattr(schedule, "local_pool", killed)
    found = dtc.sweep(scene_of(), swept.OVER, **swept.SETTINGS | {"workers": 2})
    assert len(pools) > 1
    assert sorted(received) == list(range(400))
    assert_same(found, whole)


def test_a_chunk_that_raises_is_halved_down_to_the_run_to_blame(received):
    whole = dtc.sweep(scene_of(), swept.OVER, **swept.SETTINGS)
    received.clear()
    guilty = swept.OVER["pressure"][123]
    executor = Forgetful(lambda call, inputs: guilty in inputs, MemoryError("no room"))
    found = dtc.sweep(scene_of(), swept.OVER, executor=executor, **swept.SETTINGS)
    assert sorted(received) == list(range(400))
    assert found.status[123] == 2 and found.reason[123] == "MemoryError: no room"
    others = np.arange(400) != 123
    assert np.array_equal(found["x.final"][others], whole["x.final"][others])
    assert np.isnan(found["x.final"][123]).all()


def test_lost_runs_are_made_when_the_sweep_is_called_again(tmp_path, received):
    output = tmp_path / "r.npz"
    over = {"pressure": np.linspace(0, 8, 20)}
    lossy = Forgetful(lambda call, inputs: 0.0 in inputs, MemoryError("no room"))
    found = dtc.sweep(scene_of(), over, output=output, executor=lossy, **swept.SETTINGS)
    assert found.status.tolist() == [2] + [0] * 19
    received.clear()
    found = dtc.sweep(scene_of(), over, output=output, **swept.SETTINGS)
    assert received == [0] and found.success.all()


def test_a_broken_executor_keeps_what_is_done(tmp_path, received):
    output = tmp_path / "r.npz"
    executor = Forgetful(lambda call, inputs: call > 2)
    with pytest.raises(SweepError, match="executor: expected one that takes work, got a broken"):
        dtc.sweep(scene_of(), swept.OVER, output=output, executor=executor, **swept.SETTINGS)
    done = np.load(output)["status"] == 0
    assert 0 < done.sum() == len(received) < 400
    cancelled = Forgetful(lambda call, inputs: True, CancelledError())
    with pytest.raises(SweepError, match="executor: .* got a cancelled run"):
        dtc.sweep(scene_of(), swept.OVER, output=output, executor=cancelled, **swept.SETTINGS)
    dtc.sweep(scene_of(), swept.OVER, output=output, **swept.SETTINGS)
    assert sorted(received) == list(range(400))


def test_a_file_of_another_sweep_is_kept(tmp_path):
    output = tmp_path / "r.npz"
    settings = {**swept.SETTINGS, "output": output}
    dtc.sweep(scene_of(), {"pressure": [1.0]}, **settings)
    before = output.read_bytes()
    for changes in ({"pressure": [2.0]}, {"pressure": [1.0, 2.0]}, {"payload": [1.0]}):
        with pytest.raises(SweepError, match="expected the results of this sweep, got another"):
            dtc.sweep(scene_of(), changes, **settings)
    with pytest.raises(SweepError, match="got another one"):
        dtc.sweep(scene_of(t_end=0.1), {"pressure": [1.0]}, **settings)
    assert output.read_bytes() == before
    dtc.sweep(scene_of(), {"pressure": [2.0]}, overwrite=True, **settings)
    assert np.load(output)["inputs"].tolist() == [[2.0]]
    for content in (b"", b"not a zip", before[:200]):
        output.write_bytes(content)
        with pytest.raises(SweepError, match="got something else; name another file"):
            dtc.sweep(scene_of(), {"pressure": [1.0]}, **settings)
        assert output.read_bytes() == content


def test_a_file_that_cannot_be_written_is_said_first(tmp_path, received):
    with pytest.raises(FileNotFoundError):
        dtc.sweep(scene_of(), {"pressure": [1.0]}, output=tmp_path / "no" / "r.npz", workers=1)
    assert not received


def test_an_interrupt_leaves_what_is_done(tmp_path, monkeypatch):
    output, original = tmp_path / "r.npz", schedule.compute
    calls = []

    def interrupted(job, inputs):
        calls.append(len(inputs))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return original(job, inputs)

    monkeypatch.setattr(schedule, "compute", interrupted)
    with pytest.raises(KeyboardInterrupt):
        dtc.sweep(scene_of(), swept.OVER, output=output, **swept.SETTINGS)
    assert (np.load(output)["status"] == 0).sum() == sum(calls[:2])


def test_a_script_without_a_main_guard_is_told(monkeypatch):
    monkeypatch.setattr(
        schedule.multiprocessing.current_process(), "_inheriting", True, raising=False
    )
    with pytest.raises(SweepError, match='expected a call under `if __name__ == "__main__":`'):
        dtc.sweep(scene_of(), swept.OVER, **swept.SETTINGS | {"workers": 2})


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of another package and its dependencies
def test_a_dask_cluster_that_loses_a_worker(received):
    distributed = pytest.importorskip("distributed")
    over = {"pressure": np.linspace(0, 8, 1200)}
    whole = dtc.sweep(scene_of(), over, **swept.SETTINGS)
    received.clear()
    options = {"n_workers": 3, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(processes=True, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = client.run(os.getpid)
        assert len(set(pids.values())) == 3 and os.getpid() not in pids.values()
        killed: list[int] = []
        original = store.Store.receive

        def receive(self, rows, found):
            original(self, rows, found)
            if not killed:
                killed.append(next(iter(pids.values())))
                os.kill(killed[0], signal.SIGKILL)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(store.Store, "receive", receive)
            patch.setattr(front, "TOGETHER", 16)
            executor = client.get_executor()
            found = dtc.sweep(scene_of(), over, executor=executor, **swept.SETTINGS)
    assert killed
    assert sorted(received) == list(range(1200))
    assert_same(found, whole)
