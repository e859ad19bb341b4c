"""Code generation: the graphs of a model, or any casadi Functions, as files that stand alone.

`export_c` is the front door. What is exported is an `Export` (description.py): the ordered
functions with their ports, names and units of states and commands, theta with its blocks, and what
an example may simulate. `describe.py` makes it from a model, a scene or a mapping of names to
Functions, every name checked (names.py).

A format is a writer: `write(export, settings) -> {file name: text}`. It evaluates, builds text and
returns it; it writes no file. `folder.py` puts the texts into the target folder, whole or not at
all. A new format is a module with `write` and a line in `FORMATS`; what lies beside the C of a
format, such as the SIMD batch, is a module with the same `write` and a line in `BESIDE`.
"""

from collections.abc import Mapping
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca

from ..errors import ModelError
from .c import work_sizes
from .describe import described
from .description import Export, Exposed, Settings, exposed
from .folder import Exported, write_folder

if TYPE_CHECKING:
    from ..model import Model
    from ..scene import Scene

# Name of each format -> the module that writes it.
FORMATS = {"c": "c", "text": "text", "python": "numpy_module"}
# Field of Settings -> the module whose files are added to those of format c.
BESIDE = {"simd": "simd"}


def export_c(
    functions_or_model: "Model | Scene | Mapping[str, ca.Function | Exposed] | Export",
    folder: str | PathLike[str],
    *,
    name: str | None = None,
    format: str = "c",
    simd: bool = False,
    single: bool = False,
    force: bool = False,
    functions: tuple[str, ...] = (),
    method: str | None = None,
    step_s: float | None = None,
) -> Exported:
    """Write functions as C, or as text, into a folder that stands alone.

    Args:
        functions_or_model: a model, a scene (its model, initial state and pressure), or a mapping
            of names to casadi Functions (`codegen.exposed` adds a title and C kernels to one); or
            what `codegen.described` makes of one of these, with `name` and the last three.
        folder: created where missing; nothing outside of it is written.
        name: prefix of every symbol and file; default: the scene's name.
        format: a name of `codegen.FORMATS`.
        simd: with C: also the batch of robots as C++17 on SIMD lanes.
        single: with C: single precision, with the measured error in the README.
        force: overwrite files that this package did not write, or that were changed since.
        functions: of a model or scene: which to export; default `codegen.describe.DEFAULT`.
        method: of a model or scene: integration method of `step`; default: see `described`.
        step_s: of a model or scene: its step [s]; default: see `described`.

    Returns:
        The files written and the sizes of the functions.

    Raises:
        ModelError: a name that C cannot take, an unknown format or function, or options that do
            not go together.
        OSError: the folder cannot be written, or holds foreign files.
    """
    if format not in FORMATS:
        raise ModelError(f"format: expected one of {', '.join(FORMATS)}, got {format!r}")
    if format != "c" and (simd or single):
        raise ModelError(f"format: expected c with simd or single, got {format!r}")
    export = functions_or_model
    if not isinstance(export, Export):
        export = described(
            export,
            name=name,
            functions=functions,
            method=method,
            step_s=step_s,
            single=single,
            calls=format != "c",
        )
    settings = Settings(single=single, simd=simd)
    modules = [
        FORMATS[format],
        *(module for key, module in BESIDE.items() if getattr(settings, key)),
    ]
    files: dict[str, str] = {}
    for module in modules:
        files |= import_module(f".{module}", __package__).write(export, settings)
    return write_folder(Path(folder), export, files, _functions(export, files), force=force)


def _functions(export: Export, files: Mapping[str, str]) -> tuple[Mapping[str, Any], ...]:
    """Name, inputs, outputs and work space (None but in C) of each function."""
    core = files.get(f"{export.name}_core.c")
    work = {} if core is None else work_sizes(export, core)
    return tuple(
        {
            "name": each.name,
            "inputs": [port._asdict() for port in each.inputs],
            "outputs": [port._asdict() for port in each.outputs],
            "work": work[each.name]._asdict() if work else None,
        }
        for each in export.functions
    )


__all__ = [
    "FORMATS",
    "Export",
    "Exported",
    "Exposed",
    "Settings",
    "described",
    "export_c",
    "exposed",
]
