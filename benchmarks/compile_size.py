"""Operation counts, C size and compile time of the two assemblers; the Jacobian at 16 discs.

python benchmarks/compile_size.py [--json F] [--sizes 2 4 8 16 32 64] [--repeats 9]
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

ASSEMBLIES = ("flat", "graph")
LEVELS = ("-O1", "-O2", "-O3")
JACOBIAN_DISCS = 16
JACOBIAN_BYTES, JACOBIAN_CALLS = 400_000, 20.0
WAIT_S = 5.0  # a compile time one waits for without thinking


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
) -> dict[str, Any]:
    """Size of a Function, and its compile and call times at each optimization level.

    `plain` is the same without the C kernels that the virtual machine cannot run.
    """
    plain = plain or function
    inputs = random_inputs(function, function.n_in() - 1)
    reference = drivers.evaluated(plain, inputs, theta)
    cases, built = [], {}
    for level in LEVELS:
        flags = f"{level} -march=native"
        case, built[level] = drivers.our_case(level, function, inputs, theta, flags, folder)
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
        for assembly in ASSEMBLIES:
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
        "jacobian": jacobian(folder / "jacobian", options),
    }


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
        ]
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark; 0, or 1 with one line on stderr."""
    parser = harness.parser(__doc__ or "", "compile_size.json", [2, 4, 8, 16, 32, 64])
    return harness.main(parser.parse_args(argv), measure_all, markdown)


if __name__ == "__main__":
    sys.exit(main())
