"""The guided search: one axis at a time, then together within the budget, checked by running."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..actuators import Direct
from .candidate import STATICS, Candidate, merged
from .lab import Lab, Measured
from .reference import Reference

METHODS = ("heun", "rk4", "ros2", "rodas4")
# Steps of the coarsest run, and how much finer a step may get.
FEWEST_STEPS, FINEST_STEPS = 8, 40_000
# Errors that add up to more than this share of the tolerance may still cancel: worth a run.
_HOPE = 1.5
# Models of the motion for which integrators are tried.
_PHYSICS = 2


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
    measured: dict[Candidate, Measured]

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
        spare = self.reference.uncertainty if np.isfinite(self.reference.uncertainty) else 0.0
        return found.error + spare <= self.tolerance

    def run(self) -> Measured | None:
        """The cheapest candidate within the tolerance; None if there is none."""
        base = self.reference.candidate
        sizes = [replace(base, n_discs=n) for n in self.reference.sizes]
        fitting = [c for c in sizes if self.within(self.measure(c))]
        if self.lab.quantity != "pressure-response":
            self._at_rest(sizes)
            for candidate in fitting[:_PHYSICS]:
                self._moving(candidate)
            self._cheaper(sizes)
        return self.best()

    def best(self) -> Measured | None:
        """The cheapest one so far that says how it is integrated."""
        ready = [m for m in self.measured.values() if self.within(m)]
        fixed = [m for m in ready if m.candidate.step_s or not m.candidate.dynamic]
        return min(fixed or ready, key=lambda m: m.cost, default=None)

    def _at_rest(self, sizes: list[Candidate]) -> None:
        """Quasi-static models, from the smallest on, as long as there is hope."""
        if self.lab.model(self.reference.candidate)[1].actuator.command != "pressure":
            return  # what the valves do to the pressure takes time
        for candidate in sizes:
            still = replace(candidate, dynamic=False, method=STATICS, velocity_terms="none")
            found = self.measure(replace(still, actuator=self._direct()))
            if self.within(found) or found.error > self.measure(candidate).error + self.tolerance:
                return

    def _direct(self) -> str:
        actuator = self.lab.model(self.reference.candidate)[1].actuator
        return "scene" if isinstance(actuator, Direct) else "direct"

    def _moving(self, base: Candidate) -> None:
        """Leave out what the error budget allows, then look for steps."""
        spent = self.measure(base).error
        price: list[tuple[float, dict]] = []
        for change in self._omissions(base):
            found = self.measure(replace(base, **change))
            price.append((abs(found.error - spent), change))
        chosen: list[dict] = []
        for error, change in sorted(price, key=lambda pair: pair[0]):
            if spent + error <= self.tolerance and not chosen_overlap(chosen, change):
                spent += error
                chosen.append(change)
        while chosen and not self.within(self.measure(_changed(base, chosen))):
            chosen.pop()
        self._steps(_changed(base, chosen))

    def _omissions(self, base: Candidate) -> Iterator[dict]:
        """What can be left out of a model, one at a time."""
        _, model = self.lab.model(base)
        if base.velocity_terms == "full":
            yield {"velocity_terms": "none"}
        if not isinstance(model.actuator, Direct) and model.actuator.command == "pressure":
            yield {"actuator": "direct"}
        if self.lab.scene.robot.obstacles:
            yield {"contact": False}
        if base.chart == "cardan":
            yield from ({"chart": chart} for chart in self._flatter(base))

    def _flatter(self, base: Candidate) -> Iterator[str | tuple[str, ...]]:
        """Charts in which the segments that bend least out of the plane are planar."""
        scene, _ = self.lab.model(base)
        if np.any(scene.q0) or np.any(scene.qd0):
            return
        n = base.n_discs - 1
        for share in (1.0, 0.5):
            count = int(n * share)
            if count:
                # The tip end moves nothing beyond it: it has the smallest part in the shape.
                names = ("cardan",) * (n - count) + ("planar",) * count
                yield merged(names)

    def _steps(self, base: Candidate) -> None:
        """For each method the longest step that keeps the tolerance, to a factor of 1.4."""
        for method in METHODS:
            self._longest(replace(base, method=method))

    def _longest(self, base: Candidate) -> None:
        t_end = self.lab.scene.t_end
        first = max(FEWEST_STEPS, self.lab.fewest_steps(base))
        steps = first
        while steps <= FINEST_STEPS:
            found = self.measure(replace(base, step_s=t_end / steps))
            if self.within(found):
                between = round(steps / np.sqrt(2))
                if between >= first:
                    self.measure(replace(base, step_s=t_end / between))
                return
            best = self.best()
            if best and best.candidate.step_s and best.cost < found.cost < np.inf:
                return
            steps *= 2

    def _cheaper(self, sizes: list[Candidate]) -> None:
        """Next to the winner: fewer discs and one more omission, should errors cancel."""
        best = self.best()
        if best is None or not best.candidate.dynamic:
            return
        winner = best.candidate
        tries = [replace(winner, n_discs=c.n_discs) for c in sizes if c.n_discs < winner.n_discs]
        if isinstance(winner.chart, str):
            for candidate in tries[-2:]:
                self.measure(candidate)
        for change in self._omissions(winner):
            self.measure(replace(winner, **change))


def _changed(base: Candidate, changes: list[dict]) -> Candidate:
    for change in changes:
        base = replace(base, **change)
    return base


def chosen_overlap(chosen: list[dict], change: dict) -> bool:
    """Whether a change touches what another one has changed."""
    return any(set(other) & set(change) for other in chosen)
