"""Building the compiled drivers: ours around a CasADi Function, the peers' against their wheels."""

import importlib.util
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from harness import BenchmarkError, Case, c_compiler, run

from dtcasadi.compile import DEFAULT_FLAGS, GENERATOR
from dtcasadi.compiler import FLAGS_OF_LIBRARIES
from dtcasadi.lanes import lanes_source

HERE = Path(__file__).parent
BASE = "-O3"
NATIVE = "-O3 -march=native"
FOUR_LANES = "-O3 -march=native -mno-avx512f"
LIBRARY = "wheel's library"
# The product's flags, for both sides; those for a shared library and the ones varied here aside.
SHARED = ("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")
TIMEOUT_S = 900.0


@dataclass(frozen=True)
class Built:
    """A driver, the seconds its compiler took for the generated code, and that code's bytes."""

    path: Path
    seconds: float
    c_bytes: int


def build_ours(function: ca.Function, flags: str, folder: Path) -> Built:
    """Generate a Function's C, compile it with the flags, and link it with `ours.c`.

    Args:
        function: with dense or sparse ports.
        flags: `-O1`, `-O2`, BASE, NATIVE ...
        folder: an existing folder for everything written.

    Raises:
        BenchmarkError: the compiler fails or takes longer than TIMEOUT_S.
    """
    unknown = {f for f in DEFAULT_FLAGS if f.startswith("-f")} - {*SHARED, *FLAGS_OF_LIBRARIES}
    if unknown:
        raise BenchmarkError(f"flags of the product that the benchmark lacks: {unknown}")
    name = function.name()
    stem = f"{name}_{flags.replace(' ', '').replace('=', '')}"
    generator = ca.CodeGenerator(f"{name}_generated.c", GENERATOR)
    generator.add(function)
    source = folder / f"{stem}.c"
    source.write_text(generator.dump(), encoding="utf-8")
    program = folder / stem
    object_file = source.with_suffix(".o")
    compiler = c_compiler()
    options = [*flags.split(), *SHARED]
    start = time.perf_counter()
    run([compiler, "-std=c99", *options, "-c", str(source), "-o", str(object_file)], TIMEOUT_S)
    seconds = time.perf_counter() - start
    driver = [compiler, "-std=gnu99", *options, f"-DFUNCTION={name}", str(HERE / "ours.c")]
    run([*driver, str(object_file), "-o", str(program), "-lm"], TIMEOUT_S)
    return Built(program, seconds, source.stat().st_size)


def evaluated(
    function: ca.Function, inputs: Sequence[np.ndarray], shared: np.ndarray
) -> np.ndarray:
    """Results in CasADi's virtual machine, all outputs of a state in one row."""
    last = [ca.DM(shared)] if function.n_in() > len(inputs) else []
    calls = (function.call([*map(ca.DM, state), *last]) for state in zip(*inputs, strict=True))
    return np.array([np.concatenate([r.nonzeros() for r in outputs]) for outputs in calls])


def our_case(
    label: str,
    function: ca.Function,
    inputs: Sequence[np.ndarray],
    shared: np.ndarray,
    flags: str,
    folder: Path,
) -> tuple[Case, Built]:
    """A compiled Function as a case.

    Args:
        label: of the case.
        function: what to compile.
        inputs: one array of shape (n_states, n) for each of the first inputs.
        shared: the last input, the same for all states; empty where there is none.
        flags: compiler flags, one text.
        folder: for everything written; made if need be.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shared.tofile(folder / "shared.bin")
    built = build_ours(function, flags, folder)
    command = (str(built.path), str(folder / "shared.bin"))
    return Case(label, command, np.hstack(inputs)), built


def our_batch_case(
    label: str,
    function: ca.Function,
    inputs: Sequence[np.ndarray],
    shared: np.ndarray,
    flags: str,
    folder: Path,
) -> Case:
    """The same on SIMD lanes, all states in one call, which counts as a call for each.

    The arguments of `our_case`; the Function has one result.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shared.tofile(folder / "shared.bin")
    name = function.name()
    stem = f"{name}_batch_{flags.replace(' ', '').replace('=', '')}"
    generator = ca.CodeGenerator(f"{name}_generated.c", GENERATOR)
    generator.add(function)
    source = folder / f"{stem}.cpp"
    source.write_text(lanes_source(generator.dump(), {name: function}), encoding="utf-8")
    program, lanes = folder / stem, source.with_suffix(".o")
    options = [*flags.split(), *SHARED]
    run(["g++", "-std=c++17", *options, "-c", str(source), "-o", str(lanes)], TIMEOUT_S)
    rows = ",".join(str(function.numel_in(i)) for i in range(function.n_in()))
    sizes = [f"-DFUNCTION={name}", f"-DROWS_IN={rows}", f"-DROWS_OUT={function.numel_out(0)}"]
    driver = [c_compiler(), "-std=gnu99", *options, *sizes, str(HERE / "ours_batch.c")]
    run([*driver, str(lanes), "-o", str(program), "-lm"], TIMEOUT_S)
    return Case(label, (str(program), str(folder / "shared.bin")), np.hstack(inputs))


def build_mujoco(folder: Path) -> Path:
    """`peers/mujoco_forward.c` against the wheel's header and library (its own flags)."""
    package = _package("mujoco")
    libraries = sorted(package.glob("libmujoco.so*")) + sorted(package.glob("libmujoco*.dylib"))
    if not libraries:
        raise BenchmarkError("mujoco: no library in the wheel")
    program = folder / "mujoco_forward"
    source = str(HERE / "peers" / "mujoco_forward.c")
    links = [f"-I{package / 'include'}", str(libraries[0]), f"-Wl,-rpath,{package}"]
    return _once(program, [c_compiler(), "-std=gnu99", BASE, source, *links, "-o", str(program)])


def build_pinocchio(folder: Path) -> dict[str, Path]:
    """`peers/pinocchio_aba.cpp` three ways: the wheel's library; its headers, plain and native.

    The last two instantiate the templates with our flags and link nothing of Pinocchio's: mixing
    -march=native with the library would mix two of Eigen's alignments. Two minutes each.
    """
    prefix = _package("pinocchio").parents[3]
    eigen = [prefix / "include", _package("casadi") / "include", Path("/usr/include")]
    found = [path / "eigen3" for path in eigen if (path / "eigen3" / "Eigen" / "Core").is_file()]
    if not found or not shutil.which("g++"):
        raise BenchmarkError("pinocchio: needs g++ and Eigen's headers (in casadi's wheel)")
    headers = ["-isystem", str(prefix / "include"), "-isystem", str(found[0])]
    library = [f"-L{prefix / 'lib'}", "-lpinocchio_default", f"-Wl,-rpath,{prefix / 'lib'}"]
    source = str(HERE / "peers" / "pinocchio_aba.cpp")
    # -w: at -march=native gcc warns of bounds inside Eigen, in branches that cannot be taken.
    common = ["g++", "-std=c++17", "-w", "-DNDEBUG", source, *headers]
    programs = {}
    for label, stem, options in (
        (LIBRARY, "library", [BASE, "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION", *library]),
        (BASE, "base", [BASE, *SHARED]),
        (NATIVE, "native", [*NATIVE.split(), *SHARED]),
    ):
        program = folder / f"pinocchio_aba_{stem}"
        programs[label] = _once(program, [*common, *options, "-o", str(program)])
    return programs


def _package(name: str) -> Path:
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise BenchmarkError(f"{name}: not installed; pip install -e .[test], or use --no-peers")
    return Path(spec.origin).parent


def _once(program: Path, command: Sequence[str]) -> Path:
    """Build a program unless it is there and newer than its sources."""
    sources = [HERE / "driver.h", *(HERE / "peers").glob("*.c*")]
    newest = max(source.stat().st_mtime for source in sources)
    if not program.is_file() or program.stat().st_mtime < newest:
        run(command, TIMEOUT_S)
    return program
