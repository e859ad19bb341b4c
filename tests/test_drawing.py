"""dtcasadi.drawing and dtcasadi.motion: where things are on the page, and when."""

import drawn_runs
import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi import drawing, motion


@pytest.fixture(scope="module")
def seed() -> dtc.Run:
    return drawn_runs.seed()


@pytest.mark.parametrize(
    ("up", "labels"),
    [
        ((0, 1, 0), ("z [m]", "height [m]")),
        ((0, -1, 0), ("z [m]", "height [m]")),
        ((0, 0, 1), ("y [m]", "height [m]")),
        ((0, 0, -1), ("y [m]", "height [m]")),
        ((1, 0, 0), ("z [m]", "y [m]")),
        ((0, 3, 4), ("along the plane [m]", "height [m]")),
        ((1, 1, 0), ("z [m]", "y [m]")),
    ],
)
def test_the_page_is_upright(up, labels):
    disc = dtc.Disc.hoop(1.0, 1.0)
    robot = dtc.Robot([disc] * 2, [dtc.Thread(1.0)], up=up)
    for view in (drawing.plane_view(robot), drawing.oblique_view(robot)):
        axes = np.array([view.horizontal, view.vertical, view.toward])
        assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert view.vertical @ robot.up >= 0 and abs(view.horizontal @ robot.up) < 1e-12 or up[0]
    assert drawing.plane_view(robot).labels == labels
    assert drawing.oblique_view(robot).horizontal[1 if abs(robot.up[2]) > 0.9 else 2] > 0.4


def test_the_view_is_chosen_by_the_motion(seed):
    R, r = seed.poses()
    assert drawing.view_of(seed.model.robot, R, r, None).labels
    run = drawn_runs.recentred()
    R, r = run.poses()
    assert drawing.view_of(run.model.robot, R, r, None).labels is None


def test_side_view_has_discs_as_lines_where_they_are(seed):
    R, r = seed.poses(np.array([30]))
    robot = seed.model.robot
    shapes = drawing.shapes_of(robot, R[0], r[0], drawing.plane_view(robot))
    for i, rim in enumerate(shapes.discs):
        along = R[0, i, :, 1]
        # The hoop of radius 1 reaches from the thread to 2 along y; up is -y.
        far = r[0, i] + 2 * along
        ends = np.array([[r[0, i, 2], -r[0, i, 1]], [far[2], -far[1]]])
        direction = (ends[1] - ends[0]) / 2
        offsets = rim - ends[0]
        across = offsets @ np.array([-direction[1], direction[0]])
        assert np.abs(across).max() < 1e-12
        assert np.ptp(rim @ direction) == pytest.approx(2.0)
    assert shapes.threads[1] == pytest.approx(np.array([[r[0, k, 2], -r[0, k, 1]] for k in (1, 2)]))
    assert shapes.tip == pytest.approx([r[0, 3, 2] + R[0, 3, 2, 1], -r[0, 3, 1] - R[0, 3, 1, 1]])


def test_springs_end_where_they_are_fixed(seed):
    R, r = seed.poses(np.array([10]))
    robot = seed.model.robot
    view = drawing.oblique_view(robot)
    shapes = drawing.shapes_of(robot, R[0], r[0], view)
    for spring, zigzag in zip(robot.springs, shapes.springs, strict=True):
        for disc, point, drawn in (
            (spring.discs[0] - 1, spring.start, zigzag[0]),
            (spring.discs[1] - 1, spring.end, zigzag[-1]),
        ):
            assert drawn == pytest.approx(view.project(r[0, disc] + R[0, disc] @ point))


def test_a_disc_without_outline_is_drawn_as_the_hoop_that_spins_like_it():
    disc = dtc.Disc(2.0, np.diag([0.2, 0.2, 0.08]), centre_of_mass=[0.0, 0.5, 0.1])
    rim = drawing.outline_of(disc)
    assert np.linalg.norm(rim - disc.centre_of_mass, axis=1) == pytest.approx(0.2)


def test_walls_cover_both_rims_and_turn_one_way():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    triangle = np.array([[3.0, 0.0], [4.0, 0.0], [3.5, 1.0]])
    wall = drawing._wall(square, triangle)
    sides = wall[:, 1:] - wall[:, :1]
    areas = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    assert np.all(areas >= 0) and np.sum(areas) / 2 >= 1.5
    corners = {tuple(point) for point in wall.reshape(-1, 2)}
    assert {tuple(point) for point in square} <= corners


def test_poses_between_steps_follow_the_motion(seed):
    times = np.array([0.0, 0.01, 1.2345, 2.99, 3.0])
    R, r = seed.at(times).poses()
    phase = np.arange(6)
    for k, time in enumerate(times):
        rotation, origin = seed.model.poses(0.4 * np.sin(2 * time + phase), seed.model.theta0)
        assert R[k].transpose(1, 0, 2).reshape(3, -1) == pytest.approx(np.array(rotation), abs=1e-6)
        assert r[k].T == pytest.approx(np.array(origin), abs=1e-6)


def test_poses_pass_a_recentring_without_a_jump():
    run = drawn_runs.recentred()
    moment = run.recentrings[0][0]
    times = moment + np.linspace(-0.03, 0.03, 25)
    R, r = run.at(times).poses()
    assert np.abs(np.diff(r, axis=0)).max() < 0.01 and np.abs(np.diff(R, axis=0)).max() < 0.01
    assert R @ R.transpose(0, 1, 3, 2) == pytest.approx(
        np.broadcast_to(np.eye(3), R.shape), abs=1e-12
    )


def test_telling_times_hold_start_end_and_turns():
    run = drawn_runs.hanging_chain()
    times = motion.telling_times(run)
    assert 4 <= len(times) <= 8 and np.all(np.diff(times) > 0)
    assert times[0] == run.t[0] and times[-1] == run.t[-1]
    path_times, path = motion.tip_path(run)
    lowest = path_times[np.argmin(path @ run.model.robot.up)]
    assert np.abs(times - lowest).min() < 0.02


@pytest.mark.parametrize("n", [50, 5000])
def test_turns_are_found_at_any_sampling(n):
    t = np.linspace(0, 4.5 * np.pi, n)
    turns = t[motion._turns(np.exp(-t / 20) * np.cos(t))]
    assert turns == pytest.approx(np.pi * np.arange(1, 5), abs=0.4 if n == 50 else 0.06)
    assert len(motion._turns(np.linspace(1, 2, n))) == 0
    assert len(motion._turns(np.ones(n))) == 0
