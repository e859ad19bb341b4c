"""The same chain in MuJoCo, whose contacts are soft: it falls on a floor or is pushed along it."""

from collections.abc import Sequence

import mujoco
import numpy as np

from dtcasadi.contact import HalfSpace
from dtcasadi.rim import rim_points
from dtcasadi.robot import Robot

from .mujoco_chain import chain_xml

_BALL = 1e-4  # rim points are balls so small, and the floor is lower by as much [m]


def dropped(
    robot: Robot,
    charts: Sequence[str],
    x0: np.ndarray,
    t: np.ndarray,
    time_constant: float,
    push: Sequence[float] = (0.0, 0.0, 0.0),
) -> np.ndarray:
    """Coordinates at some times, shape (n_q, n): rim points against the robot's one half-space.

    Args:
        robot: the robot; its only obstacle is a half-space.
        charts: of its segments.
        x0: initial q and qd.
        t: times, whole multiples of the step of 0.1 ms [s].
        time_constant: of MuJoCo's contact constraint, critically damped [s].
        push: force on the last disc's centre of mass [N].
    """
    (obstacle,) = robot.obstacles
    assert isinstance(obstacle.shape, HalfSpace)
    xml = chain_xml(robot, charts, lambda disc: _balls(robot, disc))
    spec = mujoco.MjSpec.from_string(xml)
    floor = spec.worldbody.add_geom()
    floor.type, floor.size = mujoco.mjtGeom.mjGEOM_PLANE, [50, 50, 1]
    floor.pos = obstacle.shape.point - _BALL * obstacle.shape.normal
    turned = np.empty(4)
    mujoco.mju_quatZ2Vec(turned, obstacle.shape.normal)
    floor.quat = turned
    floor.contype, floor.conaffinity = 0, 1
    for geom in spec.geoms:
        geom.friction = [obstacle.friction, 0, 0]
        geom.condim, geom.solref = 3, [time_constant, 1.0]
    spec.option.timestep = 1e-4
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.disableflags = 0
    model = spec.compile()
    data = mujoco.MjData(model)
    n = model.nv
    data.qpos[:], data.qvel[:] = x0[:n], x0[n:]
    data.xfrc_applied[-1, :3] = push
    found = []
    for moment in t:
        while data.time < moment - 5e-5:
            mujoco.mj_step(model, data)
        found.append(data.qpos.copy())
    return np.array(found).T


def _balls(robot: Robot, disc: int) -> str:
    """A disc's rim points as geoms without mass."""
    points = rim_points(robot.discs[disc - 1], robot.obstacles[0].rim_points)
    return "".join(
        f'<geom type="sphere" size="{_BALL}" mass="0" contype="1" conaffinity="0" '
        f'pos="{" ".join(repr(float(x)) for x in point)}"/>'
        for point in points
    )
