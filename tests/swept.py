"""Shared by the tests of sweeps: a small robot, executors that lose work, and a sweep to kill."""

import sys
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from typing import Any

import numpy as np

import dtcasadi as dtc


def scene_of(t_end: float = 0.2, **changes) -> dtc.Scene:
    """The paper's robot with two discs and less damping, so that explicit steps are stable."""
    seed = dtc.load_scene("seed_four_disc")
    robot = replace(
        seed.robot,
        discs=seed.robot.discs[:2],
        threads=seed.robot.threads[:1],
        springs=seed.robot.springs[:3],
        chambers=(dtc.Chamber((1, 2)),),
        damping=dtc.Damping(c_a=1.0, c_b=1.0, c_w=1.0),
    )
    profile = dtc.Profile(np.array([0.0, 0.05, 0.12]), np.array([2.0, 6.0, 6.0]), "linear")
    start: dict[str, Any] = {"q0": np.full(2, 0.1), "qd0": np.zeros(2), "initial_chart": "planar"}
    fields: dict[str, Any] = {"robot": robot, "t_end": t_end, "pressure": profile, **start}
    return replace(seed, **fields | changes)


class Forgetful(Executor):
    """Computes here, at once, and loses what `loses` says by the number of the call."""

    def __init__(self, loses, error: Exception | None = None):
        self.loses, self.error, self.calls = loses, error or BrokenProcessPool("gone"), 0
        self.rows: list[int] = []

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        self.calls += 1
        if self.loses(self.calls, args[-1]):
            future.set_exception(self.error)
        else:
            future.set_result(fn(*args))
            self.rows.append(len(args[-1]))
        return future


OVER = {"pressure": np.linspace(0, 8, 400)}
SETTINGS: dict[str, Any] = {"step_s": 2e-4, "method": "euler", "save": ["x"], "workers": 1}

if __name__ == "__main__":  # for a test that kills it
    from dtcasadi.sweep import front, store

    store.EVERY_S = store.SHARE = 0.0
    front.TOGETHER = 16
    dtc.sweep(scene_of(), OVER, output=sys.argv[1], **SETTINGS)
