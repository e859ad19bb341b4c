"""Forward dynamics against Pinocchio and MuJoCo on the same chain, from compiled drivers.

python benchmarks/dynamics.py [--json F] [--sizes 4 8 16 32 64] [--repeats 9]
"""

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import chains
import drivers
import harness
import numpy as np
from harness import N_STATES, Case, Timing

import dtcasadi as dtc
from dtcasadi import presets

FLAGS = (drivers.BASE, drivers.NATIVE)
# How a segment's five angles are modelled, and the coordinates that go with it (chains.to_peer).
PINOCCHIO_JOINTS = {
    "revolute": "angles",
    "composite_revolute": "angles",
    "composite_zyx": "zyx",
    "composite_quaternion": "xyzw",
    "universal_zyx": "zyx",
    "universal_quaternion": "xyzw",
    "hinges_zyx": "zyx",
    "hinges_quaternion": "xyzw",
}
CONVENTIONS = ("aba-local", "aba-world")
MUJOCO_JOINTS = {"hinges": "angles", "ball": "wxyz"}
FINALISTS = 3  # fastest Pinocchio cases of a short first round that are timed in full
BARE, FIXED, SEED = "frames as parameters", "frames as numbers", "seed robot"
# Robots computed at a time: 8 and 4.
BATCHES = {"AVX-512": drivers.NATIVE, "AVX2": drivers.FOUR_LANES}
BATCH_UP_TO = 8
# At 4 discs; the names are those of the cases.
TARGETS_US = {
    (BARE,): 0.65,
    (SEED,): 0.8,
    **{
        (label, "batch", width): target_us
        for label in (BARE, FIXED)
        for width, target_us in (("AVX-512", 0.13), ("AVX2", 0.18))
    },
}
Programs = Mapping[str, Path]
Rows = list[dict[str, Any]]


def baked(function: ca.Function, theta: np.ndarray) -> ca.Function:
    """The same Function with theta replaced by numbers and left out of its ports."""
    kind = ca.SX if function.is_a("SXFunction") else ca.MX
    ports = [name for name in function.name_in() if name != "theta"]
    inputs = [kind.sym(name, function.sparsity_in(name)) for name in ports]
    outputs = function.call([*inputs, kind(ca.DM(theta))])
    return ca.Function(function.name(), inputs, outputs, ports, function.name_out(), {"cse": True})


def our_cases(
    label: str,
    function: ca.Function,
    inputs: Sequence[np.ndarray],
    theta: np.ndarray,
    folder: Path,
) -> list[Case]:
    """A Function compiled with each of FLAGS."""
    return [
        drivers.our_case(f"ours, {label}, {flags}", function, inputs, theta, flags, folder)[0]
        for flags in FLAGS
    ]


def batch_cases(
    label: str,
    function: ca.Function,
    inputs: Sequence[np.ndarray],
    theta: np.ndarray,
    folder: Path,
) -> list[Case]:
    """A Function for many robots at once, on each width of SIMD lanes the machine has."""
    return [
        drivers.our_batch_case(
            f"ours, {label}, batch, {width}", function, inputs, theta, flags, folder
        )
        for width, flags in BATCHES.items()
        if harness.has_feature(width)
    ]


def peer_case(
    label: str, command: Sequence[str | Path], coordinates: str, states: chains.States
) -> Case:
    """A peer's driver on the states in its coordinates."""
    rows = chains.to_peer(states, coordinates).rows()
    back = partial(chains.from_peer, states=states, coordinates=coordinates)
    return Case(label, tuple(map(str, command)), rows, back)


def pinocchio_cases(chain: Path, states: chains.States, programs: Programs) -> list[Case]:
    """Every modelling of the joints, both conventions, the library and the headers."""
    return [
        peer_case(
            f"pinocchio, {joints}, {convention}, {flags}",
            [programs[flags], chain, joints, convention],
            coordinates,
            states,
        )
        for flags in (drivers.LIBRARY, *FLAGS)
        for joints, coordinates in PINOCCHIO_JOINTS.items()
        for convention in CONVENTIONS
    ]


def mujoco_cases(
    models: Mapping[str, Path], states: chains.States, programs: Programs
) -> list[Case]:
    """Both modellings of the joints; mj_forward and its pieces."""
    return [
        peer_case(
            f"mujoco, {joints}, {call}", [programs["mujoco"], model, call], coordinates, states
        )
        for (joints, coordinates), model in zip(MUJOCO_JOINTS.items(), models.values(), strict=True)
        for call in ("forward", "smooth")
    ]


def bare_chain(
    n_discs: int, folder: Path, programs: Programs, options: argparse.Namespace
) -> tuple[dict[str, Timing], dict[str, float]]:
    """Timings on the chain of unit hoops, and how far each Pinocchio case is from ours."""
    robot = chains.unit_hoops(n_discs)
    model = dtc.build(robot, chart="cardan")
    states = chains.random_states(robot, N_STATES)
    theta = np.asarray(model.theta0, float)
    inputs = [states.q, states.v, np.zeros((N_STATES, 0)), states.tau]
    dynamics = model.forward_dynamics
    reference = drivers.evaluated(dynamics, inputs, theta)
    cases = our_cases(BARE, dynamics, inputs, theta, folder / "full")
    cases += our_cases(FIXED, baked(dynamics, theta), inputs, np.empty(0), folder / "fixed")
    if n_discs <= BATCH_UP_TO:
        fixed = baked(dynamics, theta)
        cases += batch_cases(BARE, dynamics, inputs, theta, folder / "batch")
        cases += batch_cases(FIXED, fixed, inputs, np.empty(0), folder / "batch_fixed")
    required = [case.label for case in cases]
    differences: dict[str, float] = {}
    if programs:
        chain = folder / "chain.txt"
        chain.write_text(chains.pinocchio_text(robot), encoding="utf-8")
        models = {joints: folder / f"{joints}.xml" for joints in MUJOCO_JOINTS}
        for joints, path in models.items():
            path.write_text(chains.mujoco_xml(robot, joints), encoding="utf-8")
        pinocchio = pinocchio_cases(chain, states, programs)
        mujoco = mujoco_cases(models, states, programs)
        first = harness.measure(pinocchio, reference, repeats=2, seconds=options.seconds / 4)
        differences = {label: timing.difference for label, timing in first.items()}
        # The plainest modelling of each peer must agree; the others may break down (README).
        required += [pinocchio[0].label, mujoco[0].label]
        ranked = sorted(pinocchio, key=lambda c: _sortable(first[c.label].minimum_us))
        cases += [pinocchio[0], *(c for c in ranked[:FINALISTS] if c is not pinocchio[0]), *mujoco]
    return _measure(cases, reference, required, options), differences


def seed_robot(folder: Path, options: argparse.Namespace) -> dict[str, Timing]:
    """Timings of the paper's robot: springs, damping, pressure, frames as parameters."""
    robot = presets.seed_four_disc()
    model = dtc.build(robot, chart="cardan")
    states = chains.random_states(robot, N_STATES)
    pressure = np.random.default_rng(2).uniform(0.0, 12.0, (N_STATES, 1))
    inputs = [states.q, states.v, pressure, states.tau]
    theta = np.asarray(model.theta0, float)
    reference = drivers.evaluated(model.forward_dynamics, inputs, theta)
    cases = our_cases(SEED, model.forward_dynamics, inputs, theta, folder)
    cases += batch_cases(SEED, model.forward_dynamics, inputs, theta, folder / "batch")
    return _measure(cases, reference, [case.label for case in cases], options)


def _measure(
    cases: Sequence[Case],
    reference: np.ndarray,
    required: Sequence[str],
    options: argparse.Namespace,
) -> dict[str, Timing]:
    times = {"repeats": options.repeats, "seconds": options.seconds}
    return harness.measure(cases, reference, required=required, **times)


def _sortable(value: float) -> float:
    return value if math.isfinite(value) else math.inf


def fastest(timings: Mapping[str, Timing], *words: str) -> tuple[str | None, float]:
    """Label and median of the fastest case whose label holds all the words.

    Cases of many robots at once are among them only where `batch` is one of the words.
    """
    kept = {k: t for k, t in timings.items() if ("batch" in k.split(", ")) == ("batch" in words)}
    named = {k: t.median_us for k, t in kept.items() if set(words) <= set(k.split(", "))}
    label = min(named, key=lambda k: _sortable(named[k]), default=None)
    return label, named[label] if label else math.nan


def summary_row(n_discs: int, timings: Mapping[str, Timing]) -> dict[str, Any]:
    """Ours against the fastest correct modelling of each peer, medians."""
    ours = fastest(timings, "ours", BARE)[1]
    pinocchio_case, pinocchio = fastest(timings, "pinocchio")
    mujoco_case, mujoco = fastest(timings, "mujoco", "forward")
    return {
        "n_discs": n_discs,
        "n_q": 5 * (n_discs - 1),
        "ours_us": ours,
        "ours_per_segment_us": ours / (n_discs - 1),
        "frames_as_numbers_us": fastest(timings, "ours", FIXED)[1],
        "pinocchio_us": pinocchio,
        "mujoco_us": mujoco,
        "pinocchio_over_ours": pinocchio / ours,
        "mujoco_over_ours": mujoco / ours,
        "pinocchio_case": pinocchio_case,
        "mujoco_case": mujoco_case,
    }


def growth(summary: Rows) -> dict[str, float]:
    """Time at the largest size over that at 8 discs, its exponent, and what a segment adds."""
    times = {row["n_discs"]: row["ours_us"] for row in summary if row["n_discs"] >= 8}
    if 8 not in times or len(times) < 2:
        return {}
    last = max(times)
    ratio, segments = times[last] / times[8], (last - 1) / 7
    exponent = math.log(ratio) / math.log(segments)
    added = {
        f"us_per_segment_{m}_to_{n}": (times[n] - times[m]) / (n - m) for m, n in pairwise(times)
    }
    return {"time_ratio": ratio, "segment_ratio": segments, "exponent": exponent, **added}


def timing_rows(n_discs: int, timings: Mapping[str, Timing]) -> Rows:
    """One record for each case."""
    return [{"case": k, "n_discs": n_discs, **vars(timing)} for k, timing in timings.items()]


def accuracy_rows(differences: Mapping[int, Mapping[str, float]]) -> Rows:
    """Differences of Pinocchio's plain build, a row for each modelling, a column for each size."""
    rows: Rows = []
    for joints in PINOCCHIO_JOINTS:
        for convention in CONVENTIONS:
            label = f"pinocchio, {joints}, {convention}, {drivers.BASE}"
            sizes = {str(n): d[label] for n, d in differences.items() if d}
            rows.append({"joints": joints, "convention": convention, **sizes})
    return rows if any(differences.values()) else []


def measure_all(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Build and time everything."""
    programs: dict[str, Path] = {}
    if not options.no_peers:
        kept = options.build or folder
        kept.mkdir(parents=True, exist_ok=True)
        print("building the peers' drivers (five minutes, unless --build has them)", flush=True)
        programs = {**drivers.build_pinocchio(kept), "mujoco": drivers.build_mujoco(kept)}
    timings, summary, differences = [], [], {}
    four: dict[str, Timing] = {}
    for n in sorted(options.sizes):
        bare, differences[n] = bare_chain(n, folder / f"bare_{n}", programs, options)
        timings += timing_rows(n, bare)
        four = bare if n == 4 else four
        summary.append(summary_row(n, bare))
        print(harness.table(list(summary[-1]), [list(summary[-1].values())]), flush=True)
    seed = seed_robot(folder / "seed", options)
    timings += timing_rows(4, seed)
    return {
        "summary": summary,
        "growth": growth(summary),
        "targets": [
            {"at 4 discs": ", ".join(words), "target_us": limit, "us": us, "met": us <= limit}
            for words, limit in TARGETS_US.items()
            for us in [fastest(four | seed, "ours", *words)[1]]
        ],
        "timings": timings,
        "pinocchio_accuracy": accuracy_rows(differences),
    }


def markdown(record: Mapping[str, Any]) -> str:
    """The record as a page."""
    parts = [
        "# Forward dynamics\n",
        f"{harness.machine_line(record)} Written by `python benchmarks/dynamics.py`.\n",
        "Bare chain of unit hoops, chart `cardan`; of each program the fastest case that agrees "
        "with ours; medians:\n",
        harness.records(record["summary"], without=("pinocchio_case", "mujoco_case")),
        f"Growth from 8 discs: {harness.pairs(record['growth'])}.\n",
        harness.records(record["targets"]),
        "All timed cases; difference: largest one from our accelerations, relative:\n",
        harness.records(record["timings"]),
    ]
    if record["pinocchio_accuracy"]:
        parts += [
            "Difference of each Pinocchio modelling (-O3) from ours, by number of discs:\n",
            harness.records(record["pinocchio_accuracy"]),
        ]
    return "\n".join(parts)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark; 0, or 1 with one line on stderr."""
    parser = harness.parser(__doc__ or "", "dynamics.json", [4, 8, 16, 32, 64])
    parser.add_argument("--no-peers", action="store_true", help="ours only")
    parser.add_argument("--build", type=Path, help="folder that keeps the peers' drivers")
    return harness.main(parser.parse_args(argv), measure_all, markdown)


if __name__ == "__main__":
    sys.exit(main())
