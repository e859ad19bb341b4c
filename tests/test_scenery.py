"""Obstacles in scene files and pictures: values in SI units, outlines, arrows, what is refused."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace

import drawn_runs
import numpy as np
import pytest
from scene_texts import SMALL, errors_of, parse

import dtcasadi as dtc
from dtcasadi import drawing, plots, scenery
from dtcasadi.motion import Motion
from dtcasadi.rim import rim_points

OBSTACLES = """
[[obstacle]]
kind = "half_space"
point_mm = [0, -1200, 0]
normal = [0, 2, 0]
penetration_mm = 5
load = 20
friction = 0.3
dissipation = 0.1
[[obstacle]]
kind = "sphere"
centre = [0, 1, 5]
radius_cm = 50
penetration = 0.01
slip_speed_mm_per_s = 5
rim_points = 8
discs = [3]
[[obstacle]]
kind = "capsule"
start = [-1, 0, 4]
end = [1, 0, 4]
radius = 0.5
penetration = 0.01
[[obstacle]]
kind = "box"
centre = [0, -2, 2]
size_mm = [1000, 2000, 500]
orientation_deg = [90, 0, 0]
rounding = 0.1
penetration = 0.01
"""


def test_every_kind_arrives_in_si_units():
    floor, ball, bar, box = parse(SMALL + OBSTACLES).robot.obstacles
    assert floor.shape.point.tolist() == [0, -1.2, 0] and floor.shape.normal.tolist() == [0, 1, 0]
    numbers = floor.penetration, floor.load, floor.friction, floor.dissipation
    assert numbers == (0.005, 20, 0.3, 0.1)
    assert (ball.shape.radius, ball.slip_speed) == (0.5, 0.005)
    assert (ball.rim_points, ball.discs) == (8, (3,))
    assert ball.load == pytest.approx(2 * 2 * 9.81)  # the weight of discs 2 and 3
    assert bar.shape.start.tolist() == [-1, 0, 4] and bar.rim_points == 16
    assert box.shape.size.tolist() == [1, 2, 0.5] and box.shape.rounding == 0.1
    assert box.shape.orientation[:, 1] == pytest.approx([0, 0, 1])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('kind = "sphere"\nradius = 1\npenetration = 1', "centre: expected finite numbers of"),
        (
            'kind = "half_space"\npoint = [0, 0, 0]\nnormal = [0, 0, 0]\npenetration = 1',
            "normal: expected a direction",
        ),
        (
            'kind = "sphere"\ncentre = [0, 0, 0]\nradius = 1\npenetration = 1\nrim_points = 0',
            "rim_points: expected an integer from 1 to 64, got 0",
        ),
        (
            'kind = "sphere"\ncentre = [0, 0, 0]\nradius = 1\npenetration = 1\ndiscs = [9]',
            "discs: expected discs from 2 to 3",
        ),
        (
            'kind = "sphere"\ncentre = [0, 0, 0]\nradius = 1\npenetration = 1\nradus = 2',
            "radus: expected one of",
        ),
    ],
)
def test_what_is_refused(text, line):
    (found,) = errors_of(SMALL + "[[obstacle]]\n" + text)
    assert line.split(": ")[1] in found and "obstacle" in found


def test_rim_points_are_even():
    disc = dtc.Disc.hoop(1.0, 0.5)
    for n in (4, 16, 32):
        points = rim_points(disc, n)
        assert np.linalg.norm(points - [0, 0.5, 0], axis=1) == pytest.approx(0.5, rel=1e-12)
        steps = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)
        assert steps == pytest.approx(steps[0], rel=1e-12)
    square = dtc.Disc.polygon(1.0, [(0, 0), (2, 0), (2, 2), (0, 2)])
    assert rim_points(square, 8)[:3, :2].tolist() == [[0, 0], [1, 0], [2, 0]]


def test_silhouettes():
    """From the side a ball is a circle, a bar across the page too, a box its rounded edges."""
    view = drawing.plane_view(drawn_runs.seed().model.robot)
    _, ball, bar, box = parse(SMALL + OBSTACLES).robot.obstacles
    for obstacle in (ball, bar):
        outline = scenery.silhouette(obstacle, view, np.zeros(3), 3.0)
        middle = view.project(obstacle.shape.balls().centres).mean(axis=0)
        assert np.linalg.norm(outline - middle, axis=1) == pytest.approx(0.5, rel=1e-6)
    size = np.ptp(scenery.silhouette(box, view, np.zeros(3), 3.0), axis=0)
    assert size == pytest.approx([2.0, 0.5], rel=1e-3)  # z along the page; circles of 72 corners


FAR = dtc.Sphere((0, 0, 90), 0.5)


def among_obstacles() -> dtc.Run:
    """The seed robot swinging into a floor and beside a ball."""
    run = drawn_runs.seed()
    shapes = dtc.HalfSpace((0, -0.3, 0), (0, 1, 0)), dtc.Sphere((0, 1, 4), 0.5)
    robot = replace(run.model.robot, obstacles=tuple(dtc.Obstacle(s, 0.05) for s in shapes))
    model = dtc.build(robot, chart="planar")
    return drawn_runs.swinging(model, 0.5, u=np.full((1, 121), 12.0))


def test_arrows_show_the_sum_on_each_disc():
    run = among_obstacles()
    contacts = run.contacts
    moment = contacts.t[np.argmax(np.linalg.norm(contacts.force, axis=1))]
    found = scenery.pushes(contacts, moment)
    total = contacts.force[contacts.t == moment].sum(axis=0)
    assert found[:, 1].sum(axis=0) == pytest.approx(total)
    motion = Motion.of(run, np.array([moment]))
    assert len(motion.shapes[0].pushes) == len(found) > 0
    figure = plots.filmstrip(run, times=[moment])
    heads = [c for axes in figure.axes for c in axes.collections if c.get_zorder() == 5]
    tips = [path.vertices[0] for path in heads[-1].get_paths()]
    assert tips == [pytest.approx(tip) for tip in motion.view.project(found[:, 0])]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "obstacle" in labels and "contact force" in labels


def test_without_touch_there_is_no_arrow():
    robot = replace(drawn_runs.seed().model.robot, obstacles=(dtc.Obstacle(FAR, 0.05),))
    run = drawn_runs.swinging(dtc.build(robot, chart="planar"))
    motion = Motion.of(run, run.t[:5])
    assert motion.shapes[0].pushes.shape == (0, 2, 2)
    assert scenery.typical_force([shape.pushes for shape in motion.shapes]) == 0.0
