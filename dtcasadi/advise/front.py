"""`dtcasadi.advise`: the cheapest model of a scene that keeps a tolerance."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import checks
from ..errors import AdviseError
from ..scene import Scene, load_scene
from .candidate import chart_word
from .lab import QUANTITIES, Lab, Measured
from .planarity import Planarity
from .reference import Reference, reference_of
from .search import Search

# Runs that a progress bar reckons with; there may be more.
_ABOUT = 60


@dataclass(frozen=True, eq=False)
class Advice:
    """What was measured, and what follows.

    Attributes:
        given: the scene as it was given.
        tolerance: largest error that was allowed, relative to the range of motion.
        quantity: what errors are of.
        best: the cheapest candidate within the tolerance; None: there is none.
        candidates: all that were measured, the cheapest first.
        reference: what they were measured against.
    """

    given: Scene
    tolerance: float
    quantity: str
    best: Measured | None
    candidates: tuple[Measured, ...]
    reference: Reference

    @property
    def scene(self) -> Scene:
        """The small model's scene.

        Raises:
            AdviseError: no candidate keeps the tolerance.
        """
        if self.best is None:
            raise AdviseError(f"advice: expected a model within {self.tolerance:g}, got none")
        return self.best.candidate.scene(self.given)

    @property
    def planarity(self) -> Planarity:
        """Whether the motion stays in a plane, and what would break that."""
        return self.reference.planarity

    def record(self) -> dict[str, Any]:
        """As the JSON file has it."""
        best = self.best
        return {
            "advised": None if best is None else best.candidate.record(),
            "error": None if best is None else best.error,
            "cost": None if best is None else best.cost,
            "reference_converged": self.reference.converged,
            "candidates": [
                {
                    **found.candidate.record(),
                    **found.candidate.more(),
                    "error": found.error,
                    "cost": found.cost,
                    "wall_time_s": found.wall_time,
                    "failure": found.failure or None,
                }
                for found in self.candidates
            ],
        }

    def __repr__(self) -> str:
        """The advice on one line."""
        if self.best is None:
            return f"Advice(none of {len(self.candidates)} candidates within {self.tolerance:g})"
        return f"Advice({described(self.best)}; error {self.best.error:.2g})"


def described(found: Measured) -> str:
    """A candidate in words."""
    one = found.candidate
    words = [f"{one.n_discs} discs", chart_word(one.chart)]
    if not one.dynamic:
        return ", ".join([*words, "at rest at each instant"])
    words.append(f"velocity terms {one.velocity_terms}")
    if one.actuator == "direct":
        words.append("direct pressure")
    if not one.contact:
        words.append("without contact")
    step = "adaptive" if one.step_s is None else f"steps of {one.step_s:.3g} s"
    return ", ".join([*words, f"{one.method}, {step}"])


def advise(
    scene: Scene | str | os.PathLike[str],
    tolerance: float = 0.02,
    *,
    quantity: str = "tip",
) -> Advice:
    """Measure on a scene how much of the model it needs.

    Candidates differ in number of discs (where the scene gives a tube or a rod), chart, velocity
    terms, motion or rest, actuator states, contact, integrator and step. Each is run and compared,
    at the same material points and instants, with the finest model; see `dtcasadi.advise.reference`
    for how that one is checked, `dtcasadi.advise.search` for which candidates are run. Errors are
    the largest distance over the range of motion: how far a point goes from where it starts, at
    most the robot's length.

    Args:
        scene: a scene, its path or its name.
        tolerance: largest error that is allowed, for example 0.02.
        quantity: `tip` (centre of the end section), `shape` (section centres at equal arc lengths)
            or `pressure-response` (where the tip rests, by pressure).

    Returns:
        The advice: `best`, `candidates`, `scene` and `planarity`. Cost is the instructions of one
        step, or of one balance of forces, times their number.

    Raises:
        AdviseError: something cannot be used, or the scene itself does not run.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    tolerance = checks.number("tolerance", tolerance, positive=True, error=_error)
    if not 1e-5 <= tolerance < 1:
        raise _error("tolerance", "a share of the range of motion, from 1e-5 to 1", tolerance)
    if quantity not in QUANTITIES:
        raise _error("quantity", f"one of {', '.join(QUANTITIES)}", checks.shown(quantity))
    if quantity == "pressure-response" and not np.any(scene.pressure.values):
        raise _error("quantity", "tip or shape for a scene without pressure", quantity)
    if quantity == "pressure-response" and scene.build().actuator.command != "pressure":
        raise _error("quantity", "tip or shape for valves commanded by their opening", quantity)
    from tqdm import tqdm

    with tqdm(total=_ABOUT, unit="run", leave=False, disable=not sys.stderr.isatty()) as bar:

        def tick(text: str) -> None:
            bar.set_description(text)
            bar.total = max(bar.total, bar.n + 2)
            bar.update()

        lab = Lab(scene, quantity, tolerance, tick)
        reference = reference_of(lab, tolerance)
        if not np.all(np.isfinite(reference.points)):
            raise AdviseError(f"scene: expected one whose finest model runs, got: {reference.note}")
        search = Search(lab, reference, tolerance)
        best = search.run()
    measured = sorted(search.measured.values(), key=lambda found: (found.cost, found.error))
    return Advice(scene, tolerance, quantity, best, tuple(measured), reference)


def written_scene(advice: Advice, source: str | os.PathLike[str], target: Path) -> Path:
    """Write the small model as a scene file, made from the file that was given.

    Raises:
        AdviseError: no candidate keeps the tolerance.
        OSError: the file cannot be written.
    """
    from .small import small_scene

    return small_scene(advice, source, target)


def _error(field: str, expected: str, got: object) -> AdviseError:
    return AdviseError(f"{field}: expected {expected}, got {got}")
