"""Timing compiled drivers against each other: one core, one run, interleaved, checked first."""

import argparse
import importlib.metadata
import json
import math
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).parent / "results"
TOLERANCE = 1e-9
N_STATES = 64
SCHEMA = 1
_FEATURES = {"avx512f": "AVX-512", "avx2": "AVX2", "asimd": "NEON"}
_PACKAGES = ("casadi", "numpy", "pin", "mujoco")


class BenchmarkError(RuntimeError):
    """Something cannot be built, run or believed; the text says what."""


@dataclass(frozen=True)
class Case:
    """One program to time on one set of states.

    Attributes:
        label: its name in the results.
        command: driver and its own arguments, before those of `driver.h`.
        states: what the driver reads, shape (n_states, width).
        results: turns what it writes, shape (n_states, n), into what all cases must agree on.
    """

    label: str
    command: tuple[str, ...]
    states: np.ndarray
    results: Callable[[np.ndarray], np.ndarray] = lambda values: values


@dataclass(frozen=True)
class Timing:
    """Time per call over the repeats, and the largest relative difference from the reference."""

    median_us: float
    minimum_us: float
    difference: float


def run(command: Sequence[str], timeout_s: float | None = None) -> str:
    """Standard output of a command, never through a shell.

    Raises:
        BenchmarkError: it cannot be run, takes too long, or fails.
    """
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=timeout_s, errors="replace"
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BenchmarkError(f"{Path(command[0]).name}: {error}") from error
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "error" in line] or [done.stderr]
        text = "\n".join(lines[:3]).strip()
        raise BenchmarkError(f"{Path(command[0]).name} failed ({done.returncode}): {text}")
    return done.stdout


def difference(values: np.ndarray, reference: np.ndarray) -> float:
    """Largest difference of a state's vector relative to its largest entry; NaN counts as inf."""
    scale = np.max(np.abs(reference), axis=1)
    worst = np.max(np.max(np.abs(values - reference), axis=1) / np.where(scale > 0, scale, 1.0))
    return float(worst) if np.isfinite(worst) else float("inf")


def check(case: Case, reference: np.ndarray, folder: Path) -> float:
    """Run a case once on every state and compare; see `difference`."""
    _drive(case, folder, 0.0)
    raw = np.fromfile(folder / "results.bin").reshape(len(case.states), -1)
    values = case.results(raw)
    if values.shape != reference.shape:
        text = f"results of shape {values.shape}, expected {reference.shape}"
        raise BenchmarkError(f"{case.label}: {text}")
    return difference(values, reference)


def measure(
    cases: Sequence[Case],
    reference: np.ndarray,
    *,
    repeats: int = 9,
    seconds: float = 0.05,
    required: Sequence[str] = (),
) -> dict[str, Timing]:
    """Time the cases in turn, `repeats` times over, each time in a new process on the same core.

    A case that differs from the reference by more than `TOLERANCE` is not timed (NaN).

    Args:
        cases: with different labels.
        reference: results to agree with, shape (n_states, n).
        repeats: timings of each case.
        seconds: length of one timing [s].
        required: labels of the cases that must agree.

    Raises:
        BenchmarkError: a required case differs, or a driver fails.
    """
    with tempfile.TemporaryDirectory() as name, pinned():
        folder = Path(name)
        differences = {case.label: check(case, reference, folder) for case in cases}
        for label in required:
            if differences[label] > TOLERANCE:
                raise BenchmarkError(f"{label}: differs by {differences[label]:.1e}")
        sound = [case for case in cases if differences[case.label] <= TOLERANCE]
        times: dict[str, list[float]] = {case.label: [] for case in cases}
        for _ in range(repeats):
            for case in sound:
                times[case.label].append(1e-3 * float(_drive(case, folder, seconds)))
    nothing = [float("nan")]
    return {
        label: Timing(statistics.median(t or nothing), min(t or nothing), differences[label])
        for label, t in times.items()
    }


def _drive(case: Case, folder: Path, seconds: float) -> str:
    case.states.tofile(folder / "states.bin")
    ends = (folder / "states.bin", len(case.states), folder / "results.bin", seconds)
    return run([*case.command, *map(str, ends)])


@contextmanager
def pinned() -> Iterator[None]:
    """Keep this process and the drivers it starts on one core, the last it may use."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def c_compiler() -> str:
    """Name of the C compiler.

    Raises:
        BenchmarkError: there is none.
    """
    for name in ("gcc", "cc", "clang"):
        if shutil.which(name):
            return name
    raise BenchmarkError("no C compiler: install gcc and g++")


def machine() -> dict[str, Any]:
    """The machine in general terms, the versions at work, and how busy it was."""
    compiler = c_compiler()
    packages = {}
    for package in _PACKAGES:
        try:
            packages[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return {
        "processor": _processor(),
        "system": f"{platform.system()}, {' '.join(platform.libc_ver())}".strip(", "),
        "compiler": f"{compiler} {run([compiler, '-dumpfullversion', '-dumpversion']).strip()}",
        "python": platform.python_version(),
        "packages": packages,
        "load_before": round(os.getloadavg()[0], 2),
    }


def _processor_flags() -> set[str]:
    try:
        return set(Path("/proc/cpuinfo").read_text(encoding="utf-8").split())
    except OSError:
        return set()


def has_feature(name: str) -> bool:
    """Whether the processor has a feature, such as AVX2."""
    return any(_FEATURES.get(word) == name for word in _processor_flags())


def _processor() -> str:
    """For instance `2-core x86-64 virtual machine with AVX-512`."""
    words = _processor_flags()
    kind = "virtual machine" if "hypervisor" in words else "machine"
    features = [name for flag, name in _FEATURES.items() if flag in words][:1]
    text = f"{os.cpu_count()}-core {platform.machine().replace('_', '-')} {kind}"
    return " with ".join([text, *features])


def machine_line(record: Mapping[str, Any]) -> str:
    """The record's machine and way of timing in a sentence or two."""
    m = record["machine"]
    packages = ", ".join(f"{name} {version}" for name, version in m["packages"].items())
    return (
        f"{m['processor']}, one core; {m['compiler']}; {packages}; load before: "
        f"{m['load_before']}. Microseconds per call, median and minimum of {record['repeats']} "
        f"interleaved timings, {N_STATES} random states in turn."
    )


def parser(document: str, name: str, sizes: Sequence[int]) -> argparse.ArgumentParser:
    """The options all benchmarks share; the results go to `name` unless --json says otherwise."""
    result = argparse.ArgumentParser(description=document.splitlines()[0])
    result.add_argument("--json", type=Path, default=RESULTS / name, help="results; .md beside it")
    result.add_argument("--sizes", type=int, nargs="+", default=sizes, help="numbers of discs")
    result.add_argument("--repeats", type=int, default=9, help="timings of each case")
    result.add_argument("--seconds", type=float, default=0.05, help="length of one timing")
    return result


def main(
    options: argparse.Namespace,
    measure_all: Callable[[argparse.Namespace, Path], dict[str, Any]],
    markdown: Callable[[Mapping[str, Any]], str],
) -> int:
    """Measure in a temporary folder and write the results; 1 with a line on stderr if it fails."""
    try:
        with tempfile.TemporaryDirectory() as name:
            described = {"machine": machine(), "repeats": options.repeats}
            record = {**described, **measure_all(options, Path(name))}
        page = markdown(record)
        write_results(options.json, record, page)
    except BenchmarkError as error:
        print(error, file=sys.stderr)
        return 1
    print(page)
    return 0


def write_results(path: Path, record: Mapping[str, Any], page: str) -> None:
    """Write `path` (JSON) and its twin ending in .md, each complete or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(_without_nan({"schema": SCHEMA, **record}), indent=1, allow_nan=False)
    _write(path, text + "\n")
    _write(path.with_suffix(".md"), page)


def _without_nan(value: object) -> object:
    """The value with null for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write(path: Path, text: str) -> None:
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def records(rows: Sequence[Mapping[str, Any]], without: Sequence[str] = ()) -> str:
    """Records with equal keys as a Markdown table; see `table`."""
    keys = [key for key in rows[0] if key not in without]
    return table(keys, [[row[key] for key in keys] for row in rows])


def pairs(values: Mapping[str, Any]) -> str:
    """A record in one line."""
    return ", ".join(f"{key} {_cell(value)}" for key, value in values.items()) or "not measured"


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table; numbers with three significant digits, NaN and None as a dash."""
    lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    return "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines) + "\n"


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"
    return str(value)
