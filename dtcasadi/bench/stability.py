"""Where which method fails: the largest stable step of each method on each hard scene.

A cell is the largest h = 10^(-k/4) s, k >= 0, whose run to the scene's horizon stays within twice
the reference's bound on energy, or why there is none down to the scene's smallest step. The bound
is on kinetic plus potential energy above the reference's lowest potential energy. Methods of this
package take fixed steps, those with an error estimate too, as they do in filters and controllers.
`auto` and the solvers of SciPy and SUNDIALS set their steps themselves: they run at the scene's
tolerances, may take as many steps as the smallest step allows, and have no largest step. The error
is that of the last disc's pose at the horizon, with the largest stable step, in lengths of the
robot; it is null where two reference methods do not agree.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..cli.common import Report

SOLVERS = ("auto", "LSODA", "Radau", "BDF", "DOP853", "RK45", "cvodes", "idas")


def scene_choices() -> tuple[str, ...]:
    """Short names of the map's scenes, in the order of its rows."""
    from ..scene import scene_names
    from .stability_reference import FOLDER

    found = {n.removeprefix(FOLDER) for n in scene_names() if n.startswith(FOLDER)}
    return tuple(name for name in ROWS if name in found) + tuple(sorted(found - set(ROWS)))


ROWS = (
    *("paper_start", "perturbed_1em15", "perturbed_1em3", "beta_1em2", "beta_1em3", "beta_0"),
    *("paper_start_coordinate", "perturbed_1em15_coordinate", "perturbed_1em3_coordinate"),
    *("beta_1em2_coordinate", "beta_1em3_coordinate", "beta_0_coordinate"),
    *("through_singularities", "fold_back", "small_stiff", "endless_spin", "heavy_payload"),
    *("long_conservative", "pre_curved", "many_discs", "curved_strip", "stiff_gas", "contact_wall"),
)


def method_choices() -> tuple[str, ...]:
    """Methods in the order of the map's columns; `moreau` is for rigid contact, in none of them."""
    from ..contact.stepping import TIME_STEPPING
    from ..integrators import ONE_STEP

    return (*SOLVERS, *(name for name in ONE_STEP if name != TIME_STEPPING))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("--scenes", nargs="+", metavar="S", help="names of scenes; default: all")
    parser.add_argument("--methods", nargs="+", metavar="M", help="methods; default: all")
    parser.add_argument("--png", type=Path, metavar="F", help="draw the map into this file")
    parser.add_argument("--workers", type=_workers, default=2, metavar="N", help="processes (2)")


def run(options: argparse.Namespace, report: "Report") -> None:
    """Fill the map; what is known so far is kept in the JSON file all along."""
    from ..cli.common import check_target
    from .choices import chosen

    given = options.scenes and [name.removeprefix("stability/") for name in options.scenes]
    scenes = chosen("--scenes", given, scene_choices())
    methods = chosen("--methods", options.methods, method_choices())
    if options.png:
        from .stability_picture import picture

        check_target(options.png)
    report.note(measure=" ".join(str(__doc__).split()))
    cells = measured(scenes, methods, options.workers, report)
    if options.png:
        picture(cells, methods, options.png)
        report.wrote(options.png)
        report.list_files()


def measured(
    scenes: tuple[str, ...], methods: tuple[str, ...], workers: int, report: "Report"
) -> dict[str, dict[str, Any]]:
    """Every cell, by scene and method."""
    from .stability_reference import reference_of
    from .stability_runs import cell_of
    from .workers import results

    references: dict[str, Any] = {}
    tasks: list[tuple] = [(scene,) for scene in _dear_first(scenes)]
    for (scene,), found in results(reference_of, tasks, workers=workers, title="references"):
        references[scene] = found
    kept = {
        scene: {"agreement": found.agreement, "energy_bound_J": found.most - found.floor}
        for scene, found in references.items()
    }
    report.note(references={scene: kept[scene] for scene in scenes})
    cells: dict[str, dict[str, Any]] = {scene: {} for scene in scenes}
    report.note(scenes=cells)
    tasks = [(s, m, references[s]) for s in _dear_first(scenes) for m in methods]
    print(f"\nlargest stable step of {len(methods)} methods on {len(scenes)} scenes", flush=True)
    for (scene, method, _), cell in results(cell_of, tasks, workers=workers, title="cells"):
        cells[scene][method] = cell
        report.write_json()
        if len(cells[scene]) == len(methods):
            cells[scene] = {name: cells[scene][name] for name in methods}
            _print(scene, cells[scene])
    return cells


# What takes longest to compile starts first, so that no worker is left with it at the end.
_DEAR = ("small_stiff", "many_discs", "pre_curved", "curved_strip")


def _dear_first(scenes: tuple[str, ...]) -> list[str]:
    return sorted(scenes, key=lambda name: _DEAR.index(name) if name in _DEAR else len(_DEAR))


def _print(scene: str, row: dict[str, Any]) -> None:
    """One scene's cells, the methods with the same outcome together."""
    print(f"  {scene}")
    for method, cell in row.items():
        error = "" if cell["error"] is None else f", error {cell['error']:.1e}"
        print(f"    {method:9} {cell['status']:8} {cell['reason']}{error}", flush=True)


def _workers(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 64:
        raise argparse.ArgumentTypeError(f"expected a number of processes, got {text!r}")
    return int(text)
