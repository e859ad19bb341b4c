"""`dtcasadi sweep SCENE --over PATH=VALUES -o results.npz`: many runs of a scene."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SweepError
from .common import FAILED, Report, check_target

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from ..sweep import Sweep

_ROW = "{column:>18} {least:>12} {median:>12} {largest:>12}"
_SHOWN = ("max_tilt", "max_strain", "energy_imbalance")
_REASONS = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument(
        "--over",
        metavar="PATH=VALUES",
        action="append",
        required=True,
        help="what changes: springs.stiffness, payload, pressure, initial.beta_1 ... = lin(a,b,n), "
        "log(a,b,n), normal(mean,sd,n), uniform(a,b,n) or v1,v2,... in SI units; may be repeated: "
        "every combination, draws together",
    )
    parser.add_argument(
        "-o", "--output", metavar="F", required=True, help=".npz file; continued if unfinished"
    )
    parser.add_argument(
        "--save", metavar="NAME", nargs="+", default=(), help="more columns, such as q, tip.path"
    )
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="of random draws [0]")
    parser.add_argument("--method", metavar="NAME", help="integration method")
    parser.add_argument("--step", metavar="S", type=float, help="fixed step [s], on SIMD lanes")
    parser.add_argument("--t-end", metavar="S", type=float, help="duration [s]")
    parser.add_argument("--chart", metavar="NAME", help="coordinates instead of the scene's")
    parser.add_argument("--workers", metavar="N", type=int, help="processes [one for each core]")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, tcp://...")
    parser.add_argument(
        "--force", action="store_true", help="overwrite other results; take an unstable step"
    )


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Make the runs and say how they went."""
    from ..scene import load_scene
    from ..sweep import sweep

    over = _over(options.over)
    scene = load_scene(options.scene)
    output = Path(options.output)
    output = output if output.suffix == ".npz" else output.with_name(f"{output.name}.npz")
    report.wrote(check_target(output))  # from now on it holds what there is
    executor = _cluster(options.scheduler) if options.scheduler else None
    start = time.perf_counter()
    found = sweep(
        scene,
        over,
        output=output,
        executor=executor,
        workers=options.workers,
        seed=options.seed,
        save=options.save,
        step_s=options.step,
        method=options.method,
        t_end=options.t_end,
        options={"chart": options.chart} if options.chart else {},
        force=options.force,
        overwrite=options.force,
    )
    _describe(scene.name, found, time.perf_counter() - start, report)
    report.list_files()
    return None if found.success.any() else FAILED


def _over(words: list[str]) -> dict[str, str]:
    over: dict[str, str] = {}
    for word in words:
        path, equals, values = word.partition("=")
        path = path.strip()
        if not path or not equals or not values.strip():
            raise SweepError(f"--over: expected PATH=VALUES, got {word!r}")
        if path in over:
            raise SweepError(f"--over: expected each path once, got {path} twice")
        over[path] = values
    return over


def _cluster(address: str) -> "Executor":
    """The executor of a Dask cluster.

    Raises:
        SweepError: dask.distributed is missing, or nobody answers.
    """
    try:
        from distributed import Client
    except ImportError:
        hint = "pip install dtcasadi[cluster]"
        raise SweepError(f"--scheduler: expected dask.distributed ({hint}), got none") from None
    try:
        return Client(address, timeout=10).get_executor()
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise SweepError(f"--scheduler: expected a Dask scheduler at {address}: {reason}") from None


def _describe(scene: str, found: "Sweep", seconds: float, report: Report) -> None:
    import numpy as np

    good = found.success
    report.section("sweep", f"{scene} over {', '.join(found.names)}")
    report.line(
        "{runs} runs: {done} done, {failed} failed, {lost} lost; {seconds:.2f} s",
        runs=len(good),
        done=int(good.sum()),
        failed=int((found.status == 1).sum()),
        lost=int((found.status == 2).sum()),
        seconds=seconds,
    )
    reasons, counts = np.unique(found.reason[~good], return_counts=True)
    for k in np.argsort(-counts)[:_REASONS]:
        report.row("reasons", "{runs} x {reason}", runs=int(counts[k]), reason=str(reasons[k]))
    if not good.any():
        return
    print("  " + _ROW.format(column="", least="least", median="median", largest="largest"))
    tips = {f"tip {axis} m": found["tip"][good, k] for k, axis in enumerate("xyz")}
    for name, values in (tips | {name: found[name][good] for name in _SHOWN}).items():
        least, median, largest = (float(v) for v in np.percentile(values, [0, 50, 100]))
        report.row("table", _ROW, column=name, least=least, median=median, largest=largest)
