"""Truth and estimates side by side as a moving picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dtcasadi.animate import animate
from dtcasadi.stepped import run_of_steps

from .report import Result
from .truth import Truth


def side_by_side(results: Sequence[Result], truth: Truth | None, path: Path) -> Path:
    """Write truth and estimates as a .gif or .mp4, one panel each.

    Raises:
        PictureError: another suffix, or ffmpeg is missing or fails.
        OSError: the file cannot be written; an older one is left as it was.
    """
    panels = {}
    if truth is not None:
        panels["truth"] = run_of_steps(truth.discrete, truth.t, truth.x, truth.u, truth.theta)
    for result in results:
        found = result.track
        x = np.array([est.x for est in found.estimates])
        theta = np.array([est.theta for est in found.estimates])
        panels[result.title] = run_of_steps(result.discrete, found.t, x, found.u, theta)
    return animate(panels, path)
