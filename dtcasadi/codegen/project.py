"""What surrounds the C: example, build files and README."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from . import simd
from .build import CORTEX, CORTEX_FLAGS
from .description import Export, Exposed, Motion, Settings
from .precision import ANGLE, N_STATES, RATE, Error
from .texts import comment, filled, number, wrapped

if TYPE_CHECKING:
    from .c import WorkSize

_LINES_SHOWN = 20


def texts(
    export: Export,
    settings: Settings,
    sizes: Mapping[str, "WorkSize"],
    fields: Mapping[str, object],
) -> dict[str, str]:
    """The files around the functions, by name."""
    simulates = export.motion is not None and all(map(export.get, ("step", "poses")))
    added = simd.beside(settings, fields)
    example = _simulation(export, settings, fields) if simulates else _call(export, fields)
    return {
        "main.c": example,
        "CMakeLists.txt": filled("CMakeLists.txt", **fields, beside=added["CMakeLists.txt"]),
        "Makefile": filled("Makefile", **fields, beside=added["Makefile"]),
        "README.md": _readme(
            export, settings, sizes, {**fields, "beside": added["README.md"]}, simulates
        ),
    }


def _simulation(export: Export, settings: Settings, fields: Mapping[str, object]) -> str:
    """The example that moves the robot."""
    motion = export.motion
    assert motion is not None and motion.step_s is not None and export.theta0 is not None
    name = export.name
    steps = max(1, round(motion.t_end / motion.step_s))
    breaks, values, slopes = _command(motion)
    recentre = export.get("recentre") is not None
    moved = [
        f'    if (failed("recentre", t, {name}_recentre(&work, sizeof work, x, theta, next,',
        "                                              theta_next, &recentred, NULL, NULL)))",
        "      return 1;",
        "    memcpy(x, next, sizeof x);",
        "    memcpy(theta, theta_next, sizeof theta);",
    ]
    n_theta = max(1, len(export.theta0))
    return filled(
        "main.c",
        **fields,
        steps=steps,
        shown=max(1, steps // _LINES_SHOWN),
        breaks=len(breaks),
        commands=values.shape[1],
        initial=wrapped(number(value, single=settings.single) for value in motion.x0),
        break_s=wrapped(map(number, breaks)),
        value=_rows(values),
        slope=_rows(slopes),
        centre=", ".join(number(value, single=settings.single) for value in motion.centre),
        n_theta=n_theta,
        declare=f"  {name}_real theta_next[{n_theta}], recentred;" if recentre else "",
        recentre="\n".join(moved) if recentre else "",
    )


def _command(motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Breaks, values and slopes of the command; with a column of zeros where there is none."""
    pieces = motion.command.pieces(0.0, motion.t_end)
    breaks = np.array([piece.t_start for piece in pieces])
    parts = [np.array([getattr(piece, key) for piece in pieces]) for key in ("start", "slope")]
    values, slopes = (part if part.shape[1] else np.zeros((len(pieces), 1)) for part in parts)
    return breaks, values, slopes


def _rows(values: np.ndarray) -> str:
    return ",\n".join(f"    {{{', '.join(map(number, row))}}}" for row in values)


def _call(export: Export, fields: Mapping[str, object]) -> str:
    """The example that calls the first function once."""
    from .c import visible

    function, name = export.functions[0], export.name
    arrays, fill, show, names = [], [], [], []
    for port in function.inputs:
        known = port.name == "theta" and export.theta0 is not None
        names.append(f"{name}_theta0" if known else f"{port.name}_in")
        if not known:
            arrays.append(f"  {name}_real {port.name}_in[{max(1, port.size)}];")
            value = f"({name}_real)0.1"
            fill.append(f"  for (i = 0; i < {max(1, port.size)}; ++i) {port.name}_in[i] = {value};")
    for port in visible(function):
        names.append(f"{port.name}_out")
        arrays.append(f"  {name}_real {port.name}_out[{max(1, port.size)}];")
        show.append(f'  show("{port.name}", {port.name}_out, {port.size});')
    return filled(
        "call.c",
        **fields,
        arrays="\n".join(arrays),
        fill="\n".join(fill) or "  i = 0;\n  (void)i;",
        arguments="".join(f", {each}" for each in names),
        show="\n".join(show),
    )


def _readme(
    export: Export,
    settings: Settings,
    sizes: Mapping[str, "WorkSize"],
    fields: Mapping[str, object],
    simulates: bool,
) -> str:
    facts = "".join(f"- {comment(fact)}\n" for fact in export.facts)
    blocks = [
        f"`theta` holds the free parameters; `{export.name}_theta0` are the robot's own.",
        *(
            f"- `{comment(block)}`: entries {place.start} to {place.stop - 1}"
            for block, place in export.theta_blocks.items()
        ),
    ]
    name, first = export.name, export.functions[0].name
    load = f"import casadi; print(casadi.external('{name}_raw_{first}', './lib{name}.so'))"
    return filled(
        "README.md",
        **{**fields, "graph": export.graph},
        load="" if settings.single else f'    make shared && python -c "{load}"\n',
        casadi=ca.CasadiMeta.version(),
        facts=f"{facts}\n" if facts else "",
        example="simulates the robot and prints its tip" if simulates else "one call",
        functions="\n".join(_row(each, sizes[each.name], settings) for each in export.functions),
        blocks="\n".join(["", *blocks, ""]) if export.theta_blocks else "",
    )


def single_section(
    errors: Mapping[str, Error] | str, sizes: Mapping[str, Mapping[str, int]] | str
) -> str:
    """What the README says about single precision."""
    lines = ["\n## Single precision\n"]
    if isinstance(errors, str):
        lines.append(f"Error against double precision: {errors}.")
    else:
        lines += [
            f"Error against double precision over {N_STATES} random states (angles within "
            f"{ANGLE:g} rad, rates within {RATE:g} rad/s, pressures within the example's), "
            "relative to the largest entry of each result; failed: calls that did not converge.\n",
            "| function | median | largest | failed |\n|---|---:|---:|---:|",
            *(
                f"| `{name}` | {each.median:.1e} | {each.largest:.1e} | {each.failed} |"
                for name, each in errors.items()
            ),
        ]
    lines.append("\n## On a Cortex-M7\n")
    if isinstance(sizes, str):
        lines.append(f"Size: {sizes}.")
    else:
        lines += [
            f"Bytes with `{CORTEX} {' '.join(CORTEX_FLAGS)}`:\n",
            "| file | code and constants | data | bss |\n|---|---:|---:|---:|",
            *(
                f"| `{name}` | {each['text']} | {each['data']} | {each['bss']} |"
                for name, each in sizes.items()
            ),
        ]
    return "\n".join([*lines, ""])


def _row(function: Exposed, size: "WorkSize", settings: Settings) -> str:
    from .c import visible

    def listed(ports) -> str:  # noqa: ANN001
        shapes = (
            f"{port.name} ({port.rows}{f' x {port.columns}' if port.columns != 1 else ''})"
            for port in ports
        )
        return ", ".join(shapes)

    real, integer = (4, 4) if settings.single else (8, 8)
    arrays = [max(1, n) for n in size]
    total = 8 * (arrays[0] + arrays[1]) + integer * arrays[2] + real * arrays[3]
    return (
        f"| `{function.name}` | {listed(function.inputs)} | {listed(visible(function))} | {total} |"
    )
