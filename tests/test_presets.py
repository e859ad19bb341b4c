"""Presets: what they are known for, what they do under pressure, and other numbers of discs."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm
from test_tube_beam import section_of

import dtcasadi as dtc
from dtcasadi import presets
from dtcasadi.errors import RobotError, SceneError
from dtcasadi.forces import PointLoad
from dtcasadi.ratings import PressureWarning, warn_above_rating
from dtcasadi.sensors import Lengths, Marker
from dtcasadi.statics.search import virtual_search

NAMES = ("tentacle", "grub", "arm")


@cache
def model(name: str, n_discs: int, **options) -> dtc.Model:
    robot = getattr(presets, name)(n_discs)
    made = dtc.build(replace(robot, **options), inflation="volume")
    virtual_search(made)
    return made


def centres(found: dtc.Equilibrium) -> np.ndarray:
    rotations, origins = found.poses
    discs = found.model.robot.discs
    return origins + np.array([R @ d.centroid for R, d in zip(rotations, discs, strict=True)])


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_is_its_scenes_robot(name):
    scene = dtc.load_scene(name)
    made = getattr(presets, name)()
    assert made.n_discs == scene.robot.n_discs
    for one, other in zip(made.springs, scene.robot.springs, strict=True):
        assert np.array_equal(one.start, other.start) and one.stiffness == other.stiffness
    assert scene.options["inflation"] == "volume"


# ---- the tentacle --------------------------------------------------------------------------------


def test_the_tentacle_leaves_the_plane():
    """At 20 kPa a quarter of its length, in four discs; with a straight strip nothing."""
    found = dtc.equilibrium(model("tentacle", 4), 20e3)
    assert found.stable, found.message
    tip = centres(found)[-1] - centres(found)[0]
    length = dtc.load_scene("tentacle").beam.length
    assert 0.2 < tip[0] / length < 0.3
    assert tip[1] / length < -0.3  # towards the strip, at -y at the root
    straight = replace(dtc.load_scene("tentacle").beam, twist=0.0).robot(4)
    plain = dtc.build(straight, inflation="volume")
    virtual_search(plain)
    tip = centres(dtc.equilibrium(plain, 20e3))[-1]
    assert abs(tip[0]) < 1e-9 * length and tip[1] < -0.3 * length


@pytest.mark.parametrize(("n_discs", "within"), [(4, 0.05), (8, 0.05 * (3 / 7) ** 2)])
def test_the_tentacle_is_the_helix_of_a_wound_tube(n_discs, within):
    """At a low pressure without weight: curvature, twist and shear that the wound wall takes.

    p pi r^2 pulls the section apart; its strain by the oracle's compliance, fabric included. The
    error is of second order in a segment; of what it is a share, the way the tip goes.
    """
    beam, pressure = dtc.load_scene("tentacle").beam, 50.0
    found = dtc.equilibrium(model("tentacle", n_discs, gravity=0.0), pressure)
    way = centres(found)[-1] - centres(found)[0]
    angles = np.array([0.0, 0.0, beam.twist])
    pull = np.array([0.0, 0.0, pressure * math.pi * beam.radius**2, 0.0, 0.0, 0.0])
    strain = section_of(beam, angles) @ pull
    x, y, z = angles + strain[3:] * beam.length
    u, v, w = beam.length * (strain[:3] + [0.0, 0.0, 1.0])
    helix = expm(np.array([[0, -z, y, u], [z, 0, -x, v], [-y, x, 0, w], [0, 0, 0, 0]]))[:3, 3]
    moved = np.linalg.norm(helix - [0, 0, beam.length])
    assert np.linalg.norm(way - helix) < within * moved


def test_the_tentacle_warns_before_it_bursts():
    robot = presets.tentacle()
    warn_above_rating(robot, np.array([[20e3, 30e3]]))  # as an error in these tests
    text = r"chamber 1 reaches 31000 Pa and is rated for 30000 Pa: it may burst"
    with pytest.warns(PressureWarning, match=text):
        warn_above_rating(robot, np.array([[20e3, 31e3]]))


def test_simulation_and_statics_warn_above_the_rating():
    tube = dtc.Robot.from_tube(
        *(0.2, 0.02, 2e-3, 1e6, 0.5, 1000.0, 2), retardation_time=0.1, rated_pressure=1e3
    )
    light = dtc.build(tube, chart="planar")
    with pytest.warns(PressureWarning, match="reaches 1100 Pa"):
        dtc.simulate(light, np.zeros(4), pressure=1.1e3, t_end=1e-3)
    dtc.simulate(light, np.zeros(4), pressure=1e3, t_end=1e-3)
    with pytest.warns(PressureWarning, match="reaches 1200 Pa"):
        dtc.equilibrium(light, 1.2e3)


# ---- the joint -----------------------------------------------------------------------------------


def test_the_joint_has_the_figures_reported():
    """14.07 N m/rad and 2.73 N m s/rad from end to end, 5 kg, 0.15 N m/kPa, 2.856 1/s, 275 kPa."""
    scene = dtc.load_scene("grub")
    beam = scene.beam
    assert beam.EI / beam.length == pytest.approx(14.07, rel=1e-4)
    assert beam.retardation_time * beam.EI / beam.length == pytest.approx(2.73, rel=1e-4)
    assert sum(disc.mass for disc in scene.robot.discs) == pytest.approx(5.0, rel=1e-4)
    assert 1 / scene.options["actuator"].time_constant == pytest.approx(2.856, rel=1e-4)
    assert scene.options["actuator"].maximum == 275e3
    # What a pair does to the top: its difference of pressure turns it, their sum does not.
    light = model("grub", 6, gravity=0.0)
    turned = dtc.equilibrium(light, [100.0, -100.0, 0.0, 0.0]).poses[0][-1]
    moment = 0.2 * 0.15  # 0.2 kPa
    # A small turn; the shear of the discrete rod takes none of a pure moment.
    assert math.asin(-turned[1, 2]) == pytest.approx(moment / 14.07, rel=2e-3)
    aside = dtc.equilibrium(light, [0.0, 0.0, 100.0, -100.0]).poses[0][-1]
    assert math.asin(aside[0, 2]) == pytest.approx(-moment / 14.07, rel=2e-3)


def test_the_joint_stands_upright_and_bends_both_ways():
    upright = dtc.equilibrium(model("grub", 6), [100e3] * 4)
    assert upright.stable
    assert centres(upright)[-1] == pytest.approx([0, 0, 0.23], abs=1e-9)
    for pressures, axis, sign in (
        ([150e3, 50e3, 100e3, 100e3], 1, -1),
        ([100e3, 100e3, 140e3, 60e3], 0, -1),
    ):
        tip = centres(dtc.equilibrium(model("grub", 6), pressures))[-1]
        assert sign * tip[axis] > 0.05 and abs(tip[1 - axis]) < 1e-6


# ---- the arm -------------------------------------------------------------------------------------


def test_the_arm_reaches_up_and_aside():
    arm = model("arm", 9)
    sagging = centres(dtc.equilibrium(arm, [0.0] * 4))[-1]
    lifted = centres(dtc.equilibrium(arm, [60e3, 0, 60e3, 0]))[-1]
    turned = centres(dtc.equilibrium(arm, [60e3, 50e3, 60e3, 50e3]))[-1]
    root = arm.robot.discs[0].centroid
    assert (sagging - root) @ arm.robot.up < -0.01
    assert (lifted - root) @ arm.robot.up > 0.4
    assert abs(lifted[0]) < 5e-3  # the strips aside are no symmetry of its weight
    assert turned[0] > 0.25


# ---- another number of discs ---------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_can_be_cut_anew(name):
    scene = dtc.load_scene(name)
    finer = scene.rediscretised(13)
    assert finer.robot.n_discs == 13 and len(finer.q0) == 60
    assert sum(d.mass for d in finer.robot.discs) == pytest.approx(
        sum(d.mass for d in scene.robot.discs)
    )
    assert [c.rated_pressure for c in finer.robot.chambers] == [
        c.rated_pressure for c in scene.robot.chambers
    ]
    assert finer.rediscretised(scene.robot.n_discs).robot.length == pytest.approx(
        scene.robot.length
    )
    assert finer.build().n_discs == 13 and finer.t_end == scene.t_end


def test_poses_and_forces_stay_where_they_are():
    """An arc keeps its angle, loads their places; what the tip carries stays at the tip."""
    scene = dtc.load_scene("tentacle")
    loads = (PointLoad(4, 1.0, [0, 0, 1]), PointLoad(2, 2.0, [0, 1, 0]))
    q = np.tile([0.1, 0.0, 0.1, 0.0, 0.0], 3)
    sensors = (
        Marker(name="tip", disc=4, noise=1e-3),
        Lengths(name="cord", noise=1e-3, spans=(((2, [0] * 3), (4, [0] * 3)),)),
    )
    robot = replace(scene.robot, forces=loads)
    finer = replace(scene, robot=robot, q0=q, qd0=2 * q, sensors=sensors).rediscretised(10)
    assert [sensor.discs for sensor in finer.sensors] == [(10,), (4, 10)]
    assert [force.disc for force in finer.robot.forces] == [10, 4]
    assert finer.q0.reshape(9, 5).sum(axis=0) == pytest.approx(q.reshape(3, 5).sum(axis=0))
    assert finer.qd0 == pytest.approx(2 * finer.q0)


def test_what_cannot_be_cut_anew():
    with pytest.raises(SceneError, match="a robot made from a tube or a rod"):
        dtc.load_scene("seed_four_disc").rediscretised(8)
    with pytest.raises(RobotError, match="n_discs"):
        dtc.load_scene("arm").rediscretised(4)
    scene = dtc.load_scene("tentacle")
    mixed = replace(scene, initial_chart=("cardan", "cardan", "paper"))
    with pytest.raises(SceneError, match="one chart for all segments"):
        mixed.rediscretised(8)
