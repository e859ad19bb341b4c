"""Speed against accuracy: every method at every tolerance or step, on a scene and its models.

An error is that of the last disc's pose, in lengths of the robot: the largest along the run, at
the method's own steps. The reference is another method than those measured or much tighter, and
is itself held against one of a different family; errors count up to the time where the two differ
by 1e-10 lengths, and beyond it the balances of energy and momentum are given. All methods call the
same compiled state equation with the same exact Jacobian; wall time is the fastest of several
runs, without the report's energies. A point is on the frontier where nothing else on the same
model is both faster and more accurate. The total error is against the scene's own model: it has
the error of leaving out velocity terms, of the plane, of fewer discs or of rest at every instant
in it, so that finer steps stop paying where it no longer falls.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..cli.common import Report
    from ..scene import Scene
    from .precision_runs import Kind, Point

SCIPY = ("LSODA", "Radau", "BDF", "DOP853", "RK45", "RK23")
SUNDIALS = ("cvodes", "idas")
# On the models beside the scene's own and the plane's.
REDUCED = ("auto", "tsit5", "rodas4", "LSODA", "cvodes")
LEVELS = tuple(10.0**-k for k in range(2, 10))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("scene", metavar="SCENE", nargs="?", default="seed_four_disc")
    parser.add_argument("--methods", nargs="+", metavar="M", help="methods; default: all")
    parser.add_argument(
        "--own-model", action="store_true", help="the scene's own model only, no others beside it"
    )
    parser.add_argument("--png", type=Path, metavar="F", help="draw the chart into this file")


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure, compare, draw."""
    from ..cli.common import check_target
    from ..scene import load_scene

    if options.png:
        check_target(options.png)
    scene = load_scene(options.scene)
    chosen = _methods(options.methods)
    report.note(measure=" ".join(str(__doc__).split()), scene=scene.name)
    points, references = measured(scene, chosen, report, own_model=options.own_model)
    report.note(points=[asdict(point) for point in points])
    report.section("levels", "time to reach an error on the scene's own model")
    levels = compared(points)
    for level in levels:
        report.row("rows", _ROW, **level)
    if options.png:
        from .precision_picture import picture

        picture(scene.title, points, references, levels, options.png)
        report.wrote(options.png)
        report.list_files()


_ROW = (
    "{error}: ours {ours_s} s ({ours}), auto {auto_s} s, others {others_s} s ({others}); "
    "auto over best {auto_over_best}, others over ours {others_over_ours}"
)


def kinds(scene: "Scene", methods: Sequence[str], *, own_model: bool) -> list["Kind"]:
    """The scene's own model, and those that leave something out."""
    from .precision_runs import Kind

    n = scene.robot.n_discs
    own = str(scene.options.get("chart", "cardan"))
    velocity = str(scene.options.get("velocity_terms", "full"))
    few = tuple(name for name in methods if name in REDUCED)
    found = [Kind("as given", own, velocity, n, tuple(methods))]
    if own_model:
        return found
    spatial = own in ("cardan", "paper")
    if spatial:
        found.append(Kind("planar", "planar", velocity, n, tuple(methods)))
    if own == "cardan":
        found.append(Kind("chart paper", "paper", velocity, n, few))
    if own == "planar":
        found.append(Kind("in space", "cardan", velocity, n, few))
    found += [
        Kind(f"velocity terms {terms}", own, terms, n, few)
        for terms in ("paper", "none")
        if terms != velocity
    ]
    if spatial:
        found.append(Kind("planar, velocity terms none", "planar", "none", n, few))
    if scene.beam is not None:
        sizes = sorted({max(2, (n + 1) // 2), max(2, 3 * n // 4)} - {n}, reverse=True)
        found += [Kind(f"{size} discs", own, velocity, size, few) for size in sizes]
    return found


def measured(
    scene: "Scene", methods: Sequence[str], report: "Report", *, own_model: bool
) -> tuple[list["Point"], dict[str, Any]]:
    """Every point with its marks, and the references by the model's label."""
    from tqdm import tqdm

    from ..errors import BenchError
    from .precision_runs import built, points_of, quasi_static

    points: list[Point] = []
    references: dict[str, Any] = {}
    truth: Any = None
    wanted = kinds(scene, methods, own_model=own_model)
    bar = tqdm(
        total=sum(len(kind.methods) for kind in wanted),
        disable=not sys.stderr.isatty(),
        leave=False,
    )
    with bar:
        for kind in wanted:
            bar.set_description(kind.label)
            try:
                found, why = built(scene, kind), "its chart cannot hold the start"
            except BenchError as error:
                if kind is wanted[0]:
                    raise
                found, why = None, str(error)
            if found is None:
                print(f"  {kind.label}: {why}", flush=True)
                bar.update(len(kind.methods))
                continue
            reference = references[kind.label] = found[2]
            truth = truth or reference
            _say(kind.label, reference, scene.t_end)
            for method in kind.methods:
                points += points_of(method, scene, kind, found, truth)
                report.note(points=[asdict(point) for point in points])
                report.write_json()
                bar.update()
            if kind is wanted[0] and not own_model:
                rest = quasi_static(scene, found[1], truth)
                points += [rest] if rest else []
    report.note(
        references={
            label: {
                "methods": list(each.names),
                "trusted_until_s": each.trusted,
                "largest_gap": float(max(each.gaps)),
            }
            for label, each in references.items()
        }
    )
    return marked(points), references


def marked(points: Sequence["Point"]) -> list["Point"]:
    """The points with both frontiers marked."""
    from .precision_runs import on_frontier

    overall = on_frontier([(point.wall_s, point.total_error) for point in points])
    groups: dict[tuple, list[int]] = {}
    for i, point in enumerate(points):
        key = (point.chart, point.velocity_terms, point.n_discs)
        groups.setdefault(key, []).append(i)
    own = [False] * len(points)
    for group in groups.values():
        marks = on_frontier([(points[i].wall_s, points[i].error) for i in group])
        for i, mark in zip(group, marks, strict=True):
            own[i] = mark
    return [
        replace(point, on_frontier=first, on_overall_frontier=second)
        for point, first, second in zip(points, own, overall, strict=True)
    ]


def compared(points: Sequence["Point"]) -> list[dict[str, Any]]:
    """Fastest times to each error level on the first model, by origin of the method."""
    first = points[0] if points else None
    same = [
        point
        for point in points
        if first
        and (point.chart, point.velocity_terms, point.n_discs)
        == (first.chart, first.velocity_terms, first.n_discs)
    ]
    rows = []
    for level in LEVELS:
        reached = [point for point in same if point.error <= level]
        others = [p for p in reached if p.method in (*SCIPY, *SUNDIALS)]
        ours = [p for p in reached if p not in others]
        auto = [p for p in ours if p.method == "auto"]
        best, other, own = (min(g, key=_wall, default=None) for g in (ours, others, auto))
        fastest = min((p.wall_s for p in reached), default=None)
        rows.append(
            {
                "error": level,
                "ours": best and best.method,
                "ours_s": best and best.wall_s,
                "others": other and other.method,
                "others_s": other and other.wall_s,
                "auto_s": own and own.wall_s,
                "auto_over_best": own.wall_s / fastest if own and fastest else None,
                "others_over_ours": other.wall_s / best.wall_s if other and best else None,
            }
        )
    return rows


def _wall(point: "Point") -> float:
    return point.wall_s


def _say(label: str, reference: Any, t_end: float) -> None:
    agreed = f"agree to {max(reference.gaps):.1e} lengths"
    if reference.trusted < t_end:
        agreed = f"agree to 1e-10 lengths up to {reference.trusted:.3g} s of {t_end:g} s"
    print(f"  {label}: {' and '.join(reference.names)} {agreed}", flush=True)


def _methods(given: list[str] | None) -> tuple[str, ...]:
    """The methods to run, in the order of `METHODS`.

    Raises:
        BenchError: a name is not known.
    """
    from ..integrators import METHODS
    from .choices import chosen

    return chosen("--methods", given, tuple(METHODS))
