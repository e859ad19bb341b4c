"""The columns of a sweep's results from what was seen of its runs."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..health import imbalance

DONE, FAILED, LOST, MISSING = 0, 1, 2, -1
# More than this share of the energy turned over missing is no result, as in `simulate`.
IMBALANCE_MAX = 0.1


def outcomes(
    seen: Mapping[str, np.ndarray], work: Mapping[str, np.ndarray], save: Sequence[tuple[str, str]]
) -> dict[str, np.ndarray]:
    """Columns of some runs.

    Args:
        seen: parts of the probe, shape (rows, instants, runs) each, the last instant alone of those
            that only count at the end; after a failure the last good state's.
        work: supplied and dissipated [J] at the instants of `kinetic`, shape (instants, runs).
        save: quantities to save and how.
    """
    energy = {
        "kinetic": seen["kinetic"][0],
        "potential": seen["potential"][0],
        "stored": seen["stored"][0],
        **work,
    }
    total = energy["kinetic"] + energy["potential"] + energy["stored"]
    residual = total - total[0] - work["supplied"] + work["dissipated"]
    energy["residual"] = residual
    columns = {
        "tip": seen["tip"][:, -1].T,
        "tip_rotation": seen["tip_rotation"][:, -1].T.reshape(-1, 3, 3).swapaxes(1, 2),
        "max_tilt": np.arccos(np.clip(seen["cos_tilt"][0].min(axis=0), -1.0, 1.0)),
        "max_strain": seen["strain"][0].max(axis=0),
        "energy_residual": np.abs(residual).max(axis=0),
        "energy_imbalance": imbalance(energy),
    }
    for name, how in save:
        columns[f"{name}.{how}"] = _reduced(seen[f"save_{name}"], how)
    return columns


def _reduced(values: np.ndarray, how: str) -> np.ndarray:
    """A quantity (rows, instants, runs) with the runs first."""
    if how == "path":
        return values.transpose(2, 1, 0)
    if how == "final":
        return values[:, -1].T
    return (values.min(axis=1) if how == "min" else values.max(axis=1)).T


def imbalance_text(share: float) -> str:
    """Why a run whose energy does not balance is no result."""
    return (
        f"the energy balance is off by {share:.0%} of the energy turned over; the motion is not a "
        "solution: try smaller steps or tighter tolerances"
    )
