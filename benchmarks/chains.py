"""The benchmark's chain of discs and threads, told to each program in its own words.

Coordinates are those of chart `cardan`, five angles a segment, R_rel = A Rx Ry B Rx Ry Rz with the
origin of disc i + 1 at r_i + R_i (s + l A Rx Ry z). Peers may use others for the disc's three.
"""

from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from dtcasadi.robot import Disc, Robot, Thread

AXES = np.eye(3)
# MuJoCo's features that a bare chain has no use for.
SWITCHED_OFF = (
    *("constraint", "equality", "frictionloss", "limit", "contact", "spring", "damper"),
    *("actuation", "sensor", "midphase", "island", "warmstart", "eulerdamp", "autoreset"),
)


def unit_hoops(n_discs: int) -> Robot:
    """Bare chain: hoops of mass 1 and radius 1 joined at the rim, threads of length 1, gravity."""
    hoop = Disc.hoop(1.0, 1.0)
    return Robot((hoop,) * n_discs, (Thread(1.0),) * (n_discs - 1))


@dataclass(frozen=True)
class States:
    """Positions, rates and forces, one state to a row; `q` may be longer than `v` (quaternions)."""

    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray

    def rows(self) -> np.ndarray:
        """The states as the drivers read them, shape (n_states, n_q + 2 n_v)."""
        return np.hstack([self.q, self.v, self.tau])


def random_states(robot: Robot, n_states: int, seed: int = 1) -> States:
    """Angles within 0.5 rad, rates and forces within 1, in chart `cardan`."""
    rng = np.random.default_rng(seed)
    shape = (n_states, 5 * (robot.n_discs - 1))
    return States(*(rng.uniform(-size, size, shape) for size in (0.5, 1.0, 1.0)))


def _segments(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1, 5)


def _spin_map(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """W and its rate: angular velocity, in the disc's own frame, is W times the disc's rates."""
    (_, e, f), (_, e_dot, f_dot) = np.moveaxis(q, -1, 0), np.moveaxis(v, -1, 0)
    ce, se, cf, sf = np.cos(e), np.sin(e), np.cos(f), np.sin(f)
    w, w_dot = np.zeros((*e.shape, 3, 3)), np.zeros((*e.shape, 3, 3))
    w[..., 0] = np.stack([ce * cf, -ce * sf, se], -1)
    w[..., 1] = np.stack([sf, cf, 0 * f], -1)
    w[..., 2] = AXES[2]
    w_dot[..., 0] = e_dot[..., None] * np.stack([-se * cf, se * sf, ce], -1)
    w_dot[..., 0] += f_dot[..., None] * np.stack([-ce * sf, -ce * cf, 0 * f], -1)
    w_dot[..., 1] = f_dot[..., None] * np.stack([cf, -sf, 0 * f], -1)
    return w, w_dot


def _quaternion(angles: np.ndarray) -> np.ndarray:
    """Quaternion (w, x, y, z) of Rx Ry Rz."""
    (cd, ce, cf), (sd, se, sf) = (np.moveaxis(g(angles / 2), -1, 0) for g in (np.cos, np.sin))
    w, x = cd * ce * cf - sd * se * sf, sd * ce * cf + cd * se * sf
    y, z = cd * se * cf - sd * ce * sf, cd * ce * sf + sd * se * cf
    return np.stack([w, x, y, z], -1)


def to_peer(states: States, coordinates: str) -> States:
    """The states in a peer's coordinates.

    Args:
        states: in chart `cardan`.
        coordinates: `angles` (the same), `zyx` (second disc angle reversed), `xyzw` or `wxyz` (the
            disc's three as a quaternion in that order, with its angular velocity in its own frame).
    """
    q, v, tau = (_segments(x).copy() for x in (states.q, states.v, states.tau))
    if coordinates == "zyx":
        for values in (q, v, tau):
            values[..., 3] *= -1
    elif coordinates != "angles":
        w, _ = _spin_map(q[..., 2:], v[..., 2:])
        v[..., 2:] = np.einsum("...ij,...j", w, v[..., 2:])
        tau[..., 2:] = np.linalg.solve(w.swapaxes(-1, -2), tau[..., 2:, None])[..., 0]
        turn = _quaternion(q[..., 2:])
        if coordinates == "xyzw":
            turn = np.roll(turn, -1, -1)
        q = np.concatenate([q[..., :2], turn], -1)
    return States(*(x.reshape(len(x), -1) for x in (q, v, tau)))


def from_peer(acceleration: np.ndarray, states: States, coordinates: str) -> np.ndarray:
    """A peer's accelerations, shape (n_states, n_v), in chart `cardan`; see `to_peer`."""
    result = _segments(acceleration).copy()
    if coordinates == "zyx":
        result[..., 3] *= -1
    elif coordinates != "angles":
        q, v = _segments(states.q), _segments(states.v)
        w, w_dot = _spin_map(q[..., 2:], v[..., 2:])
        rest = result[..., 2:] - np.einsum("...ij,...j", w_dot, v[..., 2:])
        result[..., 2:] = np.linalg.solve(w, rest[..., None])[..., 0]
    return result.reshape(len(acceleration), -1)


def _text(*values: object) -> str:
    return " ".join(f"{x:.17g}" for value in values for x in np.ravel(np.asarray(value, float)))


def pinocchio_text(robot: Robot) -> str:
    """The chain as `peers/pinocchio_aba.cpp` reads it."""
    lines = [f"{robot.n_discs - 1} {_text(-robot.gravity * robot.up)}"]
    for thread, disc in zip(robot.threads, robot.discs[1:], strict=True):
        segment = _text(thread.bend, thread.exit_point, thread.length, thread.twist)
        lines.append(f"{segment} {_text(disc.mass, disc.centre_of_mass, disc.inertia)}")
    return "\n".join(lines) + "\n"


def mujoco_xml(robot: Robot, joints: str) -> str:
    """The chain for MuJoCo, one body per disc, every feature a bare chain lacks switched off.

    Args:
        robot: discs and threads; nothing else of it is used.
        joints: `hinges` (five) or `ball` (two hinges and a quaternion).
    """
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian", boundmass="0", boundinertia="0")
    option = ElementTree.SubElement(root, "option", gravity=_text(-robot.gravity * robot.up))
    ElementTree.SubElement(option, "flag", dict.fromkeys(SWITCHED_OFF, "disable"))
    parent = ElementTree.SubElement(root, "worldbody")
    for thread, disc in zip(robot.threads, robot.discs[1:], strict=True):
        # At rest the body sits at s + l A z, turned by A B. MuJoCo turns joints about axes given
        # in the body's frame, so the thread's axes appear turned by B^T.
        turn, back = thread.bend @ thread.twist, thread.twist.T
        origin = thread.exit_point + thread.length * thread.bend[:, 2]
        x_axis, y_axis = turn[:, 0], turn[:, 1]
        place = {"pos": _text(origin), "xyaxes": _text(x_axis, y_axis)}
        parent = ElementTree.SubElement(parent, "body", place)
        inertia = disc.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        centre = _text(disc.centre_of_mass)
        about = {"pos": centre, "mass": _text(disc.mass), "fullinertia": _text(inertia)}
        ElementTree.SubElement(parent, "inertial", about)
        anchor = _text(-thread.length * back[:, 2])
        for axis in back.T[:2]:
            ElementTree.SubElement(parent, "joint", type="hinge", pos=anchor, axis=_text(axis))
        if joints == "ball":
            ElementTree.SubElement(parent, "joint", type="ball")
        else:
            for axis in AXES:
                ElementTree.SubElement(parent, "joint", type="hinge", axis=_text(axis))
    return ElementTree.tostring(root, encoding="unicode")
