"""C twins of casadi Functions: generated, compiled once, kept in a cache, loaded back."""

import ctypes
import hashlib
import re
import warnings
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import casadi as ca

from .bound import Bound, densified
from .cache import CacheFolder, CacheWarning, cache_folder, cached_library
from .compiler import (
    CXX,
    DEFAULT_FLAGS,
    DEFAULT_TIMEOUT_S,
    QUICK_FLAGS,
    C,
    Compiler,
    Language,
    Target,
    build_library,
    find_compiler,
    require_compiler,
    target_of,
)
from .errors import CompileError, ModelError

__all__ = [
    "CXX_FLAGS",
    "DEFAULT_FLAGS",
    "DEFAULT_TIMEOUT_S",
    "GENERATOR",
    "PREFIX",
    "QUICK_FLAGS",
    "Bound",
    "CacheFolder",
    "CacheWarning",
    "Compiler",
    "NoCompilerWarning",
    "bind",
    "c_source",
    "cache_folder",
    "compile_functions",
    "external_with_jacobian",
    "find_compiler",
    "library_of",
    "load_library",
    "twin",
]

# Of CasADi's code generator: text only, and no comment at each call, a quarter of a long chain's C.
GENERATOR = {"with_header": False, "verbose": False}
CXX_FLAGS = ("-std=c++17", *(flag for flag in DEFAULT_FLAGS if not flag.startswith("-std")))
PREFIX = "dtc_"
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
_MAX_NAME = 60
_said: list[str] = []


class NoCompilerWarning(UserWarning):
    """No C twin could be built; CasADi's virtual machine evaluates the Function instead."""


def bind(
    function: ca.Function,
    *,
    matrices: Collection[str] = (),
    flags: Sequence[str] = DEFAULT_FLAGS,
) -> Bound:
    """The fastest way to call a Function on arrays: its `twin` with buffers.

    Args:
        function: an SX or MX Function; the name as in `compile_functions`.
        matrices: ports that stay two-dimensional with one column, as in `Bound`.
        flags: compiler flags.

    Returns:
        A Bound with buffers of its own: one per thread.

    Raises:
        ModelError: the name of the Function or a name in `matrices` is not usable.
    """
    return Bound(twin(function, flags=flags), matrices=matrices, name=function.name())


def twin(
    function: ca.Function,
    *,
    source: ca.Function | None = None,
    flags: Sequence[str] = DEFAULT_FLAGS,
) -> ca.Function:
    """The C twin of a Function, or the Function itself where no working compiler is found.

    Without one the same numbers come more slowly; one NoCompilerWarning per process says so.

    Args:
        function: what the virtual machine can evaluate.
        source: the same with hand-written C kernels inside, which only generated code can run; by
            default `function`.
        flags: compiler flags.

    Raises:
        ModelError: the name of the Function is not usable.
    """
    try:
        return compile_functions([source or function], flags=flags)[function.name()]
    except CompileError as error:
        _say_no_compiler(str(error))
        return function


def compile_functions(
    functions: Sequence[ca.Function],
    *,
    flags: Sequence[str] = DEFAULT_FLAGS,
    timeout_s: float = DEFAULT_TIMEOUT_S,
) -> dict[str, ca.Function]:
    """Compile Functions into one shared library and load them from it.

    The twins have dense ports and no derivatives: differentiate the original, compile the result.

    Args:
        functions: Functions with different names, each of lower-case words joined by single
            underscores and at most 60 characters long.
        flags: compiler flags; `-march=native` is left out where the compiler does not know it.
        timeout_s: the compiler is stopped after this long [s].

    Returns:
        The external Functions, by the names of the originals.

    Raises:
        ModelError: a name is not usable or used twice.
        CompileError: there is no compiler, it fails, or its library does not load.
    """
    if not functions:
        return {}
    library = library_of(c_source(functions), flags=flags, timeout_s=timeout_s)
    try:
        importer = ca.Importer(str(library), "dll")
        return {f.name(): ca.external(PREFIX + f.name(), importer) for f in functions}
    except RuntimeError as error:
        hint = "DTCASADI_CACHE may name a folder that allows execution"
        raise CompileError(f"{library}: does not load ({hint}):\n{error}") from error


def load_library(
    functions: Mapping[str, ca.Function],
    source: str,
    constants: Mapping[str, float],
    flags: Sequence[str] = DEFAULT_FLAGS,
) -> ctypes.CDLL | None:
    """Hand-written C compiled in one library with the Functions it calls.

    Args:
        functions: macro by which the C text calls a Function -> the Function.
        source: C text appended to the generated code.
        constants: numbers the text names as macros.
        flags: compiler flags.

    Returns:
        The library, or None where no working compiler is found (said once per process).
    """
    lines = [f"#define {name} {value}" for name, value in constants.items()]
    lines += [f"#define {macro} {PREFIX}{f.name()}" for macro, f in functions.items()]
    text = "\n".join([c_source(list(functions.values())), *lines, source])
    try:
        return ctypes.CDLL(str(library_of(text, flags=flags)))
    except (CompileError, OSError) as error:
        _say_no_compiler(str(error))
        return None


def external_with_jacobian(function: ca.Function, blocks: ca.Function) -> ca.Function | None:
    """A compiled twin that CasADi can differentiate once, from one library.

    Args:
        function: x, u, theta -> value.
        blocks: x, u, theta -> value, d value/d x, d value/d u.

    Returns:
        The external Function, its derivative for theta zero; None without a working compiler.
    """
    name, ports = PREFIX + function.name(), function.name_in()
    symbols = [ca.MX.sym(port, function.size1_in(port)) for port in ports]
    unused = ca.MX.sym("out", *function.size_out(0))
    values = [*blocks.call(symbols)[1:], ca.MX(function.size1_out(0), symbols[-1].shape[0])]
    generator = ca.CodeGenerator("dtcasadi", GENERATOR)
    generator.add(densified(function, name))
    generator.add(ca.Function(f"jac_{name}", [*symbols, unused], values))
    try:
        return ca.external(name, str(library_of(generator.dump())))
    except (CompileError, RuntimeError) as error:
        _say_no_compiler(str(error))
        return None


def library_of(
    source: str,
    language: Language = C,
    *,
    flags: Sequence[str] | None = None,
    timeout_s: float = DEFAULT_TIMEOUT_S,
) -> Path:
    """The shared library of a text, compiled once and cached.

    Args:
        source: C99 or C++17.
        language: `compiler.C` or `compiler.CXX`.
        flags: compiler flags; by default `DEFAULT_FLAGS` or `CXX_FLAGS`.
        timeout_s: the compiler is stopped after this long [s].

    Raises:
        CompileError: there is no compiler, or it fails.
    """
    compiler = require_compiler(language)
    if flags is None:
        flags = CXX_FLAGS if language is CXX else DEFAULT_FLAGS
    target = target_of(compiler, tuple(flags))

    def build(path: Path) -> None:
        build_library(compiler, target, source, path, timeout_s)

    return cached_library(_key(source, compiler, target), build)


def c_source(functions: Sequence[ca.Function]) -> str:
    """The C99 text of Functions with dense ports, symbols prefixed with `dtc_`.

    Raises:
        ModelError: a name is not usable or used twice.
    """
    names = [function.name() for function in functions]
    for name in names:
        if not _NAME.fullmatch(name) or len(name) > _MAX_NAME:
            expected = f"lower-case words joined by _, at most {_MAX_NAME} characters"
            raise ModelError(f"function name: expected {expected}, got {name!r}")
        if names.count(name) > 1:
            raise ModelError(f"function name: expected different names, got {name!r} twice")
    generator = ca.CodeGenerator("dtcasadi", GENERATOR)
    for function in functions:
        # The prefix keeps a Function called `sin` or `read` from replacing the C library's.
        generator.add(densified(function, PREFIX + function.name()))
    return generator.dump()


def _key(source: str, compiler: Compiler, target: Target) -> str:
    """Digest of everything a library depends on."""
    parts = (
        source,
        *compiler.command,
        compiler.version,
        *target.flags,
        target.features,
        ca.CasadiMeta.version(),
    )
    # Each digest has the same length, so no two lists of parts run together.
    digests = b"".join(hashlib.sha256(part.encode()).digest() for part in parts)
    return hashlib.sha256(digests).hexdigest()


def _say_no_compiler(reason: str) -> None:
    """Warn on the first call of the process only."""
    if _said:
        return
    _said.append(reason)
    text = f"models run in CasADi's virtual machine, more slowly than compiled: {reason}"
    warnings.warn(text, NoCompilerWarning, stacklevel=4)  # who called `bind`
