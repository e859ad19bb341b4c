"""The same chain in MuJoCo: each disc is a body with one hinge for each axis letter.

MuJoCo applies a body's hinges in order, each about an axis and anchor fixed to the body. With the
disc's frame at the zero pose as body frame, the thread's hinges are anchored at the thread's root
-B^T l z with axes B^T e, and the disc's hinges at the body's origin with axes e: no bodies without
mass are needed. Not for the `paper` chart: MuJoCo factors M at the zero pose, its singularity.
"""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from dtcasadi.robot import Robot

from .chain import AXIS, WORDS


def _text(values: np.ndarray) -> str:
    """Numbers as XML text, exact to the last bit."""
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _quaternion(rotation: np.ndarray) -> str:
    """The rotation as XML text (w, x, y, z)."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ravel(rotation))
    return _text(quaternion / np.linalg.norm(quaternion))


def _inertial(disc) -> str:
    """The disc's inertia on its principal axes."""
    moments, axes = np.linalg.eigh(disc.inertia)
    axes = axes * np.linalg.det(axes)  # a proper rotation: flips all three axes or none
    return (
        f'<inertial mass="{disc.mass!r}" pos="{_text(disc.centre_of_mass)}" '
        f'quat="{_quaternion(axes)}" diaginertia="{_text(moments)}"/>'
    )


def chain_xml(
    robot: Robot, charts: Sequence[str], geoms: Callable[[int], str] = lambda disc: ""
) -> str:
    """Nested bodies, disc 2 outermost, each with its geoms by the disc's number."""
    head, tail = [], []
    parts = zip(robot.threads, charts, robot.discs[1:], strict=True)
    for number, (thread, chart, disc) in enumerate(parts, 2):
        origin = thread.exit_point + thread.length * thread.bend[:, 2]
        head.append(
            f'<body pos="{_text(origin)}" quat="{_quaternion(thread.bend @ thread.twist)}">'
        )
        head.append(_inertial(disc))
        head.append(geoms(number))
        root = -thread.length * thread.twist[2]
        places = ((thread.twist.T, root), (np.eye(3), np.zeros(3)))
        for letters, (carried, anchor) in zip(WORDS[chart], places, strict=True):
            head += [
                f'<joint type="hinge" axis="{_text(carried @ AXIS[a])}" pos="{_text(anchor)}"/>'
                for a in letters
            ]
        tail.append("</body>")
    gravity = _text(-robot.gravity * robot.up)
    return (
        '<mujoco><compiler angle="radian"/>'
        f'<option gravity="{gravity}"><flag contact="disable" constraint="disable"/></option>'
        f"<worldbody>{''.join(head + tail)}</worldbody></mujoco>"
    )


class MujocoChain:
    """Mass matrix, bias and forward dynamics of a Robot's bare chain by MuJoCo."""

    def __init__(self, robot: Robot, charts: Sequence[str]) -> None:
        """Compile the XML."""
        self._model = mujoco.MjModel.from_xml_string(chain_xml(robot, charts))
        self._data = mujoco.MjData(self._model)

    def _forward(self, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> None:
        self._data.qpos[:], self._data.qvel[:], self._data.qfrc_applied[:] = q, qd, tau
        mujoco.mj_forward(self._model, self._data)

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M, shape (n_q, n_q)."""
        self._forward(q, 0 * q, 0 * q)
        dense = np.zeros((self._model.nv, self._model.nv))
        mujoco.mj_fullM(self._model, self._data, dense)
        return dense

    def bias(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Coriolis and gravity, shape (n_q,)."""
        self._forward(q, qd, 0 * q)
        return self._data.qfrc_bias.copy()

    def forward_dynamics(self, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Accelerations, shape (n_q,)."""
        self._forward(q, qd, tau)
        return self._data.qacc.copy()
