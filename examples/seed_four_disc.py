"""The paper's four-disc robot: simulate it, print what it does, draw it.

python examples/seed_four_disc.py writes into the current folder. DTCASADI_SHORT=1 stops after one
second of motion.
"""

import os

import numpy as np

import dtcasadi as dtc
from dtcasadi import plots


def main() -> None:
    """Run the example."""
    short = os.environ.get("DTCASADI_SHORT") == "1"
    scene = dtc.load_scene("seed_four_disc")
    run = dtc.simulate(scene, t_end=1.0 if short else scene.t_end)
    print(run.message)

    # Frames of the discs in the root frame; the centre of disc 4 lies at radius * y in its own.
    R, r = run.poses()
    centre = r[:, -1] + R[:, -1] @ scene.robot.discs[-1].centre_of_mass
    height = centre @ scene.robot.up
    print("   t [s]  height of disc 4 [m]")
    for t in np.arange(0.0, run.t[-1] + 1e-9, 0.25 if short else 1.0):
        print(f"{t:8.2f}  {np.interp(t, run.t, height):20.3f}")
    print(f"energy balance closed to {np.abs(run.energy['residual']).max():.1e} J")

    plots.filmstrip(run, "seed_four_disc.png")
    print("drawn: seed_four_disc.png")


if __name__ == "__main__":
    main()
