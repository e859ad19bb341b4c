"""Time to solution against SciPy and SUNDIALS at equal error, and the cost of one step.

All methods call the same compiled state equation with the same exact Jacobian. The error of a run
is how far the centre of the last disc is from a reference at the end, in lengths of the robot; the
reference is DOP853 at 1e-13, checked by rodas4 at 1e-11. A method's time at an error level is
its fastest run at any tolerance that reaches the level.
"""

import argparse
import math
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import harness
import numpy as np

import dtcasadi as dtc
from dtcasadi.integrators import METHODS, Problem
from dtcasadi.presets import rim, seed_four_disc

LEVELS = (1e-3, 1e-6, 1e-9)
TOLERANCES = tuple(10.0**-k for k in range(2, 12))
OURS = ("auto", "tsit5", "dopri5", "rodas4", "ros3")
SCIPY = ("LSODA", "Radau", "BDF", "DOP853", "RK45")
SUNDIALS = ("cvodes", "idas")
REPEATS = 3
# A method slower than this at one tolerance is not asked for a tighter one.
PATIENCE_S = 0.5


def scenes() -> dict[str, tuple[dtc.Model, np.ndarray, float, float]]:
    """Model, initial state, pressure and horizon of each scene."""
    seed = dtc.load_scene("seed_four_disc")
    cases = {}
    for name, chart in (("seed, spatial", "cardan"), ("seed, planar", "planar")):
        model = seed.build(chart=chart)
        cases[name] = (model, seed.x0(model), 12.0, 10.0)
    stiff = with_stiffness(seed_four_disc(), 5e3, dtc.Damping(2e3, 2e3, 2e3))
    model = dtc.build(stiff, chart="cardan")
    cases["stiff seed (k 5000, c 2000), spatial"] = (model, seed.x0(model), 300.0, 5.0)
    model = dtc.build(silicone(8), chart="planar")
    cases["silicone, 30 mm, 8 discs, planar"] = (model, np.zeros(model.n_x), 2000.0, 0.5)
    return cases


def with_stiffness(robot: dtc.Robot, stiffness: float, damping: dtc.Damping) -> dtc.Robot:
    """The robot with other springs and damping."""
    springs = tuple(replace(spring, stiffness=stiffness) for spring in robot.springs)
    return replace(robot, springs=springs, damping=damping)


def silicone(n_discs: int) -> dtc.Robot:
    """A tube of 30 mm with 4 mm radius and 1 mm wall of silicone (0.6 MPa, 1070 kg/m^3), by hand.

    Each pair has four axial springs E A / (4 l) and eight diagonal ones for shear and twist.
    """
    radius, length = 4e-3, 30e-3 / (n_discs - 1)
    mass = 1070 * 2 * math.pi * radius * 1e-3 * length
    axial = 0.6e6 * 2 * math.pi * radius * 1e-3 / (4 * length)
    angles = (45.0, 135.0, 225.0, 315.0)
    springs = []
    for i in range(1, n_discs):
        for k, angle in enumerate(angles):
            start, across = rim(radius, angle), rim(radius, angles[(k + 1) % 4])
            springs.append(dtc.Spring((i, i + 1), start, rim(radius, angle), axial))
            springs.append(dtc.Spring((i, i + 1), start, across, axial / 3))
            springs.append(dtc.Spring((i, i + 1), across, start, axial / 3))
    discs = [dtc.Disc.hoop(mass, radius) for _ in range(n_discs)]
    threads = [dtc.Thread(length) for _ in range(n_discs - 1)]
    damping = dtc.Damping(2e-6, 2e-6, 2e-6)
    return dtc.Robot(discs, threads, springs, [dtc.Chamber((1, n_discs))], damping)


def work_precision(case: tuple, methods: tuple[str, ...]) -> tuple[float, dict[str, list]]:
    """How well the references agree, and (error, wall, tolerance) of every method's runs."""
    model, x0, pressure, t_end = case
    pieces = dtc.Profile.constant(np.full(model.n_u, pressure)).pieces(0.0, t_end)

    def tip(method: str, rtol: float) -> tuple[np.ndarray | None, float]:
        problem = Problem(model, x0, model.theta0, pieces, rtol, rtol * 1e-2)
        METHODS[method].prepare(model)
        start = time.perf_counter()
        found = METHODS[method].integrate(problem)
        wall = time.perf_counter() - start
        if found.failure:
            return None, wall
        R, r = model.poses(found.x[: model.n_q, -1], found.thetas[:, -1])
        last = np.array(R)[:, -3:] @ model.robot.discs[-1].centroid + np.array(r)[:, -1]
        return last / model.robot.length, wall

    reference, second = tip("DOP853", 1e-13)[0], tip("rodas4", 1e-11)[0]
    if reference is None or second is None:
        raise harness.BenchmarkError("a reference run failed")
    points: dict[str, list] = {}
    for method in methods:
        rows: list = []
        points[method] = rows
        for rtol in TOLERANCES:
            value, wall = tip(method, rtol)
            if value is not None:
                again = [tip(method, rtol)[1] for _ in range(REPEATS - 1)]
                error = float(np.max(np.abs(value - reference)))
                rows.append((error, min([wall, *again]), rtol))
            if wall > PATIENCE_S:
                break
    return float(np.max(np.abs(second - reference))), points


def at_level(rows: list, level: float) -> float:
    """Fastest wall time that reaches an error level [s]; infinite where none does."""
    return min((wall for error, wall, _ in rows if error <= level), default=math.inf)


def step_costs(repeats: int) -> list[dict[str, Any]]:
    """One 50 ms step of the four-disc robot with its sensitivities, in microseconds.

    Stiffness 50, damping 20 on each rate, regulator lag 0.1 s; called through buffers (about
    0.2 us of the figure).
    """
    robot = with_stiffness(seed_four_disc(), 50.0, dtc.Damping(20, 20, 20))
    rows = []
    for chart in ("cardan", "planar"):
        model = dtc.build(robot, chart=chart, actuator=dtc.Regulator(time_constant=0.1))
        rng = np.random.default_rng(1)
        x = 0.1 * rng.normal(size=model.n_x)
        for method, exact in (("midpoint", True), ("midpoint", False), ("sdirk2", True)):
            discrete = model.discrete(0.05, method=method, exact=exact)
            row: dict[str, Any] = {"chart": chart, "method": method, "exact": exact}
            for name in ("step", "linearize"):
                bound = discrete.compiled(name)
                value = bound(x, np.array([12.0]), model.theta0)
                if name == "step":
                    row["status"] = float(value.status[0])
                else:
                    exact_x = model.discrete(0.05, method=method).compiled(name)
                    F_x = exact_x(x, np.array([12.0]), model.theta0).F_x
                    row["F_x_error"] = float(np.linalg.norm(value.F_x - F_x) / np.linalg.norm(F_x))
                walls = []
                for _ in range(repeats):
                    start = time.perf_counter()
                    for _ in range(2000):
                        bound.run()
                    walls.append((time.perf_counter() - start) / 2000)
                row[f"{name}_us"] = float(np.median(walls)) * 1e6
            rows.append(row)
    return rows


def measure_all(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Every scene's runs and every step's cost."""
    record: dict[str, Any] = {"scenes": {}}
    with harness.pinned():
        for name, case in scenes().items():
            agreement, points = work_precision(case, (*OURS, *SCIPY, *SUNDIALS))
            record["scenes"][name] = {"references_agree": agreement, "points": points}
        record["steps"] = step_costs(options.repeats)
    return record


def markdown(record: Mapping[str, Any]) -> str:
    """The record as a page."""
    page = ["# Integrators\n", f"{harness.machine_line(record)}\n", (__doc__ or "").strip() + "\n"]
    for name, scene in record["scenes"].items():
        page += _scene_page(name, scene["references_agree"], scene["points"])
    page += ["## One step of 50 ms with its sensitivities\n", f"{step_costs.__doc__}\n"]
    return "\n".join([*page, harness.records(record["steps"])])


def _scene_page(name: str, agreement: float, points: Mapping[str, list]) -> list[str]:
    header = ["method", *(f"ms at {level:.0e}" for level in LEVELS)]
    rows = [
        [method, *(at_level(found, level) * 1e3 for level in LEVELS)]
        for method, found in points.items()
    ]
    lines = [f"## {name}\n", f"The two references agree to {agreement:.1e} lengths.\n"]
    lines += [harness.table(header, rows)]
    for label, group in (("SciPy", SCIPY), ("cvodes/idas", SUNDIALS)):
        ratios = []
        for level in LEVELS:
            other = min(at_level(points[method], level) for method in group)
            ratios.append(other / at_level(points["auto"], level))
        text = ", ".join(f"{r:.1f} at {level:.0e}" for r, level in zip(ratios, LEVELS, strict=True))
        lines += [f"Best of {label} over auto: {text}.\n"]
    return lines


def main() -> int:
    """Run the benchmark; 0, or 1 with one line on stderr."""
    parser = harness.parser(__doc__ or "", "integrators.json", [4])
    return harness.main(parser.parse_args(), measure_all, markdown)


if __name__ == "__main__":
    sys.exit(main())
