"""Time per call and number of operations of the state equation and its Jacobian, by size."""

import argparse
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import casadi as ca

    from ..cli.common import Report
    from ..model import Model
    from ..robot import Robot

SIZES = (2, 4, 8, 16, 32, 64)
ASSEMBLIES = ("flat", "graph")
# Larger ones keep the C compiler busy for long; flat Jacobians are timed up to half the size.
FLAT_UP_TO, JACOBIAN_UP_TO = 8, 8
REPEATS = 9
_STATES = 64
_ROBOTS = 4096
_TIMING_S = 0.02
_ROW = (
    "{function:13} {assembly:6} {n_discs:>4} {n_q:>4} {operations:>10} "
    "{compile_s:>10} {median_us:>10} {minimum_us:>11}"
)
_BATCH_ROW = "{n_discs:>4} {n_q:>4} {compile_s:>10} {median_us:>10} {minimum_us:>11}"
_TITLES = {
    "function": "function",
    "assembly": "graph",
    "n_discs": "N",
    "n_q": "n_q",
    "operations": "operations",
    "compile_s": "compile s",
    "median_us": "median us",
    "minimum_us": "minimum us",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument(
        "--sizes", type=size, nargs="+", default=list(SIZES), metavar="N", help="numbers of discs"
    )
    parser.add_argument(
        "--flat-up-to", type=int, default=FLAT_UP_TO, metavar="N", help="time flat graphs up to N"
    )
    parser.add_argument(
        "--jacobian-up-to",
        type=int,
        default=JACOBIAN_UP_TO,
        metavar="N",
        help="time Jacobians up to N",
    )


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure, row by row."""
    from ..compiler import find_compiler
    from ..model import build

    compiler = find_compiler()
    report.section("dynamics", "state equation of the seed robot with N discs, chart cardan")
    report.note(repeats=REPEATS, compiler=compiler.version if compiler else None)
    report.line(
        "{how} from C++ (CasADi's map) over {states} random states, less {overhead_us:.3f} us "
        "for a call of nothing; median and minimum of {repeats} timings",
        how="compiled C functions called" if compiler else "CasADi's virtual machine called",
        states=_STATES,
        overhead_us=statistics.median(overheads()),
        repeats=REPEATS,
    )
    print("  " + _ROW.format(**_TITLES))
    for n_discs in sorted(set(options.sizes)):
        for assembly in ASSEMBLIES:
            model = build(seed_robot(n_discs), assembly=assembly)
            limit = options.flat_up_to if assembly == "flat" else n_discs
            _row(report, model, "ode", assembly, n_discs <= limit)
            if n_discs <= options.jacobian_up_to:
                limit = limit // 2 if assembly == "flat" else limit
                _row(report, model, "ode_jacobian", assembly, n_discs <= limit)

    _batches(options, report)


def _batches(options: argparse.Namespace, report: "Report") -> None:
    """Time per robot of `dtcasadi.batch`, all in one call from Python."""
    from ..batch import OneByOneWarning, batch
    from ..model import build

    report.section("batch", "the same for many robots in one call, time per robot")
    for n_discs in sorted(n for n in set(options.sizes) if n <= options.flat_up_to):
        model = build(seed_robot(n_discs), assembly="flat")
        start = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OneByOneWarning)
            many = batch(model)
        seconds = time.perf_counter() - start
        report.note(lanes=many.lanes, robots=_ROBOTS, why=many.why or None)
        if many.lanes == 1:
            print(f"  one robot at a time: {many.why}")
            return
        if n_discs == min(options.sizes):
            print(f"  {many.lanes} at a time, {_ROBOTS} in a call")
            print("  " + _BATCH_ROW.format(**_TITLES))
        columns = _columns(many.function, model.theta0, _ROBOTS)
        columns[many.function.name_in().index("theta")] = model.theta0
        times = _repeated(partial(many, *columns), _ROBOTS)
        report.row(
            "timings",
            _BATCH_ROW,
            n_discs=n_discs,
            n_q=model.n_q,
            compile_s=seconds,
            median_us=statistics.median(times),
            minimum_us=min(times),
        )


def seed_robot(n_discs: int) -> "Robot":
    """The paper's robot with another number of discs: hoops, three springs a pair, one chamber."""
    from dataclasses import replace

    from ..presets import seed_four_disc
    from ..robot import Chamber, Damping

    seed = seed_four_disc()
    pairs = range(1, n_discs)
    return replace(
        seed,
        discs=(*seed.discs[:1] * (n_discs - 1), seed.discs[-1]),
        threads=seed.threads[:1] * (n_discs - 1),
        springs=tuple(replace(s, discs=(i, i + 1)) for i in pairs for s in seed.springs[:3]),
        chambers=(Chamber((1, n_discs)),),
        damping=Damping(c_a=100.0, c_b=100.0, c_w=100.0),
    )


def _row(report: "Report", model: "Model", name: str, assembly: str, timed: bool) -> None:
    values: dict[str, Any] = {"compile_s": None, "median_us": None, "minimum_us": None}
    if timed:
        start = time.perf_counter()
        function = model.compiled(name).function
        values["compile_s"] = time.perf_counter() - start
        values["median_us"], values["minimum_us"] = time_per_call(function, model.theta0)
    report.row(
        "timings",
        _ROW,
        function=name,
        assembly=assembly,
        n_discs=model.n_discs,
        n_q=model.n_q,
        operations=operations(model.function(name)),
        **values,
    )


def operations(function: "ca.Function") -> int:
    """Operations of one call, those of the Functions it calls counted at every call."""
    import casadi as ca

    from ..linear import kernel_operations

    if function.is_a("SXFunction"):
        return int(function.n_instructions())
    if function.class_name() == "JitFunction":
        return kernel_operations(function)
    known: dict[int, int] = {}
    total = 0
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


def time_per_call(function: "ca.Function", theta: np.ndarray) -> tuple[float, float]:
    """Median and least time of a call, without CasADi's own share, [us].

    Args:
        function: with ports x, u, theta, compiled or not.
        theta: the parameters, the same in every call.
    """
    times, nothing = times_of_calls(function, theta), overheads()
    median = statistics.median(times) - statistics.median(nothing)
    return max(median, 0.0), max(min(times) - min(nothing), 0.0)


def times_of_calls(
    function: "ca.Function", theta: np.ndarray, held: Sequence[float] | np.ndarray = ()
) -> list[float]:
    """Times of a call with CasADi's own share, one for each repeat [us].

    The states differ from call to call, as they do in a simulation.

    Args:
        function: with ports x, u, theta, compiled or not.
        theta: the parameters, the same in every call.
        held: the last states, those of an actuator, the same in every call.
    """
    columns = _columns(function, theta, _STATES)
    if len(held):
        columns[function.name_in().index("x")][-len(held) :] = np.reshape(held, (-1, 1))
    return _timings(function, columns)


def _columns(function: "ca.Function", theta: np.ndarray, n: int) -> list[np.ndarray]:
    """Arguments of n calls, a column each."""
    rng = np.random.default_rng(0)
    columns = {
        "x": rng.uniform(-0.5, 0.5, (function.size1_in("x"), n)),
        "u": rng.uniform(0.0, 12.0, (function.size1_in("u"), n)),
        "theta": np.repeat(theta[:, np.newaxis], n, axis=1),
    }
    return [columns[port] for port in function.name_in()]


def overheads() -> list[float]:
    """Times of a mapped call of a function that does next to nothing [us]."""
    import casadi as ca

    from ..compile import twin

    x = ca.SX.sym("x")
    nothing = twin(ca.Function("nothing", [x], [x]))
    return _timings(nothing, [np.zeros((1, _STATES))])


def _timings(function: "ca.Function", columns: list[np.ndarray]) -> list[float]:
    """Times per call, one for each repeat, the calls made in C++ [us]."""
    from ..bound import Bound

    bound = Bound(function.map(_STATES))
    for buffer, values in zip(bound.inputs, columns, strict=True):
        buffer[...] = values.reshape(buffer.shape)
    return _repeated(bound.run, _STATES)


def _repeated(call: Callable[[], object], n: int) -> list[float]:
    """Times of one of n evaluations that a call makes, one for each repeat [us]."""
    call()
    start = time.perf_counter()
    call()
    rounds = max(1, round(_TIMING_S / (time.perf_counter() - start)))
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        for _ in range(rounds):
            call()
        times.append((time.perf_counter() - start) / (rounds * n) * 1e6)
    return times


def size(text: str) -> int:
    """A number of discs from the command line."""
    number = int(text)
    if not 2 <= number <= 256:
        raise argparse.ArgumentTypeError(f"expected a number of discs from 2 to 256, got {text}")
    return number
