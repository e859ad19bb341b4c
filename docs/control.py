"""Picture of the README: the tip of a tube in space, held, moved and pulled at."""

from pathlib import Path

import dtcasadi as dtc
from estimators.registry import ESTIMATORS
from estimators.scenario import discrete_of
from ocp import PressureMPC
from ocp.closed_loop import closed_loop
from ocp.plots import picture
from ocp.scenario import experiment


def draw(path: Path) -> None:
    """The scene `control/tip`, as `dtcasadi mpc control/tip --png F` draws it."""
    scene = dtc.load_scene("control/tip")
    found = experiment(scene)
    s = found.stages
    loop = closed_loop(
        PressureMPC(s.discrete, s.problem, u0=found.plant.u0),
        found.plant,
        s,
        t_end=scene.t_end,
        estimator=ESTIMATORS["ekf"].build(found.scene, discrete_of(found.scene)),
        measured=scene.control.measured,
    )
    picture(loop, path, title=scene.title)
