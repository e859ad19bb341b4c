"""Condensing against the Riccati recursion: which solves a controller's linear step faster.

The same problem without active limits, 31 states, one tracked output for each command, weights of
one: condensed and solved by the dense active-set kernel, whose further iterations on a change of
the active set cost little, or solved stage by stage by the recursion, which has to be run again for
each. Chains are random and stable; both must give the same commands.
"""

import argparse
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import harness
import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.compile import compile_functions
from dtcasadi.condensing import Quadratic, condensed, response, riccati
from dtcasadi.quadratic import NONE, Rows, solved

N_X = 31
COMMANDS = (1, 2, 4)
HORIZONS = (10, 20, 40, 60)


def both(n_u: int, N: int) -> tuple[ca.Function, ca.Function]:
    """Functions A, B, D (outputs), x0 -> commands: condensed, and by the recursion."""
    shapes = {"a": (N_X, N_X * N), "b": (N_X, n_u * N), "d": (n_u, N_X * N), "x0": (N_X, 1)}
    A, B, D, x0 = ports = [ca.MX.sym(name, *shape) for name, shape in shapes.items()]
    n_v = n_u * N
    weight, P = ca.MX.ones(n_u, N), ca.MX.zeros(N_X + n_u, N_X + n_u)
    whole = condensed(A, B, D, ca.MX(0, N_X * N), weight, P, range(N), native=True)
    zero = ca.MX.zeros(n_u, N)
    free = response(A, B, ca.MX.zeros(N_X, N), x0, zero, native=True)
    y = [ca.mtimes(D[:, N_X * k : N_X * (k + 1)], free[:, k + 1]) for k in range(N)]
    gradient = ca.mtimes(whole.J, ca.vertcat(*y))
    none = ca.MX.zeros(n_v) + NONE
    rows = Rows(ca.MX(n_v, 0), *[ca.MX(0, 1)] * 4)
    warm = ca.MX.zeros(n_v)
    dense = solved(
        whole.H + ca.MX.eye(n_v), gradient, -none, none, rows, warm, iterations=9, native=True
    )
    Q = [ca.MX.zeros(N_X, N_X)]
    for k in range(N):
        row = D[:, N_X * k : N_X * (k + 1)]
        Q.append(ca.mtimes(row.T, row))
    one = ca.MX(ca.DM(np.tile(np.eye(n_u), N)))
    flat = ca.MX.zeros(N_X, N + 1)
    cost = Quadratic(ca.horzcat(*Q), ca.MX.zeros(n_u, N_X * N), one, flat, zero)
    found = riccati(A, B, ca.MX.zeros(N_X, N), cost, x0, native=True)
    label = f"{n_u}_{N}"
    return (
        ca.Function(f"condensing_{label}", ports, [dense.z], [*shapes], ["u"]),
        ca.Function(f"recursion_{label}", ports, [ca.vec(found.u)], [*shapes], ["u"]),
    )


def measured(n_u: int, N: int, repeats: int) -> dict[str, Any]:
    """Median times of the two [us]."""
    rng = np.random.default_rng(1)
    A = 0.95 * np.linalg.qr(rng.normal(size=(N, N_X, N_X)))[0]
    B, D = rng.normal(size=(N, N_X, n_u)), rng.normal(size=(N, n_u, N_X))
    given = (*(np.hstack(list(part)) for part in (A, B, D)), rng.normal(size=N_X))
    row: dict[str, Any] = {"commands": n_u, "horizon": N}
    values = []
    for name, function in zip(("condensing", "recursion"), both(n_u, N), strict=True):
        call = Bound(compile_functions([function])[function.name()])
        values.append(call(*given))
        times = []
        for _ in range(repeats * 20):
            start = time.perf_counter()
            call.run()
            times.append(time.perf_counter() - start)
        row[f"{name}_us"] = float(np.median(times)) * 1e6
    if np.max(np.abs(values[0] - values[1])) > harness.TOLERANCE:
        raise harness.BenchmarkError(f"{n_u} commands, horizon {N}: the commands differ")
    row["ratio"] = row["recursion_us"] / row["condensing_us"]
    return row


def measure_all(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """The chart."""
    with harness.pinned():
        rows = [measured(n_u, N, options.repeats) for n_u in COMMANDS for N in HORIZONS]
    return {"rows": rows}


def markdown(record: Mapping[str, Any]) -> str:
    """The record as a page."""
    intro = (__doc__ or "").strip()
    page = ["# Condensing and Riccati recursion\n", f"{harness.machine_line(record)}\n", intro]
    return "\n".join([*page, "", harness.records(record["rows"])])


def main() -> int:
    """Run the benchmark; 0, or 1 with one line on stderr."""
    parser = harness.parser(__doc__ or "", "condensing.json", [4])
    return harness.main(parser.parse_args(), measure_all, markdown)


if __name__ == "__main__":
    sys.exit(main())
