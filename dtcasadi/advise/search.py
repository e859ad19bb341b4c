"""The guided search: what each omission costs on a coarse model, then the cheapest sum that fits.

Compiling a model in space takes as long as thousands of its runs. What a model leaves out is
therefore priced on a coarse cut, where it hardly differs from finer ones; numbers of discs follow
the errors of the cuts that the reference needs anyway; and since costs are instructions, known
without a run, nothing is compiled that would be dearer than what has been found. Whatever is
advised has been run as it is.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..actuators import Direct
from .aside import flatter
from .candidate import STATICS, Candidate
from .lab import Lab, Measured, distance
from .reference import Reference

METHODS = ("rodas4", "ros2", "heun", "rk4")
# Steps of the coarsest run, and how much finer a step may get.
FEWEST_STEPS, FINEST_STEPS = 8, 40_000
# Errors that add up to more than this share of the tolerance may still cancel: worth a run.
_HOPE = 1.5
# Share of the tolerance up to which a number of discs leaves room for the integrator's error.
_ROOMY = 0.6
# Where planar segments would keep the tip from going further aside than this share of the
# tolerance, nothing else can make up for it.
_FAR = 5.0
# Segments of the cut on which omissions are priced.
_COARSE = 4
# Coordinates up to which every method is tried once, to be shown.
_QUICK = 24


class Omission(NamedTuple):
    """Something that a model can do without; of those of one kind at most one is left out."""

    kind: str
    apply: Callable[[Candidate], Candidate]
    effect: float


@dataclass(eq=False)
class Search:
    """What is known so far.

    Attributes:
        lab: runs candidates.
        reference: what they are measured against.
        tolerance: largest error that is allowed.
        measured: every candidate so far.
    """

    lab: Lab
    reference: Reference
    tolerance: float
    measured: dict[Candidate, Measured] = field(default_factory=dict)

    def measure(self, candidate: Candidate) -> Measured:
        """Run a candidate, once."""
        if candidate not in self.measured:
            path = self.lab.path(candidate)
            error = self.reference.error(path.points) if not path.failure else np.inf
            row = Measured(candidate, error, path.cost, path.wall_time, path.failure)
            self.measured[candidate] = row
        return self.measured[candidate]

    def within(self, found: Measured) -> bool:
        """Whether a candidate keeps the tolerance, the reference's own error included."""
        return found.error + self.reference.uncertainty <= self.tolerance

    def run(self) -> Measured | None:
        """The cheapest candidate within the tolerance; None if there is none."""
        for n in self.reference.cuts:
            self.measure(replace(self._base, n_discs=n))
        if self.reference.uncertainty >= self.tolerance:
            return None  # nothing can be known to keep it
        if self.lab.quantity == "pressure-response":
            next((c for c in self._fitting() if self.within(self.measure(c))), None)
            return self.best()
        self._at_rest()
        omissions = sorted(self._omissions(), key=_rank)
        kept = 0
        for candidate in self._fitting():
            chosen = self._affordable(candidate, omissions)
            if not self._hopeless(_without(candidate, chosen)):
                reduced = self._reduced(candidate, chosen)
                if not self.within(self.measure(reduced)):
                    continue
                self._steps(reduced)
            kept += 1
            # With little room left for steps, the next size may well be cheaper.
            if kept == 2 or self._expected(candidate.n_discs) < _ROOMY * self.tolerance:
                break
        self._cheaper(omissions)
        return self.best()

    def best(self) -> Measured | None:
        """The cheapest one so far that says how it is integrated."""
        ready = [m for m in self.measured.values() if self.within(m)]
        fixed = [m for m in ready if m.candidate.step_s or not m.candidate.dynamic]
        return min(fixed or ready, key=lambda m: m.cost, default=None)

    @property
    def _base(self) -> Candidate:
        return self.reference.candidate

    @property
    def _coarse(self) -> Candidate:
        """Where omissions are priced."""
        cuts = self.reference.cuts
        fine = [n for n in cuts if n > _COARSE]
        return replace(self._base, n_discs=min(fine, default=cuts[-1]))

    def _fitting(self) -> Iterator[Candidate]:
        """Sizes that are expected within the tolerance, ascending."""
        for n in self.reference.sizes:
            if self._expected(n) + self.reference.uncertainty <= self.tolerance:
                yield replace(self._base, n_discs=n)

    def _expected(self, n_discs: int) -> float:
        """Error with a number of discs, between the cuts as a power of the segments' number."""
        cuts = self.reference.cuts
        errors = [self.measure(replace(self._base, n_discs=n)).error for n in cuts]
        if not np.all(np.isfinite(errors)):
            return 0.0  # nothing is known
        logs = np.log(np.maximum(errors, 1e-12))
        return float(np.exp(np.interp(np.log(n_discs - 1), np.log(np.array(cuts) - 1), logs)))

    def _at_rest(self) -> None:
        """Quasi-static models, if the motion hardly differs from rest at each instant."""
        if self.lab.model(self._base)[1].actuator.command != "pressure":
            return  # what the valves do to the pressure takes time
        effect = self._effect(self._still)
        for n in self.reference.sizes:
            if effect + self._expected(n) > _HOPE * self.tolerance:
                continue
            if self.within(self.measure(self._still(replace(self._base, n_discs=n)))):
                return

    def _still(self, candidate: Candidate) -> Candidate:
        still = replace(candidate, dynamic=False, method=STATICS, velocity_terms="none")
        return still if self._has_direct() else replace(still, actuator="direct")

    def _has_direct(self) -> bool:
        return isinstance(self.lab.model(self._base)[1].actuator, Direct)

    def _effect(self, change: Callable[[Candidate], Candidate]) -> float:
        """How far a change moves the coarse model over the scale; infinite if it does not run."""
        changed = change(self._coarse)
        self.measure(changed)
        before, after = self.lab.path(self._coarse), self.lab.path(changed)
        if before.failure or after.failure:
            return np.inf
        return distance(before.points, after.points) / self.reference.scale

    def _omissions(self) -> Iterator[Omission]:
        """What can be left out of a model, and what that changes."""
        base = self._base
        choices: list[tuple[str, Callable[[Candidate], Candidate]]] = []
        if base.velocity_terms == "full":
            choices.append(("velocity", lambda c: replace(c, velocity_terms="none")))
        if not self._has_direct() and self.lab.model(base)[1].actuator.command == "pressure":
            choices.append(("actuator", lambda c: replace(c, actuator="direct")))
        if self.lab.scene.robot.obstacles:
            choices.append(("contact", lambda c: replace(c, contact=False)))
        for kind, apply in choices:
            yield Omission(kind, apply, self._effect(apply))
        yield from self._flatter()

    def _flatter(self) -> Iterator[Omission]:
        """Charts with planar segments, from the most of them down to what could do."""
        scene, _ = self.lab.model(self._coarse)
        aside = self.lab.path(self._coarse).aside
        if self._base.chart != "cardan" or np.any(scene.q0) or np.any(scene.qd0):
            return
        for k, chart in enumerate(flatter(aside, len(aside))):
            names = [chart] * len(aside) if isinstance(chart, str) else chart
            lost = sum(way for way, name in zip(aside, names, strict=True) if name == "planar")
            if lost > _FAR * self.tolerance * self.reference.scale:
                continue

            def apply(c: Candidate, k: int = k) -> Candidate:
                return replace(c, chart=list(flatter(aside, c.n_discs - 1))[k])

            one = Omission("chart", apply, self._effect(apply))
            yield one
            if one.effect < self.tolerance / 2:
                return

    def _affordable(self, base: Candidate, omissions: list[Omission]) -> list[Omission]:
        """What the error budget allows to leave out, in order."""
        spent = self._expected(base.n_discs)
        chosen: list[Omission] = []
        for one in omissions:
            taken = any(one.kind == other.kind for other in chosen)
            if not taken and spent + one.effect <= self.tolerance:
                spent += one.effect
                chosen.append(one)
        return chosen

    def _reduced(self, base: Candidate, chosen: list[Omission]) -> Candidate:
        """Without as much of it as keeps the tolerance."""
        while chosen and not self.within(self.measure(_without(base, chosen))):
            chosen = chosen[:-1]
        return _without(base, chosen)

    def _hopeless(self, base: Candidate) -> bool:
        """Whether the fewest steps of every method would cost more than the best so far."""
        return all(self._dearer(replace(base, method=name), FEWEST_STEPS) for name in METHODS)

    def _steps(self, base: Candidate) -> None:
        """For each method the longest step that keeps the tolerance, to a factor of 1.4."""
        for method in METHODS:
            self._longest(replace(base, method=method))

    def _longest(self, base: Candidate) -> None:
        t_end = self.lab.scene.t_end
        first = max(FEWEST_STEPS, self.lab.fewest_steps(base))
        unseen = self.lab.model(base)[1].n_q <= _QUICK
        steps = first
        while steps <= FINEST_STEPS:
            if self._dearer(base, steps) and not unseen:
                return
            found = self.measure(replace(base, step_s=t_end / steps))
            unseen = unseen and bool(found.failure)
            if self.within(found):
                between = round(steps / np.sqrt(2))
                if between >= first:
                    self.measure(replace(base, step_s=t_end / between))
                return
            steps *= 2

    def _dearer(self, base: Candidate, steps: int) -> bool:
        """Whether so many steps cost more than the best so far, known without a run."""
        best = self.best()
        if best is None or not (best.candidate.step_s or not best.candidate.dynamic):
            return False
        return steps * self.lab.step_cost(base) >= best.cost

    def _cheaper(self, omissions: list[Omission]) -> None:
        """Next to the winner: fewer discs or one more omission, should errors cancel."""
        best = self.best()
        if best is None or not best.candidate.step_s:
            return
        winner = best.candidate
        smaller = [n for n in self.reference.sizes if n < winner.n_discs]
        hoped = [n for n in smaller if self._expected(n) <= _HOPE * self.tolerance]
        applied = [one for one in omissions if one.apply(winner) == winner]
        for n in hoped[-2:]:
            self.measure(_without(replace(self._base, n_discs=n), applied, winner))
        for one in omissions:
            if one not in applied and best.error + one.effect <= _HOPE * self.tolerance:
                self.measure(one.apply(winner))


def _rank(one: Omission) -> tuple[bool, float]:
    """Least effect first; charts last, the flattest first, as they were made."""
    return one.kind == "chart", 0.0 if one.kind == "chart" else one.effect


def _without(
    base: Candidate, omissions: Sequence[Omission], like: Candidate | None = None
) -> Candidate:
    for one in omissions:
        base = one.apply(base)
    return replace(base, method=like.method, step_s=like.step_s) if like else base
