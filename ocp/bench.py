"""What `dtcasadi bench mpc` measures: time of a step, errors, cost against the converged solution.

Cases follow the tip of a hanging tube whose robot differs from the controller's model (scenes
`control/bend` and `control/tip`) with a filter in the loop; baselines run the planar one.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dtcasadi import load_scene
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.profile import Profile
from dtcasadi.scene import Scene

from .baselines import FullMPC, PIControl, StaticControl
from .closed_loop import Loop, closed_loop
from .faults import contract_kept
from .mpc import PressureMPC
from .pinned import pinned, timed
from .scenario import Experiment, control_of, experiment, model_of, spans
from .solvers import Solver
from .transcribe import transcribe

CASES = ("planar", "constraint_active", "regulation", "swing_up", "spatial")
BASELINES = ("pi", "static", "sqpmethod_rti", "ipopt")
_CONVERGED = "sqpmethod-hpipm"
_ROW = (
    "{name:18} {median_ms:>9} {p99_ms:>9} {tracking_rms_over_length:>9} "
    "{steady_error_over_length:>9} {cost_over_converged:>9} {violations:>5}"
)
_TITLES = {
    "name": "",
    "median_ms": "median ms",
    "p99_ms": "p99 ms",
    "tracking_rms_over_length": "rms / L",
    "steady_error_over_length": "steady/L",
    "cost_over_converged": "J / J*",
    "violations": "viol.",
}

Estimators = Callable[[Scene], Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES), help="which")
    parser.add_argument("--no-baselines", action="store_true", help="leave these out")
    parser.add_argument("--steps", type=int, default=1000, help="timed steps (1000)")
    parser.add_argument("--converged", type=float, default=5.0, help="span of J* [s] (5)")
    parser.add_argument("--faults", type=int, default=2000, help="steps with faults (2000)")
    parser.add_argument("--png", metavar="F", help="draw closed-loop cost against time per step")


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, and what became of it."""

    name: str
    scene: Scene
    found: Experiment
    estimator: Callable[[], Any]

    def run(self, controller: Any, t_end: float | None = None) -> Loop:
        """The closed loop."""
        estimator = self.estimator()
        return closed_loop(
            controller,
            self.found.plant,
            self.found.stages,
            t_end=t_end or self.scene.t_end,
            estimator=estimator,
            measured=control_of(self.scene).measured if estimator else None,
        )


def case_of(
    name: str, estimators: Estimators, *, method: str | None = None, **changes: Any
) -> Case:
    """A case by its name.

    Args:
        name: one of `CASES`.
        estimators: scene -> a filter for it.
        method: of integration, in place of the scene's.
        changes: of the scene's `Control`.
    """
    scene = load_scene(
        {"spatial": "control/tip", "swing_up": "control/swing_up"}.get(name, "control/bend")
    )
    control = control_of(scene)
    if name in ("planar", "constraint_active", "regulation"):
        tip: dict[str, Any] = {"outputs": ("tip",), "channels": (("y",),), "weight": 3000.0}
        control = replace(control, **tip, measured=("gauge", "tip"))
    if name == "constraint_active":
        control = replace(control, maximum=np.array([13e3]), rate=np.array([15e3]))
    if name == "regulation":
        control = replace(control, reference=Profile.constant(np.array([6e3])))
    scene = replace(scene, control=replace(control, **changes))
    discrete = model_of(scene, method=method)
    found = experiment(scene, discrete=discrete)
    alone = name == "swing_up"
    return Case(name, scene, found, lambda: None if alone else estimators(found.scene))


def run(options: argparse.Namespace, report: Any, *, estimators: Estimators) -> None:
    """Measure, case by case.

    Args:
        options: of `add_arguments`.
        report: where to say so.
        estimators: scene -> the filter of its loop.
    """
    report.section("cases", "cases: real-time iteration, compiled")
    print("  " + _ROW.format(**_TITLES))
    planar: Case | None = None
    with pinned():
        for name in options.cases:
            case = case_of(name, estimators)
            planar = case if name == "planar" else planar
            _line(report, name, measured(case, options.steps, options.converged))
        if not options.no_baselines:
            planar = planar or case_of("planar", estimators)
            report.section("baselines", "baselines, planar case; calls from Python")
            print("  " + _ROW.format(**_TITLES))
            best = planar.run(_full(planar.found, _CONVERGED), options.converged).cost
            for name in BASELINES:
                _line(report, name, _baseline(planar, name, best, options.converged))
        report.section("contract", "contract: random faults")
        planar = planar or case_of("planar", estimators)
        broken = contract_kept(planar.found, options.faults)
        report.line("{steps} steps, {broken} broken", steps=options.faults, broken=broken)
    if options.png:
        from .frontier import chart

        report.wrote(chart(estimators, options.png, report))


def measured(case: Case, steps: int, converged_s: float) -> dict[str, Any]:
    """The figures of a case; cost against the converged solution over its first seconds.

    Args:
        case: the case.
        steps: of the controller that are timed.
        converged_s: span over which the converged solution is run too [s]; zero: not at all.
    """
    loop = case.run(_rti(case.found))
    ms = 1e3 * timed_steps(case.found, loop, steps)
    figures = _figures(case, loop, ms)
    if converged_s:
        both = [
            case.run(make, converged_s).cost
            for make in (_rti(case.found), _full(case.found, _CONVERGED))
        ]
        figures["cost_over_converged"] = both[0] / both[1]
    return figures


def timed_steps(found: Experiment, loop: Loop, steps: int) -> np.ndarray:
    """Seconds of each step of the compiled controller, fed with what the loop gave it."""
    mpc = _rti(found)
    exposed = mpc.functions()
    control = Bound(twin(exposed["control"].function, source=exposed["control"].source))
    start = Bound(twin(exposed["control_start"].function))
    memory = np.atleast_1d(start(found.plant.u0))
    s = found.stages
    rows = [(est, s.references(t).T) for est, t in zip(loop.estimate, loop.t, strict=True)]
    inputs = control.inputs._asdict()

    def feed(k: int) -> None:
        est, reference = rows[k % len(rows)]
        inputs["x"][:] = est.x
        inputs["theta"][:] = est.theta
        inputs["reference"][...] = np.reshape(reference, inputs["reference"].shape)
        if k:
            inputs["memory"][:] = control.outputs.memory_next
        else:
            inputs["memory"][:] = memory

    return timed(control.run, feed, steps)


def _rti(found: Experiment) -> PressureMPC:
    return PressureMPC(found.stages.discrete, found.stages.problem, u0=found.plant.u0)


def _full(found: Experiment, solver: str, **options: Any) -> FullMPC:
    return FullMPC(Solver(transcribe(found.stages), solver, **options), found.plant.u0)


def _baseline(case: Case, name: str, best: float, converged_s: float) -> dict[str, Any]:
    """One baseline; the full solver for the span of J* only."""
    found = case.found
    s, u0 = found.stages, found.plant.u0
    controller: Any = {
        "pi": lambda: PIControl(s, u0),
        "static": lambda: StaticControl(s, u0),
        # Stopped after a step, the solver leaves the gaps of its linear model.
        "sqpmethod_rti": lambda: FullMPC(
            Solver(transcribe(s), _CONVERGED, most=1), u0, accept=np.inf
        ),
        "ipopt": lambda: _full(found, "ipopt"),
    }[name]()
    loop = case.run(controller)
    figures = _figures(case, loop, 1e3 * loop.seconds[1:])
    early = loop.t <= converged_s + 1e-9
    figures["cost_over_converged"] = replace_span(loop, early).cost / best
    return figures


def replace_span(loop: Loop, kept: np.ndarray) -> Loop:
    """The log's part where `kept` is true."""
    names = ("t", "y", "reference", "u", "x", "theta", "seconds")
    return replace(loop, **{name: getattr(loop, name)[kept] for name in names})


def _figures(case: Case, loop: Loop, ms: np.ndarray) -> dict[str, Any]:
    rests, moves = spans(control_of(case.scene).reference, case.scene.t_end)
    length = case.found.length
    return {
        "median_ms": float(np.median(ms)),
        "p99_ms": float(np.quantile(ms, 0.99)),
        "tracking_rms_over_length": (
            max(loop.rms(*span) for span in moves) / length if moves else None
        ),
        "steady_error_over_length": (
            max(loop.steady(*span) for span in rests) / length if rests else None
        ),
        "cost_over_converged": None,
        "violations": loop.violations,
    }


def _line(report: Any, name: str, figures: dict[str, Any]) -> None:
    report.entry(name, _ROW, figures)
