"""What `dtcasadi bench mpc` measures: time of a step, errors, cost against the converged solution.

Cases follow the tip of a hanging tube whose robot differs from the controller's model (scenes
`control/bend` and `control/tip`) with a filter in the loop; baselines run the planar one.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from time import perf_counter
from typing import Any

import numpy as np

from dtcasadi import load_scene
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.discrete import DiscreteModel
from dtcasadi.profile import Profile
from dtcasadi.scene import Scene

from .baselines import FullMPC, PIControl, StaticControl
from .closed_loop import Loop, closed_loop
from .faults import contract_kept
from .mpc import PressureMPC
from .pinned import pinned, timed
from .scenario import Experiment, control_of, experiment, model_of, rested, robot_of, spans
from .solvers import Solver
from .transcribe import transcribe

CASES = ("planar", "constraint_active", "regulation", "swing_up", "spatial")
# Solvers take so long that they run over the span of J* only, as does ours beside them.
BASELINES = ("pi", "static", "rti_same_span", "sqpmethod_rti", "ipopt", "sqpmethod_rti_spatial")
_LONG = ("pi", "static")
_SCENES = {"spatial": "control/tip", "swing_up": "control/swing_up"}
_CONVERGED = "sqpmethod-hpipm"
# Converged solutions are of a step whose derivatives are exact.
_EXACT = "midpoint"
_ROW = (
    "{name:21} {median_ms:>9} {p99_ms:>9} {tracking_rms_over_length:>9} "
    "{steady_error_over_length:>9} {cost_over_converged:>9} {violations:>5} {wall_s:>7}"
)
_TITLES = {
    "name": "",
    "median_ms": "median ms",
    "p99_ms": "p99 ms",
    "tracking_rms_over_length": "rms / L",
    "steady_error_over_length": "steady/L",
    "cost_over_converged": "J / J*",
    "violations": "viol.",
    "wall_s": "wall s",
}

Estimators = Callable[[Scene], Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES), help="which")
    parser.add_argument("--no-baselines", action="store_true", help="leave these out")
    parser.add_argument("--steps", type=int, default=1000, help="timed steps (1000)")
    parser.add_argument("--converged", type=float, default=2.0, help="span of J* [s] (2)")
    parser.add_argument("--faults", type=int, default=2000, help="steps with faults (2000)")
    parser.add_argument("--png", metavar="F", help="draw closed-loop cost against time per step")


@dataclass(frozen=True, eq=False)
class Case:
    """A scene, and what became of it."""

    name: str
    scene: Scene
    found: Experiment
    estimator: Any

    def run(self, controller: Any, t_end: float | None = None) -> Loop:
        """The closed loop."""
        return closed_loop(
            controller,
            self.found.plant,
            self.found.stages,
            t_end=t_end or self.scene.t_end,
            estimator=self.estimator,
            measured=control_of(self.scene).measured if self.estimator else None,
        )


def case_of(
    name: str,
    estimators: Estimators,
    *,
    method: str | None = None,
    discs: int | None = None,
    **changes: Any,
) -> Case:
    """A case by its name.

    Args:
        name: one of `CASES`.
        estimators: scene -> a filter for it.
        method: of integration, in place of the scene's.
        discs: of the controller's and the filter's model, in place of the scene's.
        changes: of the scene's `Control`.
    """
    file = _SCENES.get(name, "control/bend")
    scene = _scene(file, discs)
    control = control_of(scene)
    if name in ("planar", "constraint_active", "regulation"):
        tip: dict[str, Any] = {"outputs": ("tip",), "channels": (("y",),), "weight": 3000.0}
        control = replace(control, **tip, measured=("gauge", "tip"))
    if name == "constraint_active":
        control = replace(control, maximum=np.array([13e3]), rate=np.array([15e3]))
    if name == "regulation":
        control = replace(control, reference=Profile.constant(np.array([6e3])))
    scene = replace(scene, control=replace(control, **changes))
    discrete = _model(file, discs, method or control.method)
    found = experiment(scene, discrete=discrete, robot=_robot(file))
    start = tuple(float(u) for u in found.plant.u0)
    estimator = None if name == "swing_up" else _filter(estimators, file, discs, start)
    return Case(name, scene, found, estimator)


def _scene(file: str, discs: int | None) -> Scene:
    scene = load_scene(file)
    return scene.rediscretised(discs) if discs else scene


@lru_cache
def _model(file: str, discs: int | None, method: str) -> DiscreteModel:
    """Cases that differ in their problem alone share a model, and its compiled steps."""
    return model_of(_scene(file, discs), method=method)


@lru_cache
def _robot(file: str) -> DiscreteModel:
    return robot_of(load_scene(file))


@lru_cache
def _filter(estimators: Estimators, file: str, discs: int | None, start: tuple[float, ...]) -> Any:
    """Cases that start from the same pressures share a filter."""
    scene = _scene(file, discs)
    control = control_of(scene)
    begun = replace(control, reference=Profile.constant(np.array(start)))
    model = _model(file, discs, control.method).model
    return estimators(rested(replace(scene, control=begun), model))


def run(options: argparse.Namespace, report: Any, *, estimators: Estimators) -> None:
    """Measure, case by case.

    Args:
        options: of `add_arguments`.
        report: where to say so.
        estimators: scene -> the filter of its loop.
    """
    report.section("cases", "cases: real-time iteration, compiled")
    print("  " + _ROW.format(**_TITLES))

    @cache
    def case(name: str, method: str | None = None) -> Case:
        return case_of(name, estimators, method=method)

    @cache
    def best(name: str, span: float) -> float:
        """J* of a case over its first seconds."""
        exact = case(name, _EXACT).found
        return case(name).run(_full(exact, _CONVERGED), span).cost

    with pinned():
        for name in options.cases:
            began = perf_counter()
            loop, figures = measured(case(name), options.steps)
            if options.converged:
                figures["cost_over_converged"] = _until(loop, options.converged).cost / best(
                    name, options.converged
                )
            _line(report, name, figures | {"wall_s": perf_counter() - began})
        if not options.no_baselines:
            report.section("baselines", "baselines: time of the solver, or of the call from Python")
            print("  " + _ROW.format(**_TITLES))
            span = options.converged or 2.0
            for name in BASELINES:
                of = "spatial" if name.endswith("spatial") else "planar"
                if of not in ("planar", *options.cases):
                    continue
                began = perf_counter()
                loop = _baseline(case(of), case(of, _EXACT), name, span)
                figures = _figures(case(of), loop, _ms(loop))
                figures["cost_over_converged"] = _until(loop, span).cost / best(of, span)
                figures["span_s"] = loop.t[-1]
                _line(report, name, figures | {"wall_s": perf_counter() - began})
        report.section("contract", "contract: random faults")
        broken = contract_kept(case("planar").found, options.faults)
        report.line("{steps} steps, {broken} broken", steps=options.faults, broken=broken)
    if options.png:
        from .frontier import chart

        report.wrote(chart(estimators, options.png, report))


def measured(case: Case, steps: int) -> tuple[Loop, dict[str, Any]]:
    """The loop of a case, and its figures; so many steps of the controller are timed."""
    loop = case.run(rti(case.found))
    ms = 1e3 * timed_steps(case.found, loop, steps)
    return loop, _figures(case, loop, ms)


def timed_steps(
    found: Experiment, loop: Loop, steps: int, *, iterations: int | None = None
) -> np.ndarray:
    """Seconds of each step of the compiled controller, fed with what the loop gave it."""
    mpc = rti(found, iterations=iterations)
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


def rti(found: Experiment, *, iterations: int | None = None) -> PressureMPC:
    """The controller of an experiment; `iterations` as there."""
    s = found.stages
    return PressureMPC(s.discrete, s.problem, u0=found.plant.u0, iterations=iterations)


def _full(found: Experiment, solver: str, **options: Any) -> FullMPC:
    return FullMPC(Solver(transcribe(found.stages), solver, **options), found.plant.u0)


def _baseline(case: Case, exact: Case, name: str, span: float) -> Loop:
    """The loop of a baseline; `exact` is the case with the step of converged solutions."""
    s, u0 = case.found.stages, case.found.plant.u0
    controller: Any = {
        "pi": lambda: PIControl(s, u0),
        "static": lambda: StaticControl(s, u0),
        "rti_same_span": lambda: rti(case.found),
        # Stopped after a step, the solver leaves the gaps of its linear model.
        "sqpmethod_rti": lambda: FullMPC(
            Solver(transcribe(s), _CONVERGED, most=1), u0, accept=np.inf
        ),
        "ipopt": lambda: _full(exact.found, "ipopt"),
    }[name.removesuffix("_spatial")]()
    return case.run(controller, case.scene.t_end if name in _LONG else span)


def _ms(loop: Loop) -> np.ndarray:
    """Time of each call but the first; of the solver alone where there is one."""
    solutions = [getattr(told, "solution", None) for told in loop.told]
    given = [*zip(loop.seconds, solutions, strict=True)][1:]
    return 1e3 * np.array([s if found is None else found.solve_s for s, found in given])


def _until(loop: Loop, t_end: float) -> Loop:
    """A log's first part."""
    return replace_span(loop, loop.t <= t_end + 1e-9)


def replace_span(loop: Loop, kept: np.ndarray) -> Loop:
    """The log's part where `kept` is true."""
    names = ("t", "y", "reference", "u", "x", "theta", "seconds")
    return replace(loop, **{name: getattr(loop, name)[kept] for name in names})


def _figures(case: Case, loop: Loop, ms: np.ndarray) -> dict[str, Any]:
    rests, moves = spans(control_of(case.scene).reference, float(loop.t[-1]))
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
    report.write_json()
