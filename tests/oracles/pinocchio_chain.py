"""The same chain in Pinocchio: one revolute joint for each axis letter.

The intermediate links have no inertia; the disc's inertia is on its last joint.
"""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from dtcasadi.robot import Robot

from .chain import WORDS

JOINT = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}


class PinocchioChain:
    """Mass matrix, bias and forward dynamics of a Robot's bare chain by Pinocchio."""

    def __init__(self, robot: Robot, charts: Sequence[str]) -> None:
        """Build the joints disc by disc."""
        model = pin.Model()
        model.gravity.linear = -robot.gravity * robot.up
        joint, placement = 0, pin.SE3.Identity()
        for i, (thread, chart) in enumerate(zip(robot.threads, charts, strict=True)):
            bend = pin.SE3(np.array(thread.bend), np.array(thread.exit_point))
            twist = pin.SE3(np.array(thread.twist), np.array([0.0, 0.0, thread.length]))
            for before, letters in zip((bend, twist), WORDS[chart], strict=True):
                placement = placement * before
                for letter in letters:
                    name = f"joint_{model.njoints}"
                    joint = model.addJoint(joint, JOINT[letter](), placement, name)
                    placement = pin.SE3.Identity()
            disc = robot.discs[i + 1]
            inertia = pin.Inertia(disc.mass, np.array(disc.centre_of_mass), np.array(disc.inertia))
            if joint:  # a disc that is rigidly part of the root does not move
                model.appendBodyToJoint(joint, inertia, placement)
        self._model, self._data = model, model.createData()

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M by the composite-rigid-body algorithm, shape (n_q, n_q)."""
        upper = np.triu(pin.crba(self._model, self._data, q))
        return upper + np.triu(upper, 1).T

    def bias(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Coriolis and gravity by Newton-Euler, shape (n_q,)."""
        return pin.nonLinearEffects(self._model, self._data, q, qd).copy()

    def forward_dynamics(self, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Accelerations by the articulated-body algorithm, shape (n_q,)."""
        return pin.aba(self._model, self._data, q, qd, tau).copy()
