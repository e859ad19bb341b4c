"""How long identification takes: six parameters from 10 s at 100 Hz, in the plane and in space."""

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..cli.common import Report
    from ..scene import Scene

CHARTS, ROBOTS = ("planar", "cardan"), ("seed", "tentacle")
SPACING_S, DURATION_S = 0.01, 10.0
# The robot that is recorded, over the scene's numbers, which the search starts from.
FACTORS = {
    "seed": {
        "springs.stiffness": 1.3,
        "damping.c_a": 0.7,
        "damping.c_b": 1.3,
        "chambers.areas": 1.2,
        "discs[3].mass": 0.8,
        "discs[4].mass": 1.25,
    },
    "tentacle": {
        "springs.stiffness": 1.3,
        "springs.damping": 0.7,
        "chambers.areas": 1.2,
        "discs[2].mass": 1.4,
        "discs[3].mass": 0.8,
        "discs[4].mass": 1.25,
    },
}
_LARGEST = {"seed": 12.0, "tentacle": 4000.0}  # pressures [Pa]
_ROW = (
    "{robot:8} {chart:8} {readings:>8} {steps:>6} {step_ms:>8} {iterations:>10} "
    "{per_iteration_s:>11} {solve_s:>8} {build_s:>8} {off:>10} {step_error:>10}"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=["seed"])
    parser.add_argument("--charts", nargs="+", choices=CHARTS, default=list(CHARTS))
    parser.add_argument(
        "--duration", metavar="S", type=float, default=DURATION_S, help="of the recording [10]"
    )
    parser.add_argument("--method", metavar="NAME", default="sdirk2", help="one-step method")
    parser.add_argument("--step", metavar="S", type=float, help="step of the model [the scene's]")


def run(options: argparse.Namespace, report: "Report") -> None:
    """Record, identify, and say how long it took and how far off it is."""
    from ..compiler import find_compiler

    compiler = find_compiler()
    report.section(
        "identify", f"six parameters from {options.duration:g} s at {1 / SPACING_S:g} Hz"
    )
    report.note(compiler=compiler.version if compiler else None, duration_s=options.duration)
    report.line(
        "{how}; the search takes solve [s]; building and compiling, or finding what was compiled, "
        "build [s]",
        how="compiled" if compiler else "CasADi's virtual machine",
    )
    titles = {
        "robot": "robot",
        "chart": "chart",
        "readings": "readings",
        "steps": "steps",
        "step_ms": "step ms",
        "iterations": "iterations",
        "per_iteration_s": "s/iteration",
        "solve_s": "solve",
        "build_s": "build",
        "off": "off/sigma",
        "step_error": "step/noise",
    }
    print("  " + _ROW.format(**titles))
    for robot in options.robots:
        for chart in options.charts:
            _row(report, robot, chart, options)


def excited(robot: str, duration_s: float) -> "Scene":
    """A robot with sensors under a pressure that jumps every half second."""
    from ..profile import Profile
    from ..scene import load_scene
    from ..sensors import IMU, Marker

    times = np.arange(0, duration_s, 0.5)
    values = np.random.default_rng(0).uniform(0, _LARGEST[robot], len(times))
    pressure = Profile(times, values)
    if robot == "tentacle":
        scene = load_scene("estimation/tentacle")
        return replace(scene, pressure=pressure, t_end=duration_s)
    cameras = [Marker(name=f"mark{disc}", disc=disc, noise=0.005) for disc in (2, 3, 4)]
    sensors = (*cameras, IMU(name="chip", disc=4, noise=0.02))
    scene = load_scene("seed_four_disc")
    return replace(scene, pressure=pressure, t_end=duration_s, sensors=sensors)


def _row(report: "Report", robot: str, chart: str, options: argparse.Namespace) -> None:
    from ..identify import identify
    from ..recording import experiment

    scene, factors = excited(robot, options.duration), FACTORS[robot]
    log = experiment(scene, SPACING_S, factors=factors, chart=chart)
    found = identify(
        scene, log, tuple(factors), chart=chart, method=options.method, step_s=options.step
    )
    problem = found.problem
    off = (found.values / found.starts - [*factors.values()]) / (found.sigma / found.starts)
    report.row(
        "timings",
        _ROW,
        robot=robot,
        chart=chart,
        parameters=len(factors),
        readings=len(log.t),
        steps=problem.data[0].n,
        step_ms=1e3 * problem.discrete.step_s,
        iterations=found.iterations,
        per_iteration_s=found.solve_s / max(found.iterations, 1),
        solve_s=found.solve_s,
        build_s=found.build_s,
        off=float(np.max(np.abs(off))),
        step_error=found.step_error,
        status=found.status,
        method=options.method,
        passed=found.tests.passed,
    )
