"""Drops against MuJoCo: how much the two contact models differ, and why."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

import numpy as np
import pytest

import dtcasadi as dtc

pytest.importorskip("mujoco")

from oracles.mujoco_drop import dropped  # noqa: E402


def test_a_chain_falls_on_a_floor_as_in_mujoco():
    """Two hoops on hinges hit a floor one after the other, slide and come to rest.

    In free flight both differ by this method's first order, 3e-4 rad at steps of 0.2 ms. MuJoCo's
    contact is a critically damped constraint that yields: where points hit at 3 m/s with a time
    constant of 5 ms, they go on for 3 m/s times some milliseconds, 0.03 rad, which a stiffer
    constraint does not remove, as it throws points back where Moreau's law stops them. At rest its
    constraint stands lower by the acceleration of gravity times that constant squared, 2.5e-4 m;
    the rest of the pose agrees.
    """
    floor = dtc.Obstacle(dtc.HalfSpace((0, -0.5, 0), (0, 1, 0)), friction=0.4, rim_points=4)
    hoop = dtc.Disc.hoop(1.0, 0.3)
    robot = dtc.Robot((hoop,) * 3, (dtc.Thread(0.8),) * 2, obstacles=(floor,))
    model = dtc.build(robot, chart="hinge")
    x0 = np.array([0.1, -0.2, 0.0, 0.0])
    t = np.linspace(0.0, 0.6, 13)
    run = dtc.simulate(model, x0, t_end=0.6, step_s=2e-4)
    mine = run.at(t).q
    for time_constant, at_rest in ((5e-3, 5e-4), (1e-3, 2e-5)):
        theirs = dropped(robot, ("hinge",) * 2, x0, t, time_constant)
        off = np.max(np.abs(mine - theirs), axis=0)
        assert np.max(off[:6]) < 3e-4  # before the first hit
        assert np.max(off) < 0.04
        assert off[-1] < at_rest
    assert np.ptp(mine[0]) > 0.5 and run.touched.loss.min() < -0.1
