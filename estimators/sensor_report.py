"""What sets of sensors see of a scene, in words, figures and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from dtcasadi.discrete import DiscreteModel
from dtcasadi.estimation import Estimation
from dtcasadi.scene import Scene
from dtcasadi.style import BLUE, GREY, WIDTH_IN, finished, new_figure, styled

from .observability import Gramians, Motion, gramians
from .registry import ESTIMATORS
from .runner import track
from .scenario import knowledge, settings
from .sensor_sets import Seen, adding_nothing, every_set, smallest
from .truth import Truth, moved, recorded

if TYPE_CHECKING:
    from dtcasadi.cli.common import Report

# Sets in text and picture; of more, those of one sensor, of all, and of all but one.
_MOST_ROWS = 16
_WIDEST = 20.0
_ROW = "{sensors:34} {least:>9} {condition:>9} {bits:>7} {force_error_N:>11}  {unseen}"


def observed(scene: Scene, discrete: DiscreteModel, t_end: float | None = None) -> Gramians:
    """The Gramians along the motion of a scene's model, deviations before those of its filters.

    Raises:
        EstimationError: a run beside the motion is not finite.
    """
    known = knowledge(scene, discrete)
    plain: dict[str, Any] = {
        f.name: f.default for f in fields(Estimation) if f.name.startswith("truth_")
    }
    model = replace(scene, estimation=replace(settings(scene), **plain))
    motion = moved(model, t_end)
    path = Motion(motion.x, motion.theta, motion.u)
    return gramians(discrete, path, P0=known.P0, augment=known.augment)


def force_errors(
    scene: Scene, truth: Truth, discrete: DiscreteModel, sets: Sequence[Seen]
) -> list[float]:
    """What the extended Kalman filter makes of the contact force with each set of sensors [N].

    Root mean square over the second half of one simulated log; infinite where it lost its way.
    """
    log, errors = recorded(scene, truth), []
    ekf = ESTIMATORS["ekf"].build(scene, discrete)
    block = discrete.theta_blocks["wrench"]
    for each in sets:
        mine = tuple(f"{name}." for name in each.sensors) + ("command",)
        channels = {name: y for name, y in log.channels.items() if name.startswith(mine)}
        found = track(ekf, replace(log, channels=channels), t_end=float(truth.t[-1]))
        force = np.array([est.theta[block][:3] for est in found.estimates])
        off = np.linalg.norm(force - truth.force, axis=1)[len(force) // 2 :]
        errors.append(float(np.sqrt(np.mean(off**2))) if np.all(np.isfinite(off)) else np.inf)
    return errors


def shown(found: Gramians, bound: float) -> list[Seen]:
    """The sets that text and picture show: all, or those of one sensor, all, and all but one."""
    sets = every_set(found, bound)
    if len(sets) <= _MOST_ROWS:
        return sets
    n, best = len(sets[-1].sensors), smallest(sets, bound)
    return [each for each in sets if len(each.sensors) in (1, n - 1, n) or each is best]


def described(
    found: Gramians, sets: Sequence[Seen], errors: Sequence[float], bound: float, report: Report
) -> None:
    """Say what each set sees, and which sensors are enough."""
    best, useless = smallest(sets, bound), adding_nothing(sets)
    report.section("observability", "what sets of sensors see")
    report.line(
        "empirical Gramians in {windows} windows of {steps} steps, figures of the worst; "
        "deviations over those before, bound {bound:g}",
        windows=len(found.starts),
        steps=found.steps,
        bound=bound,
    )
    heads = ("sensors", "least", "condition", "bits", "force_error_N", "unseen")
    print("  " + _ROW.format(**dict(zip(heads, _TITLES, strict=True))))
    for each, error in zip(sets, errors, strict=True):
        report.row(
            "sets",
            _ROW,
            sensors=_title(each),
            least=each.least,
            condition=each.condition if np.isfinite(each.condition) else None,
            bits=each.bits,
            force_error_N=error if np.isfinite(error) else None,
            unseen=_unseen(each, bound),
        )
    report.note(
        names=list(found.names),
        left={_title(each): each.left for each in sets},
        unseen_directions={_title(each): [list(d) for d in each.directions] for each in sets},
    )
    report.line(
        "smallest set that sees everything: {smallest}",
        smallest=_title(best) if best else "none",
    )
    report.line(
        "sensors that add nothing to the others: {adding_nothing}",
        adding_nothing=", ".join(useless) or "none",
    )


_TITLES = ("sensors", "least", "condition", "bits", "force [N]", "not seen within the bound")


def _title(each: Seen) -> str:
    return " + ".join(each.sensors)


def _unseen(each: Seen, bound: float) -> str:
    if each.sees_all(bound):
        return "-"
    names = list(dict.fromkeys(name for part in each.directions for name in part))
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    return f"{len(each.directions)} directions: {', '.join(names[:4])}{more}"


@styled
def picture(
    found: Gramians, sets: Sequence[Seen], errors: Sequence[float], bound: float, path: str | Path
) -> Path:
    """Draw the contact force's error and what is left of each number, by set of sensors.

    Args:
        found: the information.
        sets: the sets, from top to bottom.
        errors: the contact force's, from `force_errors`.
        bound: as in `judged`.
        path: a .png, .svg or .pdf file.

    Raises:
        PictureError: another suffix.
        OSError: the file cannot be written.
    """
    figure = new_figure(WIDTH_IN * 1.25, 1.9 + 0.27 * len(sets), layout="constrained")
    bars, grid = figure.subplots(1, 2, sharey=True, width_ratios=[1, 2.2])
    _forces(bars, sets, errors, bound)
    image = grid.imshow(
        np.array([each.left for each in sets]), aspect="auto", cmap="viridis_r", vmin=0, vmax=1
    )
    grid.set_xticks(range(len(found.names)), found.names, rotation=90, fontsize=6.5)
    grid.set_title("deviation left over the one before")
    grid.tick_params(left=False)
    figure.colorbar(image, ax=grid, fraction=0.03, pad=0.01)
    bars.set_ylim(len(sets) - 0.5, -0.5)
    finished(figure, path)
    return Path(path)


def _forces(axes: Axes, sets: Sequence[Seen], errors: Sequence[float], bound: float) -> None:
    finite = [error for error in errors if np.isfinite(error)]
    # Filters that lost their way would leave no room for the others.
    most = min(max(finite, default=1.0), _WIDEST * min(finite, default=1.0))
    colours = [BLUE if each.sees_all(bound) else GREY for each in sets]
    widths = [min(error, 1.1 * most) for error in errors]
    axes.barh(range(len(sets)), widths, color=colours)
    for k, error in enumerate(errors):
        if error > 1.1 * most:
            axes.text(1.08 * most, k, f"{error:.2g}", ha="right", va="center", color="white")
    axes.set_xlim(0.0, 1.1 * most)
    axes.set_yticks(range(len(sets)), [_title(each) for each in sets])
    axes.set_title("error of the contact force [N]")
    handles = [
        Patch(color=BLUE, label="set sees everything"),
        Patch(color=GREY, label="it does not"),
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.06))
