"""Bend of a hanging tube by its pressure, from a model that is not the robot.

Runs the scene `control/bend`: the controller knows four discs, the robot has eight, is stiffer,
heavier and late; a filter tells the controller where the robot is and what pulls at it. Three bends
are held, a fourth is followed slowly, then something pulls the tip aside. Prints the errors and
draws it: `python examples/pressure_control.py picture.png`.
"""

import os
import sys

import numpy as np

import dtcasadi as dtc
from estimators import EKF
from estimators.scenario import discrete_of, knowledge
from ocp import PressureMPC
from ocp.closed_loop import closed_loop
from ocp.plots import picture
from ocp.scenario import experiment, spans

T_END = 5.0 if os.environ.get("DTCASADI_SHORT") else 16.0


def main(target: str, t_end: float) -> None:
    """Run the experiment and draw it."""
    scene = dtc.load_scene("control/bend")
    found = experiment(scene)  # the problem on the controller's model, and the true robot
    discrete = discrete_of(found.scene)
    known = knowledge(found.scene, discrete)
    ekf = EKF(
        discrete,
        x0=known.x0,
        P0=known.P0,
        Q_w=known.Q_w,
        augment=known.augment,
        gate=known.gate,
    )
    mpc = PressureMPC(found.stages.discrete, found.stages.problem, u0=found.plant.u0)
    loop = closed_loop(
        mpc,
        found.plant,
        found.stages,
        t_end=t_end,
        estimator=ekf,
        measured=scene.control.measured,
    )
    rests, moves = spans(scene.control.reference, t_end)
    for t_from, t_to in rests:
        error = np.rad2deg(loop.steady(t_from, t_to))
        print(f"held from {t_from:.2f} to {t_to:.2f} s: {error:.2f} degrees off")
    for t_from, t_to in moves:
        rms = np.rad2deg(loop.rms(t_from, t_to))
        print(f"followed from {t_from:.2f} to {t_to:.2f} s: {rms:.2f} degrees rms")
    print(f"limits violated {loop.violations} times; {loop.told[-1].text}")
    picture(loop, target, title=scene.title)
    print("drawn:", target)


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "pressure_control.png",
        float(sys.argv[2]) if len(sys.argv) > 2 else T_END,
    )
