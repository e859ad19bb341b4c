"""Beside format `c`: the same generated code on SIMD lanes, for many robots in one call.

`<name>_simd.cpp` includes `<name>_core.c` with `casadi_real` as a type that holds 8 robots
(AVX-512), 4 (AVX) or 2; `<name>_batch.h` declares the functions for C and C++.
"""

from collections.abc import Iterable, Mapping

from ..compile import CXX_FLAGS
from ..errors import ModelError
from ..lanes import native, obstacle, table
from .description import Export, Exposed, Port, Settings
from .names import different, macro
from .texts import comment, filled, maker, wrapped

OPTIONS = tuple(flag for flag in CXX_FLAGS if flag not in ("-std=c++17", "-fPIC", "-shared"))


def write(export: Export, settings: Settings) -> Mapping[str, str]:
    """The C++ source and its header.

    Raises:
        ModelError: a function that cannot run on SIMD lanes, single precision, or names that meet.
    """
    if settings.single:
        raise ModelError("simd: expected double precision, got single")
    _check(export)
    name = export.name
    fields = {
        "name": name,
        "NAME": macro(name),
        "maker": comment(maker()),
        "title": comment(export.title),
        "graph": export.graph[:16],
        "first": export.functions[0].name,
    }
    return {
        f"{name}_batch.h": filled(
            "batch.h",
            **fields,
            functions="\n".join(_declaration(export, each) for each in export.functions),
        ),
        f"{name}_simd.cpp": filled(
            "simd.cpp",
            **fields,
            lanes=native("lanes.hpp"),
            batch=native("batch.hpp"),
            functions="\n".join(_definition(export, each) for each in export.functions),
        ),
    }


def beside(settings: Settings, fields: Mapping[str, object]) -> dict[str, str]:
    """What is added to the build files and the README of format `c`, by their names."""
    if not settings.simd:
        return dict.fromkeys(("Makefile", "CMakeLists.txt", "README.md"), "")
    flags = {"simd_flags": " ".join(("-std=c++17", *OPTIONS)), "simd_options": " ".join(OPTIONS)}
    name = fields["name"]
    return {
        "Makefile": filled("simd.mk", **fields, **flags),
        "CMakeLists.txt": filled("simd.cmake", **fields, **flags),
        "README.md": f"| `{name}_batch.h`, `{name}_simd.cpp` | the same for many robots in one "
        "call, on SIMD lanes (C++17; `make simd`) |\n",
    }


def _check(export: Export) -> None:
    for each in export.functions:
        why = obstacle(each.source)
        if why:
            expected = "functions whose code can run on SIMD lanes; leave it out"
            raise ModelError(f"simd: {each.name}: expected {expected}, got one where {why}")
        for port in (*each.inputs, *each.outputs):
            if port.name == "n" or port.name.startswith("ld_"):
                expected = "port names other than n and ld_*"
                raise ModelError(f"simd: {each.name}: expected {expected}, got {port.name!r}")
    ends = ("", "_work", "_batch", "_batch_bytes")
    different((f"{each.name}{end}" for each in export.functions for end in ends), "simd")


def _prototype(export: Export, function: Exposed) -> str:
    ports = ["void *work", "size_t work_bytes", "size_t n"]
    for port in function.inputs:
        ports += [f"const double *{port.name}", f"size_t ld_{port.name}"]
    for port in function.outputs:
        ports += [f"double *{port.name}", f"size_t ld_{port.name}"]
    name = export.name
    return f"{name}_status {name}_{function.name}_batch(\n{wrapped(ports)})"


def _declaration(export: Export, function: Exposed) -> str:
    about = comment(function.title) or f"Function {function.name}."
    ports = "; ".join(f"{port.name}: {port.size}" for port in (*function.inputs, *function.outputs))
    bytes_ = f"size_t {export.name}_{function.name}_batch_bytes(void);"
    return "\n".join(
        (f"/* {about}", f" * Entries: {ports} */", f"{_prototype(export, function)};", bytes_, "")
    )


def _definition(export: Export, function: Exposed) -> str:
    from .c import raw

    name, symbol = f"{export.name}_{function.name}", raw(export, function)

    def listed(ports: Iterable[Port], start: str) -> str:
        return ", ".join(start + port.name for port in ports) or "0"

    ins, outs = function.inputs, function.outputs
    return f"""{table(symbol, function.source)}
extern "C" size_t {name}_batch_bytes(void) {{ return {symbol}_function().bytes(); }}
extern "C" {_prototype(export, function)} {{
  const double *const in_[] = {{{listed(ins, "")}}};
  double *const out_[] = {{{listed(outs, "")}}};
  const size_t ld_in_[] = {{{listed(ins, "ld_")}}}, ld_out_[] = {{{listed(outs, "ld_")}}};
  return ({export.name}_status)dtc_batch({symbol}_function(), n, in_, ld_in_, out_, ld_out_, work,
                                         work_bytes);
}}
"""
