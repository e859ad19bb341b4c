"""`dtcasadi doctor`: what this installation has, what is missing, and what to do about it."""

import argparse
import math
import os
import platform
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..versions import version_of
from .common import Report

if TYPE_CHECKING:
    from ..compiler import Compiler, Target

PACKAGES = ("dtcasadi", "casadi", "numpy", "scipy", "matplotlib", "tqdm")
# What the solvers of later chapters are built on; each is a question to the casadi module.
PLUGINS = {
    "conic": ("daqp", "fatrop", "hpipm", "osqp", "piqp", "proxqp", "qpoases", "qrqp"),
    "nlpsol": ("fatrop", "ipopt", "sqpmethod"),
    "integrator": ("cvodes", "idas"),
}

_PATIENCE_S = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command: none of its own."""


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Look at everything once; nothing missing is an error."""
    advice: list[str] = []
    _versions(report)
    _compiler(report, advice)
    _lanes(report, advice)
    _cache(report, advice)
    _programs(report, advice)
    _plugins(report, advice)
    report.section("advice", "what to do")
    report.note(advice=advice)
    for text in advice or ["nothing: everything is there"]:
        print(f"  {text}")
    return None


def _versions(report: Report) -> None:
    report.section("versions", "versions")
    report.line(
        "python {python} ({executable})",
        python=platform.python_version(),
        executable=sys.executable,
    )
    for package in PACKAGES:
        report.line(f"{package} {{{package}}}", **{package: version_of(package) or "not installed"})
    report.line("{system}, {machine}", system=platform.system(), machine=platform.machine())


def _compiler(report: Report, advice: list[str]) -> None:
    from ..compiler import DEFAULT_FLAGS, find_compiler, target_of
    from ..errors import CompileError

    report.section("compiler", "C compiler")
    report.note(path=None, version=None, flags=None, seconds=None)
    try:
        compiler = find_compiler()
        if compiler is None:
            report.line("none")
            off = os.environ.get("DTCASADI_CC", "").strip()
            advice.append(
                "DTCASADI_CC=none switches compilation off: unset it to run compiled"
                if off
                else "install gcc or clang: without it everything runs in CasADi's virtual machine"
            )
            return
        report.line("{path}: {version}", path=" ".join(compiler.command), version=compiler.version)
        target = target_of(compiler, DEFAULT_FLAGS)
        report.line("flags it takes: {flags}", flags=" ".join(target.flags))
        report.line(
            "compiles, loads and runs a function: {seconds:.2f} s",
            seconds=_compile_once(compiler, target),
        )
    except CompileError as error:
        report.line("does not work: {problem}", problem=str(error).splitlines()[0])
        advice.append("make the compiler work, or name another in DTCASADI_CC")


def _lanes(report: Report, advice: list[str]) -> None:
    """Whether `dtcasadi.batch` computes several robots at a time."""
    import casadi as ca

    from ..batch import batch
    from ..compiler import CXX, find_compiler
    from ..errors import CompileError

    report.section("lanes", "many robots in one call (dtcasadi.batch)")
    report.note(path=None, version=None, robots=1, why=None)
    x = ca.SX.sym("x")
    try:
        compiler = find_compiler(CXX)
        if compiler is not None:
            line = "C++ compiler {path}: {version}"
            report.line(line, path=" ".join(compiler.command), version=compiler.version)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            many = batch(ca.Function("doctor", [x], [ca.sin(x)]))
    except CompileError as error:
        report.line("does not work: {problem}", problem=str(error).splitlines()[0])
        return
    if many.why:
        report.line("one after the other: {why}", why=many.why.splitlines()[0])
        if many.why.startswith("no C++ compiler"):
            advice.append("install g++ or clang++: dtcasadi.batch then runs on SIMD lanes")
    else:
        report.line("{robots} at a time", robots=many.lanes)


def _compile_once(compiler: "Compiler", target: "Target") -> float:
    """Seconds to compile, load and run a function, away from the cache."""
    import casadi as ca

    from ..compile import c_source
    from ..compiler import LIBRARY_SUFFIX, build_library
    from ..errors import CompileError

    start = time.perf_counter()
    x = ca.SX.sym("x")
    source = c_source([ca.Function("doctor", [x], [ca.sin(x)])])
    with tempfile.TemporaryDirectory(prefix="dtcasadi-") as folder:
        library = Path(folder) / f"doctor{LIBRARY_SUFFIX}"
        build_library(compiler, target, source, library, _PATIENCE_S)
        try:
            value = ca.external("dtc_doctor", str(library))(1.0)
        except RuntimeError as error:
            raise CompileError(f"a compiled function does not load: {error}") from error
    if abs(float(value) - math.sin(1.0)) > 1e-15:
        raise CompileError(f"a compiled function gave {float(value)!r} for sin(1)")
    return time.perf_counter() - start


def _cache(report: Report, advice: list[str]) -> None:
    from ..cache import MAX_ENTRIES, cache_folder
    from ..compiler import LIBRARY_SUFFIX

    report.section("cache", "cache of compiled functions")
    place = cache_folder()
    libraries = list(place.path.glob(f"*{LIBRARY_SUFFIX}"))
    size = sum(file.stat().st_size for file in libraries) / 1e6
    report.line(
        "{folder}: {entries} of at most {max_entries} libraries, {size_MB:.1f} MB",
        folder=str(place.path),
        entries=len(libraries),
        max_entries=MAX_ENTRIES,
        size_MB=size,
    )
    report.note(problem=place.problem or None)
    if place.problem:
        report.line("not kept between runs: {problem}", problem=place.problem)
        advice.append("make the cache folder usable, or name another in DTCASADI_CACHE")


def _programs(report: Report, advice: list[str]) -> None:
    report.section("programs", "programs")
    ffmpeg = shutil.which("ffmpeg")
    report.line("ffmpeg: {ffmpeg}", ffmpeg=ffmpeg or "not on PATH")
    if not ffmpeg:
        advice.append("install ffmpeg to write .mp4 animations (.gif needs nothing)")


def _plugins(report: Report, advice: list[str]) -> None:
    import casadi as ca

    report.section("plugins", "solvers that CasADi can load")
    missing = []
    for kind, names in PLUGINS.items():
        found: Callable[[str], bool] = getattr(ca, f"has_{kind}")
        loaded = [name for name in names if found(name)]
        missing += [name for name in names if name not in loaded]
        report.line(f"{kind}: {{{kind}}}", **{kind: ", ".join(loaded) or "none"})
    report.note(missing=sorted(set(missing)))
    if missing:
        absent = ", ".join(sorted(set(missing)))
        advice.append(f"a newer casadi brings {absent}; only optimal control would use them")
