"""The header for people: sizes, names of states and commands, work spaces, prototypes."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from .description import Export, Exposed, Port, Settings
from .names import different, macro
from .texts import comment, filled, number, wrapped

if TYPE_CHECKING:
    from .c import WorkSize


def text(
    export: Export,
    settings: Settings,
    sizes: Mapping[str, "WorkSize"],
    fields: Mapping[str, object],
) -> str:
    """The whole header."""
    general = list(_sizes(export, settings))
    blocks = {each.name: _block(export, each, sizes[each.name]) for each in export.functions}
    names = [name for each in export.functions for name in _macros(export, each, sizes[each.name])]
    different([*(key for key, _, _ in general), *names, *_enumerators(export)], "header")
    lines = [
        f"#define {key} {value}{f' /* {note} */' if note else ''}" for key, value, note in general
    ]
    return filled(
        "header.h",
        **fields,
        sizes="\n".join(lines),
        enums="\n".join(_enums(export)),
        parameters=_declared_parameters(export),
        functions="\n".join(blocks.values()),
        spaces="\n".join(f"  {export.name}_{name}_work {name}_;" for name in blocks),
    )


def prototype(export: Export, function: Exposed, outputs: Iterable[Port]) -> str:
    """The declaration of a function's wrapper, without its end."""
    name = export.name
    ports = [f"const {name}_real *{port.name}" for port in function.inputs]
    ports += [f"{name}_real *{port.name}" for port in outputs]
    listed = wrapped(["void *work", "size_t work_bytes", *ports])
    return f"{name}_status {name}_{function.name}(\n{listed})"


def parameters(export: Export, settings: Settings) -> str:
    """The definition of theta0."""
    if export.theta0 is None:
        return ""
    values = [number(value, single=settings.single) for value in export.theta0] or ["0"]
    n = len(values)
    return f"const {export.name}_real {export.name}_theta0[{n}] = {{\n{wrapped(values)}}};\n"


def _declared_parameters(export: Export) -> str:
    if export.theta0 is None:
        return ""
    n = max(1, len(export.theta0))
    about = "The robot's own parameters: pass them, or a changed copy, as theta."
    return f"/* {about} */\nextern const {export.name}_real {export.name}_theta0[{n}];\n"


def _sizes(export: Export, settings: Settings) -> Iterable[tuple[str, object, str]]:
    """Name, value and remark of each macro that does not belong to one function."""
    NAME = macro(export.name)
    model = export.model
    if model is not None:
        yield f"{NAME}_N_DISCS", model.n_discs, "the fixed root included"
        yield f"{NAME}_N_Q", model.n_q, "generalized coordinates"
        yield f"{NAME}_N_X", model.n_x, "states"
        yield f"{NAME}_N_U", model.n_u, "commands, one for each chamber"
    if export.theta0 is not None:
        yield f"{NAME}_N_THETA", len(export.theta0), "free parameters"
    for block, place in export.theta_blocks.items():
        key = f"{NAME}_THETA_{macro(block)}"
        yield key, place.start, f"block {comment(block)} of theta starts here"
        yield f"{key}_SIZE", place.stop - place.start, ""
    if export.motion is not None and export.motion.step_s is not None:
        step_s = number(export.motion.step_s, single=settings.single)
        yield f"{NAME}_STEP_S", step_s, "of the function step [s]"


def _macros(export: Export, function: Exposed, size: "WorkSize") -> dict[str, int]:
    """Sizes of a function's arguments and results, and those of CasADi's work space."""
    key = f"{macro(export.name)}_{macro(function.name)}"
    ports = {port.name: port.size for port in (*function.inputs, *function.outputs)}
    sizes = {f"{key}_SIZE_{port}": n for port, n in ports.items()}
    return sizes | {f"{key}_{field.upper()}": n for field, n in size._asdict().items()}


def _enumerators(export: Export) -> list[str]:
    return [
        f"{macro(export.name)}_{macro(port)}_{macro(label.name)}"
        for port, labels in _distinct(export).items()
        for label in labels
    ]


def _distinct(export: Export) -> dict[str, tuple]:
    """The labelled vectors, each list of labels once."""
    kept: dict[str, tuple] = {}
    for port, labels in export.labels.items():
        if labels and labels not in kept.values():
            kept[port] = labels
    return kept


def _enums(export: Export) -> Iterable[str]:
    for port, labels in _distinct(export).items():
        same = [other for other, names in export.labels.items() if names == labels]
        yield f"/* ---- Rows of {', '.join(same)}, and of what has its shape ---- */\n"
        yield "typedef enum {"
        for k, label in enumerate(labels):
            end = "," if k + 1 < len(labels) else ""
            key = f"{macro(export.name)}_{macro(port)}_{macro(label.name)}"
            yield f"  {key} = {k}{end} /* {comment(label.unit)} */"
        yield f"}} {export.name}_{port}_index;\n"


def _block(export: Export, function: Exposed, size: "WorkSize") -> str:
    """Comment, sizes, work space and prototype of a function."""
    from .c import visible

    name = export.name
    macros = (f"#define {key} {n}" for key, n in _macros(export, function, size).items())
    arg, res, iw, w = (max(1, n) for n in size)  # C has no empty arrays
    arrays = (
        f"const {name}_real *arg[{arg}];",
        f"{name}_real *res[{res}];",
        f"{name}_int iw[{iw}];",
        f"{name}_real w[{w}];",
    )
    work = ["typedef struct {", *(f"  {each}" for each in arrays)]
    lines = (
        _documented(export, function),
        *macros,
        *work,
        f"}} {name}_{function.name}_work;",
        f"{prototype(export, function, visible(function))};\n",
    )
    return "\n".join(lines)


def _documented(export: Export, function: Exposed) -> str:
    """The comment above a prototype."""
    from .c import is_status, visible

    about = [comment(function.title) or f"Function {function.name}."]
    rows = [("in", port) for port in function.inputs]
    rows += [("out", port) for port in visible(function)]
    about.append("")
    width = max(len(port.name) for _, port in rows)
    for way, port in rows:
        shape = str(port.rows) if port.columns == 1 else f"{port.rows} x {port.columns}"
        unit = f" [{comment(port.unit)}]" if port.unit else ""
        line = f"{way:3}  {port.name:{width}}  {shape:9}  {comment(port.meaning)}{unit}"
        about.append(f"  {line.rstrip()}")
    if any(is_status(port) for port in function.outputs):
        about.append(
            f"Returns {macro(export.name)}_NOT_CONVERGED where it fails by its own account."
        )
    return "/* " + "\n".join(f" * {line}".rstrip() for line in about)[3:] + " */"
