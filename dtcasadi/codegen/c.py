"""Format `c`: a folder of C99 that stands alone.

`<name>_core.c` is CasADi's code for all functions, `<name>.c` the wrapper behind the header for
people `<name>.h`, `main.c` an example, and a Makefile, a CMakeLists.txt and a README go with them.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

import casadi as ca

from ..bound import densified
from ..compile import GENERATOR
from ..compiler import DEFAULT_FLAGS, FLAGS_OF_LIBRARIES
from ..errors import ModelError
from . import build, header, precision, project
from .description import Export, Exposed, Port, Settings
from .names import different, macro
from .texts import comment, filled, maker, number

# The product's own flags but those that name this machine or the kind of output. Above -O2, -O3
# costs the compiler a tenth and gains a third where dense solves take part; elsewhere nothing
# (benchmarks/results/compile_size.md).
FLAGS = tuple(
    flag for flag in DEFAULT_FLAGS if flag not in ("-std=c99", "-march=native", *FLAGS_OF_LIBRARIES)
)
_CALLED = """
    sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp expm1 log log1p pow sqrt
    hypot erf fabs fmin fmax fmod floor ceil copysign
"""
_LITERAL = re.compile(r"(?<![\w.])(\d+\.\d*(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+)(?![\w.])")
_NOT_CODE = re.compile(r'(/\*.*?\*/|"[^"\n]*"|^#[^\n]*$)', re.DOTALL | re.MULTILINE)
_SIZES = ".*?".join([r"_work\(", *(rf"\*sz_{name} = (\d+);" for name in ("arg", "res", "iw", "w"))])


class WorkSize(NamedTuple):
    """Entries of CasADi's work space: pointers to arguments and results, integers, numbers."""

    sz_arg: int
    sz_res: int
    sz_iw: int
    sz_w: int


def write(export: Export, settings: Settings) -> Mapping[str, str]:
    """The files of the folder, by name.

    Raises:
        ModelError: two functions would share a C name.
        CompileError: single precision is to be measured, and the compiler fails.
    """
    _check_symbols(export)
    body = core_body(export, settings)
    sizes = work_sizes(export, body)
    name, fields = export.name, _fields(export, settings)
    sources = {
        f"{name}.h": header.text(export, settings, sizes, fields),
        f"{name}.c": _wrapper(export, settings, fields),
        f"{name}_core.c": filled("core.c", **fields, body=body),
    }
    single = ""
    if settings.single:
        errors = precision.measured(export, body, lambda each: raw(export, each), FLAGS)
        single = project.single_section(errors, build.cortex_sizes(sources))
    return sources | project.texts(export, settings, sizes, {**fields, "single": single})


def core_body(export: Export, settings: Settings) -> str:
    """CasADi's C for all functions: symbols `<name>_raw_<function>`.

    Everything else in it begins with `<name>_internal_` or is static. `core.c` puts C linkage
    around it, unless `<NAME>_CXX_LINKAGE` is defined: compiled as C++ with `casadi_real` defined as
    another type, it serves SIMD lanes as well.
    """
    options: dict[str, object] = dict(GENERATOR)
    if settings.single:
        # 32-bit integers too: casadi.external cannot load single precision anyway.
        options |= {"casadi_real": "float", "casadi_int": "int"}
    generator = ca.CodeGenerator(f"{export.name}_internal", options)
    for each in export.functions:
        generator.add(densified(each.source, raw(export, each)))
    text = generator.dump()
    return _in_single(text) if settings.single else text


def work_sizes(export: Export, core: str) -> dict[str, WorkSize]:
    """Sizes of the work space of each function as the generated `<f>_work` gives them.

    A Function's own `sz_w` and the like are those of the virtual machine, not of its C.
    """
    sizes = {}
    for each in export.functions:
        found = re.search(rf"\b{raw(export, each)}{_SIZES}", core, re.DOTALL)
        assert found, f"no work sizes of {each.name} in CasADi's code"
        sizes[each.name] = WorkSize(*map(int, found.groups()))
    return sizes


def raw(export: Export, function: Exposed) -> str:
    """CasADi's own symbol of a function."""
    return f"{export.name}_raw_{function.name}"


def visible(function: Exposed) -> tuple[Port, ...]:
    """The results in the wrapper's signature: without `status`, which the return value tells."""
    return tuple(port for port in function.outputs if not is_status(port))


def is_status(port: Port) -> bool:
    """Whether a result is a function's own report of success."""
    return port.name == "status" and port.size == 1


def _fields(export: Export, settings: Settings) -> dict[str, object]:
    """What the templates share."""
    return {
        "name": export.name,
        "NAME": macro(export.name),
        "maker": comment(maker()),
        "title": comment(export.title),
        "graph": export.graph[:16],
        "real": "float" if settings.single else "double",
        "int": "int" if settings.single else "long long int",
        "first": export.functions[0].name,
        "flags": " ".join(FLAGS),
    }


def _check_symbols(export: Export) -> None:
    """Check that no two symbols of the header and the wrapper are the same."""
    kinds = ("real", "int", "status", "status_text", "work", "bits", "aligned", "theta0")
    symbols = [*kinds, *(f"{label}_index" for label in export.labels)]
    for each in export.functions:
        if each.name.split("_")[0] in ("raw", "internal"):
            expected = "a name that does not begin with raw or internal"
            raise ModelError(f"function name: expected {expected}, got {each.name!r}")
        symbols += [each.name, f"{each.name}_work"]
    different(symbols, "functions")


def _wrapper(export: Export, settings: Settings, fields: Mapping[str, object]) -> str:
    name = export.name
    ports = f"const {name}_real **arg, {name}_real **res, {name}_int *iw, {name}_real *w, int mem"
    single = settings.single
    return filled(
        "wrapper.c",
        **fields,
        raw="\n".join(f"int {raw(export, each)}({ports});" for each in export.functions),
        bits="int" if single else "long long",
        exponent="0x7f800000U" if single else "0x7ff0000000000000ULL",
        parameters=header.parameters(export, settings),
        functions="\n".join(_function(export, each) for each in export.functions),
    )


def _function(export: Export, function: Exposed) -> str:
    """The wrapper of one function; its locals end in _, which no port does."""
    name, NAME = export.name, macro(export.name)
    ins, outs = function.inputs, visible(function)
    status = any(is_status(port) for port in function.outputs)
    lines = [
        f"{header.prototype(export, function, visible(function))} {{",
        f"  const {name}_real *const in_[] = {{{', '.join(p.name for p in ins) or 'NULL'}}};",
        f"  {name}_real *const out_[] = {{{', '.join(p.name for p in outs) or 'NULL'}}};",
        f"  static const size_t n_in_[] = {{{', '.join(str(p.size) for p in ins) or '0'}}};",
        f"  static const size_t n_out_[] = {{{', '.join(str(p.size) for p in outs) or '0'}}};",
        f"  {name}_{function.name}_work *at_ = ({name}_{function.name}_work *)work;",
        *([f"  {name}_real failed_ = 0;"] if status else []),
        f"  {name}_status status_ = check_work_(work, work_bytes, sizeof *at_);",
        f"  if (status_ != {NAME}_OK) return status_;",
        f"  status_ = check_ports_(in_, n_in_, {len(ins)}, out_, n_out_, {len(outs)});",
        f"  if (status_ != {NAME}_OK) return status_;",
    ]
    lines += [f"  at_->arg[{i}] = {port.name};" for i, port in enumerate(ins)]
    lines += [
        f"  at_->res[{i}] = {'&failed_' if is_status(port) else port.name};"
        for i, port in enumerate(function.outputs)
    ]
    call = f"{raw(export, function)}(at_->arg, at_->res, at_->iw, at_->w, 0)"
    lines.append(f"  if ({call}) return {NAME}_FAILED;")
    lines.append(f"  status_ = check_results_(out_, n_out_, {len(outs)});")
    if status:
        lines.append(f"  if (status_ == {NAME}_OK && failed_ != 0) return {NAME}_NOT_CONVERGED;")
    return "\n".join([*lines, "  return status_;", "}\n"])


def _in_single(text: str) -> str:
    """The code with float constants and functions, so that nothing is promoted to double."""
    pieces = _NOT_CODE.split(text)
    # Odd pieces are comments, strings and preprocessor lines.
    pieces[::2] = [
        _LITERAL.sub(lambda match: number(float(match[1]), single=True), piece)
        for piece in pieces[::2]
    ]
    called = [name for name in _CALLED.split() if re.search(rf"\b{name}\(", text)]
    twins = "\n".join(f"#define {name} {name}f" for name in called)
    return "".join(pieces).replace("#include <math.h>\n", f"#include <math.h>\n\n{twins}\n", 1)
