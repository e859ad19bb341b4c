"""Rigid contact as it is used: starts, files, reports, what is refused."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from rigid_robots import RADIUS, G, swing

import dtcasadi as dtc
from dtcasadi import plots
from dtcasadi.cli.common import Report
from dtcasadi.cli.running import health
from dtcasadi.contact import Plates
from dtcasadi.errors import ModelError, RobotError, SimulationError, StaticsError, SweepError
from dtcasadi.sensors import IMU


def test_starts_inside_are_freed_or_refused():
    model = swing(0.0)
    run = dtc.simulate(model, [np.arcsin(0.3) + 0.2, 0.0], t_end=0.1)
    assert run.success and "moved out of contact by up to 0.2 rad" in run.message
    assert np.sin(run.q[0].max()) < 0.3 + 1e-9
    below = dtc.Obstacle(dtc.HalfSpace((0, 1.5, 0), (0, 1, 0)))
    nowhere = dtc.build(replace(model.robot, obstacles=(below,)), chart="hinge")
    text = r"got disc 2 .* m inside obstacle 1, and no way out was found"
    with pytest.raises(SimulationError, match=text):
        dtc.simulate(nowhere, [0.0, 0.0], t_end=0.1)


def test_a_tangled_start_is_pulled_apart():
    hoop = dtc.Disc.hoop(1.0, 1.0)
    robot = dtc.Robot((hoop,) * 2, (dtc.Thread(0.5),), plates=Plates(rim_points=8))
    model = dtc.build(robot, chart="planar")
    run = dtc.simulate(model, [0.0, -0.6, 0.0, 0.0], t_end=0.05)  # the far rim behind the root
    assert run.success and "moved out of contact" in run.message


def test_discs_that_touch_each_other_are_named_and_drawn():
    """They fall together: a rim point of one pushes the other's plate away."""
    hoop = dtc.Disc.hoop(1.0, 1.0)
    robot = dtc.Robot((hoop,) * 2, (dtc.Thread(0.5),), plates=Plates(rim_points=8), up=(0, 0, 1))
    model = dtc.build(robot, chart="planar")
    run = dtc.simulate(model, [0.0, 0.1, 0.0, -1.0], t_end=0.6)
    contacts = run.contacts
    assert set(zip(contacts.disc, contacts.plate, strict=True)) <= {(1, 2), (2, 1)}
    assert set(contacts.obstacle) == {0}
    figure = plots.filmstrip(run, times=[contacts.t[0]])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "contact force" in labels and "obstacle" not in labels
    arrows = [c for c in figure.axes[0].collections if isinstance(c, PolyCollection)]
    assert any(len(c.get_paths()) == 1 and c.get_zorder() == 5 for c in arrows)


def test_contacts_in_files_and_reports(tmp_path, capsys):
    run = dtc.simulate(swing(0.0, friction=0.0), np.zeros(2), t_end=0.5)
    saved = np.load(run.save(tmp_path / "run"))
    touched = saved["contact_t"] == run.t[-1]
    assert set(saved["contact_disc"]) == {2} and set(saved["contact_obstacle"]) == {1}
    # The weight's lever is longer by the radius times the sine of the angle, whose sine is 0.3.
    expected = G * (1 + RADIUS * np.tan(np.arcsin(0.3)))
    assert saved["contact_force"][touched][0] == pytest.approx([0, expected, 0], rel=1e-6)
    health(run, Report("simulate"))
    text = capsys.readouterr().out
    assert "steps, of discs 2: forces up to" in text and "friction cones to" in text
    assert "thread tension" not in text


@pytest.mark.parametrize(
    ("act", "kind", "text"),
    [
        (
            lambda: dtc.simulate(swing(0.0), [0, 0], t_end=1, method="rodas4"),
            SimulationError,
            "method: expected moreau or auto, as the scene has rigid contact",
        ),
        (lambda: dtc.equilibrium(swing(0.0)), StaticsError, "expected compliant contact"),
        (
            lambda: swing(0.0).discrete(1e-3, method="ros2"),
            ModelError,
            "method: expected moreau, as the robot has rigid contact, got 'ros2'",
        ),
        (
            lambda: swing(0.0).discrete(1e-3, sensors=(IMU(name="chip", disc=2, noise=1),)),
            ModelError,
            "robot: expected obstacles with a penetration, as it would feel impulses without",
        ),
        (
            lambda: dtc.sweep("contact/wall", {"pressure.scale": [1.0]}, step_s=1e-3),
            SweepError,
            "step_s: expected none, so that each run finds its own impulses",
        ),
        (lambda: Plates(restitution=1.5), RobotError, "restitution: expected a number from 0 to 1"),
        (
            lambda: dtc.Obstacle(dtc.Sphere((0, 0, 0), 1), restitution=-1),
            RobotError,
            "restitution: expected a finite non-negative number",
        ),
    ],
)
def test_what_is_refused(act, kind, text):
    with pytest.raises(kind, match=text):
        act()
