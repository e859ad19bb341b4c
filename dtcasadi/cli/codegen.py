"""`dtcasadi codegen SCENE -o FOLDER`: the scene's functions as C, or as text."""

import argparse
from typing import TYPE_CHECKING

from .common import Report

if TYPE_CHECKING:
    from ..codegen import Exported


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("scene", metavar="SCENE", help="a TOML file, or the name of a scene")
    parser.add_argument("-o", "--output", metavar="FOLDER", required=True, help="where files go")
    parser.add_argument("--name", metavar="N", help="prefix of every symbol [the scene's name]")
    parser.add_argument("--functions", metavar="F", nargs="+", default=(), help="which to export")
    parser.add_argument("--format", metavar="NAME", default="c", help="c, text or python [c]")
    parser.add_argument("--single", action="store_true", help="single precision")
    parser.add_argument("--simd", action="store_true", help="also a batch on SIMD lanes, in C++17")
    parser.add_argument("--method", metavar="NAME", help="integration method of the step")
    parser.add_argument("--step", metavar="S", type=float, help="length of the step [s]")
    parser.add_argument("--force", action="store_true", help="overwrite files of other hands")


def run(options: argparse.Namespace, report: Report) -> int | None:
    """Write the folder, and see whether it compiles."""
    from ..codegen import export_c
    from ..scene import load_scene

    exported = export_c(
        load_scene(options.scene),
        options.output,
        name=options.name,
        format=options.format,
        simd=options.simd,
        single=options.single,
        force=options.force,
        functions=tuple(options.functions),
        method=options.method,
        step_s=options.step,
    )
    _describe(exported, report)
    for path in exported.files:
        report.wrote(path)
    _try_compiler(exported, report)
    report.list_files()
    return None


def _describe(exported: "Exported", report: Report) -> None:
    print(f"\n{exported.name}")
    for function in exported.functions:
        ports = [
            ", ".join(f"{port['name']}[{_shape(port)}]" for port in function[key])
            for key in ("inputs", "outputs")
        ]
        print(f"  {function['name']}: {ports[0]} -> {ports[1]}")
    report.note(functions=exported.functions)
    report.line("{bytes} bytes in all", bytes=exported.bytes)


def _shape(port: dict) -> str:
    return str(port["rows"]) if port["columns"] == 1 else f"{port['rows']} x {port['columns']}"


def _try_compiler(exported: "Exported", report: Report) -> None:
    from ..codegen.build import trial_build
    from ..codegen.c import FLAGS
    from ..codegen.simd import OPTIONS
    from ..compiler import CXX

    report.note(compile_seconds=None, compiler=None)
    sources = [path for path in exported.files if path.suffix == ".c"]
    if not sources:
        return
    built = trial_build(sources, FLAGS)
    if built is None:
        print("  not compiled: no C compiler")
        return
    report.line(
        "compiles in {compile_seconds:.2f} s with {compiler}",
        compile_seconds=built.seconds,
        compiler=built.compiler,
    )
    if not any(path.suffix == CXX.suffix for path in exported.files):
        return
    lanes = trial_build(exported.files, OPTIONS, CXX)
    if lanes is None:
        print("  SIMD lanes not compiled: no C++ compiler")
        return
    report.line(
        "SIMD lanes compile in {lanes_compile_seconds:.2f} s with {lanes_compiler}",
        lanes_compile_seconds=lanes.seconds,
        lanes_compiler=lanes.compiler,
    )
