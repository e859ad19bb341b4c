"""The adviser's promise in twelve scenes, each against a model four times as fine as its finest."""

from dataclasses import replace

import numpy as np
import pytest
from advised import distance_over_range, tip_path, tube
from c_compilers import needs_compiler

import dtcasadi as dtc
from dtcasadi.advise.candidate import Candidate
from dtcasadi.advise.lab import Lab

pytestmark = [pytest.mark.slow, needs_compiler]
TOLERANCE = 0.02


def rod(**changes) -> dtc.Scene:
    """An elastic cantilever that falls from level, in the plane."""
    fields = {"payload": 0.0, "retardation_time": 0.2, **changes}
    beam = dtc.Robot.from_rod(1.0, 1.0, 400.0, 1.0, 1.0, 5, gravity=5.0, up=(0, 1, 0), **fields)
    scene = tube(chart="planar")
    from dtcasadi.rod import Rod

    own = Rod(1.0, 1.0, 400.0, 1.0, 1.0, gravity=5.0, up=(0, 1, 0), **fields)
    return replace(
        scene,
        name="rod",
        robot=beam,
        beam=own,
        pressure=dtc.Profile.constant(np.zeros(0)),
        options={"chart": "planar"},
        t_end=1.5,
    )


SCENES = {
    "planar tube": lambda: tube(chart="planar"),
    "slow": lambda: tube(chart="planar", ramp=20, t_end=25),
    "fast": lambda: tube(chart="planar", ramp=0.02, t_end=0.5),
    "heavy payload": lambda: tube(chart="planar", payload=0.05),
    "viscous": lambda: tube(chart="planar", retardation=0.3),
    "hanging up": lambda: tube(chart="planar", up=1, pressure=15),
    "falling rod": rod,
    "rod with payload": lambda: rod(payload=0.5),
    "paper's robot": lambda: dtc.load_scene("seed_four_disc"),
    "thread below": lambda: replace(dtc.load_scene("seed_four_disc_force"), t_end=5.0),
    "twisted strip": lambda: tube(twist=90, t_end=0.6),
    "in space, slow": lambda: tube(twist=45, ramp=5, t_end=6, retardation=0.1),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_promise(name):
    scene = SCENES[name]()
    advice = dtc.advise(scene, TOLERANCE)
    assert advice.best is not None and advice.reference.converged
    finer = None if scene.beam is None else 4 * (advice.reference.candidate.n_discs - 1)
    settings = {"method": "rodas4", "rtol": 1e-5, "atol": 1e-7}  # a thousandth of the tolerance
    fine = scene if finer is None else scene.rediscretised(finer + 1)
    lab = Lab(scene, "tip", TOLERANCE)
    truth = tip_path(fine, lab.times, **settings)

    def true_error(candidate: Candidate) -> float:
        return distance_over_range(lab.path(candidate).points[:, 0], truth, lab.length)

    assert true_error(advice.best.candidate) <= TOLERANCE
    for one in advice.candidates:
        if one.cost <= 0.5 * advice.best.cost and not one.failure:
            assert true_error(one.candidate) > TOLERANCE, one
