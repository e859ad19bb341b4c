"""Operation counts, C size and compile time of the two assemblers, of the Jacobian, of an export.

python benchmarks/compile_size.py [--json F] [--sizes 4 8 16 32 64 128] [--repeats 9]
"""

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import chains
import drivers
import harness
import numpy as np
from harness import N_STATES

import dtcasadi as dtc
from dtcasadi import style
from dtcasadi.codegen import Export, Settings, c, described
from dtcasadi.presets import seed_four_disc

ASSEMBLIES = ("flat", "graph")
LEVELS = ("-O1", "-O2", "-O3")
JACOBIAN_DISCS = 16
JACOBIAN_BYTES, JACOBIAN_CALLS = 400_000, 20.0
WAIT_S = 5.0  # a compile time one waits for without thinking
FLAT_MOST = 32  # discs; one flat graph of more takes the compiler half a minute and is not used
# What the figures are held against: a long chain at -O2, an export of four discs as it is shipped.
LONG, LONG_BYTES, LONG_S = 128, 400_000, 3.0
EXPORTED = ("forward_dynamics", "ode", "forward_dynamics_jacobian", "ode_jacobian")
EXPORT_S = 8.0
NEAR = 1.05  # a level whose calls take this much of the quickest level's is as good


def operations(function: ca.Function) -> int:
    """Instructions of one call, those of the Functions it calls counted at every call."""
    if function.is_a("SXFunction"):
        return int(function.n_instructions())
    total, known = 0, dict[int, int]()
    for k in range(function.n_instructions()):
        if function.instruction_id(k) != ca.OP_CALL:
            total += 1
            continue
        called = function.instruction_MX(k).which_function()
        key = called.__hash__()
        if key not in known:
            known[key] = operations(called)
        total += known[key]
    return total


def random_inputs(function: ca.Function, free: int) -> list[np.ndarray]:
    """Values within 0.5 for the first `free` inputs, one state to a row."""
    rng = np.random.default_rng(1)
    return [rng.uniform(-0.5, 0.5, (N_STATES, function.nnz_in(i))) for i in range(free)]


def profile(
    function: ca.Function,
    theta: np.ndarray,
    folder: Path,
    options: argparse.Namespace,
    plain: ca.Function | None = None,
    machine: str = " -march=native",
) -> dict[str, Any]:
    """Size of a Function, and its compile and call times at each optimization level.

    `plain` is the same without the C kernels that the virtual machine cannot run.
    """
    plain = plain or function
    inputs = random_inputs(function, function.n_in() - 1)
    reference = drivers.evaluated(plain, inputs, theta)
    cases, built = [], {}
    for level in LEVELS:
        words = f"{level}{machine}"
        case, built[level] = drivers.our_case(level, function, inputs, theta, words, folder)
        cases.append(case)
    times = {"repeats": options.repeats, "seconds": options.seconds}
    timings = harness.measure(cases, reference, required=LEVELS, **times)
    return {
        "operations": operations(plain),
        "c_bytes": built["-O1"].c_bytes,
        **{f"compile_s {level}": b.seconds for level, b in built.items()},
        **{f"call_us {level}": timings[level].median_us for level in LEVELS},
    }


def measure_all(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Both assemblers at every size, then the Jacobian."""
    rows = []
    for n in sorted(options.sizes):
        for assembly in ASSEMBLIES if n <= FLAT_MOST else ASSEMBLIES[1:]:
            start = time.perf_counter()
            model = dtc.build(chains.unit_hoops(n), chart="cardan", assembly=assembly)
            dynamics = model.forward_dynamics
            build = time.perf_counter() - start
            theta = np.asarray(model.theta0, float)
            sizes = profile(dynamics, theta, folder / f"{assembly}_{n}", options)
            rows.append({"n_discs": n, "assembly": assembly, "build_s": build, **sizes})
            print(harness.records(rows[-1:]), flush=True)
    return {
        "dynamics": rows,
        "switch": switch(rows),
        "long": long_chain(rows),
        "jacobian": jacobian(folder / "jacobian", options),
        "export": (exports := export(folder / "export", options)),
        "flags": flags(rows, exports),
    }


def long_chain(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Dynamics of the longest chain against its targets; empty if it was not measured."""
    for row in rows:
        if (row["n_discs"], row["assembly"]) == (LONG, "graph"):
            sizes = {key: row[key] for key in ("n_discs", "c_bytes", "compile_s -O2")}
            met = row["c_bytes"] <= LONG_BYTES and row["compile_s -O2"] <= LONG_S
            targets = {"target_c_bytes": LONG_BYTES, "target_compile_s": LONG_S}
            return {**sizes, **targets, "met": met}
    return {}


def export(folder: Path, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Exports of the seed robot in space: one compiler call for all functions, calls of two."""
    folder.mkdir(parents=True)
    model = dtc.build(seed_four_disc(), chart="cardan")
    sets = {"dynamics, Jacobians": EXPORTED, "default": ()}
    rows = []
    for name, functions in sets.items():
        chosen = described(model, name="robot", functions=functions)
        row: dict[str, Any] = {"functions": name, "c_bytes": len(c.core_body(chosen, Settings()))}
        for level in LEVELS:
            row[f"compile_s {level}"] = compile_seconds(chosen, level, folder)
        rows.append(row)
    theta = np.asarray(model.theta0, float)
    for key in ("ode", "ode_jacobian"):
        sizes = profile(model.native(key), theta, folder / key, options, model.function(key), "")
        rows[0] |= {f"{key}_us {level}": sizes[f"call_us {level}"] for level in LEVELS}
    rows[0] |= {"target_compile_s": EXPORT_S}
    rows[0] |= {"met": rows[0][f"compile_s {c.FLAGS[0]}"] <= EXPORT_S}
    return rows


def compile_seconds(exported: Export, level: str, folder: Path) -> float:
    """Seconds for the core of an export with the flags of its Makefile at another level."""
    source = folder / "core.c"
    source.write_text(c.core_body(exported, Settings()), encoding="utf-8")
    command = [harness.c_compiler(), "-std=c99", level, *c.FLAGS[1:], "-c", "-o", "core.o"]
    start = time.perf_counter()
    harness.run([*command[:-1], str(folder / "core.o"), str(source)], drivers.TIMEOUT_S)
    return time.perf_counter() - start


def flags(rows: Sequence[Mapping[str, Any]], exports: Sequence[Mapping[str, Any]]) -> dict:
    """Compile and call times of each level as shares of the quickest, and the level to choose.

    Geometric means over the rows of call graphs and the exported functions. Of the levels whose
    calls are within NEAR of the quickest, the one that compiles in the least time.
    """
    graphs = [row for row in rows if row["assembly"] == "graph"]
    compile_times, call_times = {}, {}
    for level in LEVELS:
        waits = [row[f"compile_s {level}"] for row in (*graphs, *exports)]
        calls = [row[f"call_us {level}"] for row in graphs]
        calls += [exports[0][f"{key}_us {level}"] for key in ("ode", "ode_jacobian")]
        compile_times[level] = float(np.exp(np.mean(np.log(waits))))
        call_times[level] = float(np.exp(np.mean(np.log(calls))))
    best, least = min(call_times.values()), min(compile_times.values())
    near = [level for level in LEVELS if call_times[level] <= NEAR * best]
    return {
        **{f"compile {level}": compile_times[level] / least for level in LEVELS},
        **{f"call {level}": call_times[level] / best for level in LEVELS},
        "to choose": min(near, key=compile_times.__getitem__),
        "in use": c.FLAGS[0],
    }


def _tick(value: float, _: object) -> str:
    """1, 2, 5, 10, 20 ... as they are; nothing at the marks between."""
    return f"{value:g}" if f"{value:.0e}"[0] in "125" else ""


@style.styled
def chart(record: Mapping[str, Any], path: Path) -> None:
    """Compile time against call time, one line for each chain, a mark for each level."""
    figure = style.new_figure(style.WIDTH_IN, 4.5)
    axes = figure.add_subplot()
    rows = [row for row in record["dynamics"] if row["assembly"] == "graph"]
    for row, colour in zip(rows, style.LINES, strict=False):
        points = [[row[f"{key} {level}"] for level in LEVELS] for key in ("compile_s", "call_us")]
        axes.plot(*points, color=colour, label=f"{row['n_discs']} discs")
        for x, y, marker in zip(*points, "osD", strict=True):
            axes.plot(x, y, marker, color=colour)
    for level, marker in zip(LEVELS, "osD", strict=True):
        axes.plot([], [], marker, color=style.GREY, label=level)
    axes.set(xscale="log", yscale="log", xlabel="compile time [s]", ylabel="time per call [us]")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(_tick)
        axis.set_minor_formatter(_tick)
    axes.set_title("Forward dynamics of the bare chain, call graph")
    axes.legend(loc="upper left", ncols=2)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    style.finished(figure, path)


def switch(rows: Sequence[Mapping[str, Any]]) -> dict[str, int | None]:
    """First size at which the call graph is no slower, and at which flat compiles too long."""
    flat = {row["n_discs"]: row for row in rows if row["assembly"] == "flat"}
    graph = {row["n_discs"]: row for row in rows if row["assembly"] == "graph"}
    call, wait = "call_us -O3", "compile_s -O3"
    quick = (n for n in flat if graph[n][call] <= flat[n][call])
    slow = (n for n in flat if flat[n][wait] > WAIT_S)
    return {
        "graph_no_slower_from": next(quick, None),
        f"flat_compiles_over_{WAIT_S:g}_s_from": next(slow, None),
    }


def jacobian(folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Size of `ode_jacobian`, and its time in calls of the dynamics."""
    model = dtc.build(chains.unit_hoops(JACOBIAN_DISCS), chart="cardan")
    theta = np.asarray(model.theta0, float)
    sizes = profile(
        model.native("ode_jacobian"), theta, folder / "jacobian", options, model.ode_jacobian
    )
    dynamics = profile(model.forward_dynamics, theta, folder / "dynamics", options)
    calls = sizes["call_us -O3"] / dynamics["call_us -O3"]
    return {
        "n_discs": JACOBIAN_DISCS,
        **sizes,
        "dynamics_calls": calls,
        "target_c_bytes": JACOBIAN_BYTES,
        "target_dynamics_calls": JACOBIAN_CALLS,
        "met": sizes["c_bytes"] <= JACOBIAN_BYTES and calls <= JACOBIAN_CALLS,
    }


def markdown(record: Mapping[str, Any]) -> str:
    """The record as a page."""
    return "\n".join(
        [
            "# Generated code\n",
            f"{harness.machine_line(record)} Forward dynamics of the bare chain of unit hoops, "
            "chart `cardan`, frames as parameters; operations: instructions of one call; all "
            "with -march=native. Written by `python benchmarks/compile_size.py`.\n",
            harness.records(record["dynamics"]),
            f"Where the default assembler may switch: {harness.pairs(record['switch'])}.\n",
            "`ode_jacobian` (xdot, F_x, F_u):\n",
            harness.table(["", "value"], list(record["jacobian"].items())),
            f"The longest chain: {harness.pairs(record['long'])}.\n",
            "Exports of the seed robot in space, all functions in one call of the compiler, with "
            f"the flags of their Makefile (`{' '.join(c.FLAGS)}`) at each level:\n",
            *(harness.records([row]) for row in record["export"]),
            "Levels, as shares of the quickest (geometric means over call graphs and exports): "
            f"{harness.pairs(record['flags'])}.\n",
            "![Compile time against time per call](compile_size.png)\n",
        ]
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark; 0, or 1 with one line on stderr."""
    parser = harness.parser(__doc__ or "", "compile_size.json", [4, 8, 16, 32, 64, 128])
    options = parser.parse_args(argv)

    def page(record: Mapping[str, Any]) -> str:
        chart(record, options.json.with_suffix(".png"))
        return markdown(record)

    return harness.main(options, measure_all, page)


if __name__ == "__main__":
    sys.exit(main())
