"""A hanging disc on a thread, seen by a marker, with a force on it: a small curved model."""

import numpy as np

import dtcasadi as dtc
from dtcasadi.sensors import Marker


def hanging(chart: str = "planar") -> dtc.DiscreteModel:
    disc = dtc.Disc.hoop(1.0, 0.2)
    points = [dtc.presets.rim(0.2, a) for a in (1.5, 3.1, 4.7)]
    springs = [dtc.Spring((1, 2), p, p, stiffness=200.0, damping=2.0) for p in points]
    robot = dtc.Robot((disc, disc), (dtc.Thread(0.5),), tuple(springs), up=np.array([0, 0, -1]))
    sensors = (Marker(name="tip", disc=2, noise=0.01),)
    model = dtc.build(robot, chart=chart, wrenches=(2,))
    return model.discrete(0.005, method="rk4", sensors=sensors)


class Still:
    """A discrete model that keeps its centres."""

    def __init__(self, discrete: dtc.DiscreteModel):
        self.recentre = lambda x, theta: (x, theta, np.eye(len(x)))
