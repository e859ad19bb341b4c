"""Chambers that are asked for more pressure than they are rated for."""

import warnings

import numpy as np

from .robot import Robot


class PressureWarning(UserWarning):
    """A chamber's pressure goes beyond its `rated_pressure`."""


def warn_above_rating(robot: Robot, pressure: np.ndarray) -> None:
    """Say once which chambers go beyond their ratings, and by how much.

    Args:
        robot: the robot.
        pressure: of each chamber, at any number of times, shape (n_u, n) [Pa].
    """
    over = [
        f"chamber {number} reaches {highest:.6g} Pa and is rated for {chamber.rated_pressure:g} Pa"
        for number, chamber, highest in zip(
            range(1, len(robot.chambers) + 1),
            robot.chambers,
            np.max(pressure, axis=1, initial=-np.inf),
            strict=True,
        )
        if chamber.rated_pressure is not None and highest > chamber.rated_pressure * (1 + 1e-9)
    ]
    if over:
        warnings.warn(f"{'; '.join(over)}: it may burst", PressureWarning, stacklevel=3)
