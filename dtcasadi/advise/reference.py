"""The finest model, extrapolated to infinitely many discs, and how far that can be trusted."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..tube import Tube
from .candidate import STATICS, Candidate
from .lab import Lab, distance, range_of
from .planarity import Planarity, planarity

# Segments of the finest model, at least, and at most where that is not fine enough.
FINEST, MOST = 8, 64
# The reference's own error over the tolerance.
SHARE = 0.25
# A tolerance so much tighter shows the error of the integration.
_TIGHTER = 1e-2
_SPATIAL = ("cardan", "paper", "planar")


@dataclass(frozen=True, eq=False)
class Reference:
    """What candidates are measured against.

    Attributes:
        candidate: the finest model that was run.
        points: where it goes, extrapolated, (instants, points, 3) [m].
        scale: what errors are relative to [m].
        uncertainty: its own error, estimated, over the scale.
        converged: whether that is small beside the tolerance.
        planarity: whether the scene stays in a plane.
        sizes: numbers of discs to try, ascending, the finest last.
        cuts: those of them that have been run for it, ascending.
        note: how it was checked, a sentence.
    """

    candidate: Candidate
    points: np.ndarray
    scale: float
    uncertainty: float
    converged: bool
    planarity: Planarity
    sizes: tuple[int, ...]
    cuts: tuple[int, ...]
    note: str

    def error(self, points: np.ndarray) -> float:
        """Largest distance from it over the scale."""
        return distance(points, self.points) / self.scale


def reference_of(lab: Lab, tolerance: float) -> Reference:
    """Run the finest models of a scene.

    A beam is cut three times, into m, m / 2 and m / 4 segments; errors go with the square of a
    segment's length, so y* = y_m + (y_m - y_(m/2)) / 3 (Richardson; Hairer, Norsett, Wanner,
    section II.4), and y* from the coarser pair tells how good that is. Where that is not enough m
    is doubled, and how fast y* settles tells besides (`_left`). Discs that were given are the
    robot itself: there only the integration has an error.
    """
    scene = lab.scene
    spatial = _spatial_chart(lab)
    found = _planarity(lab, spatial)
    base = Candidate(scene.robot.n_discs, "planar" if found.planar else spatial)
    if spatial != "cardan":
        base = replace(base, chart=spatial)
    if lab.quantity == "pressure-response":
        base = replace(
            base, dynamic=False, method=STATICS, velocity_terms="none", actuator="direct"
        )
    if scene.beam is None:
        return _given_discs(lab, base, found, tolerance)
    parts = max(scene.beam.chambers, 1) if isinstance(scene.beam, Tube) else 1
    finest = 4 * parts  # the coarsest cut has a segment for each part
    while finest < FINEST:
        finest *= 2
    return _beam(lab, base, found, tolerance, parts, finest, ())


def _beam(
    lab: Lab,
    base: Candidate,
    found: Planarity,
    tolerance: float,
    parts: int,
    finest: int,
    known: tuple[int, ...],
) -> Reference:
    known = tuple(sorted({*known, *(finest // k + 1 for k in (4, 2, 1))}))
    cuts = [replace(base, n_discs=n) for n in known]
    points = [lab.path(cut).points for cut in cuts]
    bad = next((lab.path(cut).failure for cut in cuts if lab.path(cut).failure), "")
    sizes = tuple(sorted({*known, *(m + 1 for m in _segments(parts, finest))}))
    if bad:
        return Reference(cuts[-1], points[-1], lab.length, np.inf, False, found, sizes, known, bad)
    extrapolated = [b + (b - a) / 3 for a, b in pairwise(points)]
    best = extrapolated[-1]
    scale = range_of(best, lab.length)
    steps = distance(points[0], lab.path(cuts[0], _TIGHTER).points)
    uncertainty = (_left([distance(a, b) for a, b in pairwise(extrapolated)]) + steps) / scale
    if uncertainty > SHARE * tolerance and 2 * finest <= MOST:
        return _beam(lab, base, found, tolerance, parts, 2 * finest, known)
    first, second = [distance(a, b) for a, b in pairwise(points)][-2:]
    order = np.log2(first / second) if first > 0 and second > 0 else np.nan
    note = (
        f"extrapolated from {', '.join(str(cut.n_discs) for cut in cuts)} discs, observed order "
        f"{order:.2f}; off by {uncertainty:.1e} as far as that tells"
    )
    converged = bool(uncertainty <= SHARE * tolerance)
    return Reference(cuts[-1], best, scale, uncertainty, converged, found, sizes, known, note)


def _left(gaps: list[float]) -> float:
    """How far the last of a sequence is from its limit, by the distances from one to the next.

    The last distance; where they fall by a factor f > 2, the rest of a geometric series with that
    factor, at most the 4 of errors that go with the square of a segment's length.
    """
    falls = min(gaps[-2] / gaps[-1], 4.0) if len(gaps) > 1 and gaps[-1] > 0 else 0.0
    return gaps[-1] / (falls - 1) if falls > 2 else gaps[-1]


def _given_discs(lab: Lab, base: Candidate, found: Planarity, tolerance: float) -> Reference:
    loose, tight = lab.path(base), lab.path(base, _TIGHTER)
    if distance(loose.points, tight.points) > SHARE * tolerance * range_of(
        tight.points, lab.length
    ):
        loose, tight = tight, lab.path(base, _TIGHTER**2)
    sizes = (base.n_discs,)
    if loose.failure or tight.failure:
        why = loose.failure or tight.failure
        return Reference(base, tight.points, lab.length, np.inf, False, found, sizes, sizes, why)
    scale = range_of(tight.points, lab.length)
    uncertainty = distance(loose.points, tight.points) / scale
    note = f"the discs as given; tighter integration changes it by {uncertainty:.1e}"
    converged = bool(uncertainty <= SHARE * tolerance)
    return Reference(base, tight.points, scale, uncertainty, converged, found, sizes, sizes, note)


def _segments(parts: int, finest: int) -> list[int]:
    """Numbers of segments to try: whole ones for each part, some 1.4 apart."""
    tries = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
    return [parts * k for k in tries if 1 < parts * k <= finest]


def _spatial_chart(lab: Lab) -> str | tuple[str, ...]:
    """The chart in space; the scene's own where damping or links without some freedoms need it."""
    charts = tuple(lab.scene.initial_chart or ())
    given = lab.scene.options.get("chart", "cardan")
    own = charts if not isinstance(given, str) else (given,) * len(charts)
    tied = lab.scene.options.get("damping") == "coordinate"
    if tied or any(name not in _SPATIAL for name in own):
        return given if isinstance(given, str) else tuple(given)
    return "cardan"


def _planarity(lab: Lab, spatial: str | tuple[str, ...]) -> Planarity:
    if spatial != "cardan":
        return Planarity(False, ("the chart is tied to the scene's damping or links",), np.nan)
    scene = lab.scene
    return planarity(scene, scene.build(chart="cardan"))
