"""Simulating a scene and saying how it went: what `demo` and `simulate` share."""

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import SimulationError
from .common import Report, phase

if TYPE_CHECKING:
    from ..model import Model
    from ..result import Run
    from ..scene import Scene

_SLACK_SAMPLES = 200


def simulated(
    scene: "Scene", report: Report, build: dict[str, Any], *, force: bool = False, **settings: Any
) -> "Run":
    """Build, compile and integrate a scene, each phase timed and reported.

    Args:
        scene: the scene.
        report: where to say so.
        build: options that replace the scene's.
        force: take a fixed step beyond the linear stability limit.
        settings: fields of the scene to replace, such as t_end; None leaves them.

    Raises:
        DtcasadiError: a setting cannot be used; before anything is compiled.
    """
    from ..integrators import METHODS
    from ..simulate import simulate

    scene = replace(scene, **{key: value for key, value in settings.items() if value is not None})
    if scene.method not in METHODS:
        expected = f"one of {', '.join(METHODS)}"
        raise SimulationError(f"method: expected {expected}, got {scene.method!r}")
    start = time.perf_counter()
    model = scene.build(**build)
    x0 = scene.x0(model)
    built = time.perf_counter() - start
    describe(scene, model, report)
    report.section("phases", "wall time")
    report.line("build the model      {build:8.3f} s", build=built)
    with phase(report, "compile", "compile, or find it  {seconds:8.3f} s"):
        METHODS[scene.method].prepare(model)
    start = time.perf_counter()
    run = simulate(
        model,
        x0,
        pressure=scene.pressure,
        t_end=scene.t_end,
        method=scene.method,
        rtol=scene.rtol,
        atol=scene.atol,
        step_s=scene.step_s,
        fixed=scene.fixed,
        force=force,
    )
    checks = time.perf_counter() - start - run.wall_time
    report.line("integrate            {integrate:8.3f} s", integrate=run.wall_time)
    report.line("energy, conditioning {checks:8.3f} s", checks=checks)
    return run


def describe(scene: "Scene", model: "Model", report: Report) -> None:
    """The scene and its model."""
    charts = sorted({chart.name for chart in model.charts})
    report.section("scene", f"{scene.name}: {scene.title}")
    report.note(name=scene.name, title=scene.title)
    report.line(
        "discs {n_discs}, springs {n_springs}, chambers {n_chambers}; chart {chart}, "
        "coordinates {n_q}, states {n_x}",
        n_discs=model.n_discs,
        n_springs=len(model.robot.springs),
        n_chambers=model.n_u,
        chart="/".join(charts),
        n_q=model.n_q,
        n_x=model.n_x,
    )


def draw(run: "Run", folder: Path, report: Report, view: str | None = None) -> None:
    """The pictures of a run: three, and one of the air supply where there is more to it."""
    from .. import air_plots, plots
    from ..actuators import Direct

    for name in ("filmstrip", "coordinates", "energy_and_pressure"):
        path = folder / f"{name}.png"
        options = {"view": view} if name == "filmstrip" else {}
        getattr(plots, name)(run, path, **options)
        report.wrote(path)
    if not isinstance(run.model.actuator, Direct):
        air_plots.air(run, folder / "air.png")
        report.wrote(folder / "air.png")


def health(run: "Run", report: Report) -> None:
    """How far the run can be trusted."""
    import numpy as np

    report.section("health", "health")
    report.line("{outcome}: {message}", outcome=_outcome(run), message=run.message)
    report.note(success=run.success)
    report.line(
        "method {method}: {steps} steps, {rejected} rejected, {evaluations} evaluations of the "
        "state equation",
        method=run.method,
        steps=run.steps,
        rejected=run.rejected,
        evaluations=run.evaluations,
    )
    report.note(choice=run.choice)
    if run.choice:
        report.line("why: {choice}", choice=run.choice)
    energy = run.energy
    if not np.all(np.isfinite([values[-1] for values in energy.values()])):
        report.line("energies and tensions of the last states are beyond what numbers can hold")
        return
    report.line(
        "energy: kinetic {kinetic_J:.4g} J, potential {potential_change_J:+.4g} J since the start, "
        "supplied {supplied_J:.4g} J, dissipated {dissipated_J:.4g} J",
        kinetic_J=energy["kinetic"][-1],
        potential_change_J=energy["potential"][-1] - energy["potential"][0],
        supplied_J=energy["supplied"][-1],
        dissipated_J=energy["dissipated"][-1],
    )
    if np.any(energy["stored"]):
        report.line(
            "the actuator holds {stored_change_J:+.4g} J more than at the start",
            stored_change_J=energy["stored"][-1] - energy["stored"][0],
        )
    report.line(
        "energy balance: residual at most {residual_J:.1e} J",
        residual_J=np.abs(energy["residual"]).max(),
    )
    report.line(
        "condition number of the mass matrix: {condition_min:.4g} to {condition_max:.4g}",
        condition_min=run.condition.min(),
        condition_max=run.condition.max(),
    )
    if run.touched is None:  # impulses have no part in the equation of tensions
        lowest, segment, moment = _lowest_tension(run)
        report.line(
            "lowest thread tension: {tension_N:.4g} N, in thread {tension_thread} at "
            "{tension_s:.3g} s{tension_remark}",
            tension_N=lowest,
            tension_thread=segment,
            tension_s=moment,
            tension_remark=" (negative: a real thread would go slack)" if lowest < 0 else "",
        )
    _touches(run, report)
    report.line("charts re-centred {recentrings} times", recentrings=len(run.recentrings))


def _touches(run: "Run", report: Report) -> None:
    """What touched how hard, of a robot that something can touch."""
    import numpy as np

    if not run.model.robot.touchable:
        return
    contacts = run.contacts
    force, gap = np.linalg.norm(contacts.force, axis=1), contacts.gap
    report.line(
        "contact in {contact_times} of {contact_samples} steps, of discs {contact_discs}: forces "
        "up to {contact_N:.4g} N, at most {penetration_m:.1e} m deep",
        contact_times=len(np.unique(contacts.t)),
        contact_samples=len(run.t),
        contact_discs=", ".join(map(str, np.unique(contacts.disc))) or "none",
        contact_N=force.max(initial=0.0),
        penetration_m=-gap.min(initial=0.0),
    )
    if run.touched is not None:
        report.line(
            "impulses: work {impulses_J:.3g} J, friction cones to {cone_defect:.1e}; projections: "
            "work {projections_J:.3g} J",
            impulses_J=run.touched.work[-1],
            cone_defect=run.touched.defect,
            projections_J=run.touched.projected[-1],
        )


def _outcome(run: "Run") -> str:
    return "succeeded" if run.success else "FAILED"


def _lowest_tension(run: "Run") -> tuple[float, int, float]:
    """Tension [N], number of its thread and time [s], at no more than 200 steps."""
    import numpy as np

    model, n = run.model, len(run.t)
    at = np.unique(np.linspace(0, n - 1, min(n, _SLACK_SAMPLES)).round().astype(int))
    pressure = run.pressure
    tension: np.ndarray = np.array(
        [
            np.array(
                model.thread_tension(
                    run.q[:, k], run.qd[:, k], pressure[:, k], np.zeros(model.n_q), run.thetas[:, k]
                )
            ).ravel()
            for k in at
        ]
    )
    step, segment = np.unravel_index(np.argmin(tension), tension.shape)
    return float(tension[step, segment]), int(segment) + 1, float(run.t[at[step]])
