"""Where the paper's robot rests, how far pressure can lift it, and an arch that snaps through.

python examples/equilibria.py writes two pictures into the current folder.
"""

import numpy as np

import dtcasadi as dtc
from dtcasadi import presets
from dtcasadi.statics import plots


def robot_at_rest() -> None:
    """One equilibrium with its stability, then all of them along the pressure."""
    model = dtc.build(presets.seed_four_disc(), chart="planar")
    found = dtc.equilibrium(model, 12.0)
    print(found.message)
    print(
        "slowest eigenvalue", found.eigenvalues[0], "1/s; threads pull", found.thread_tension, "N"
    )

    curve = dtc.branch(model, "pressure", 0.5, 20.0)
    print(curve.message)
    for event in curve.events:
        print(f"  {event.kind} at {event.s:.6g} Pa")
    plots.diagram(curve, "equilibria.png")


def arch() -> None:
    """A link that a spring in compression keeps off its own line: it snaps to the other side."""
    disc = dtc.Disc(1.0, 0.1 * np.eye(3))
    spring = dtc.Spring((1, 2), [0.0, 0.0, 1.6], [0.0, 0.0, 0.0], 50.0, rest_length=0.87)
    robot = dtc.Robot((disc, disc), (dtc.Thread(1.0),), (spring,), gravity=0.0)
    model = dtc.build(robot, chart="hinge", wrenches=[2])
    path = dtc.branch(model, "wrench[2]", 0.0, 12.0, guess=[0.5], back_to=-12.0)
    print(path.message)
    for event in path.events:
        print(f"  {event.kind} point at {event.s:+.4f} N")
    plots.diagram(path, "snap_through.png")


if __name__ == "__main__":
    robot_at_rest()
    arch()
