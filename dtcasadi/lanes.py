"""Generated code with `casadi_real` as a SIMD type: several robots in one call.

The C text of a Function is compiled as C++17 between `native/lanes.hpp`, which defines the type,
and `native/batch.hpp`, which runs any number of robots through it.
"""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files

import casadi as ca

# What branches on a number in its C code: each lane may have to go another way.
_BRANCHING = {
    ca.OP_IF_ELSE_ZERO: "if_else",
    ca.OP_SIGN: "sign",
    ca.OP_SOLVE: "a linear solver of CasADi's",
    ca.OP_ASSERTION: "an assertion",
    ca.OP_ERFINV: "erfinv",
}
_PLAIN = ("SXFunction", "MXFunction", "JitFunction", "Map")


def obstacle(function: ca.Function) -> str:
    """Why a Function's C code cannot run on SIMD lanes; "" where nothing is known against it."""
    known: dict[int, str] = {}

    def walk(f: ca.Function) -> str:
        if f.class_name() not in _PLAIN:
            return f"{f.name()} is a {f.class_name()}"
        if not f.is_a("SXFunction") and not f.is_a("MXFunction"):
            return ""
        for k in range(f.n_instructions()):
            operation = f.instruction_id(k)
            if operation in _BRANCHING:
                return f"{f.name()} contains {_BRANCHING[operation]}"
            if operation != ca.OP_CALL:
                continue
            called = f.instruction_MX(k).which_function()
            key = called.__hash__()
            if key not in known:
                known[key] = walk(called)
            if known[key]:
                return known[key]
        return ""

    return walk(function)


def lanes_source(core: str, functions: Mapping[str, ca.Function]) -> str:
    """C++17 that runs n robots through each function: `<symbol>_batch`, `<symbol>_batch_bytes`.

    Args:
        core: CasADi's C text of the functions, or a line that includes it.
        functions: symbol in that text -> the Function with dense ports.
    """
    parts = [
        native("lanes.hpp"),
        "#define casadi_real dtc_lanes\n",
        core,
        native("batch.hpp"),
        *(_entry(symbol, function) for symbol, function in functions.items()),
    ]
    return "\n".join(parts)


def table(symbol: str, function: ca.Function) -> str:
    """C++ definition of `<symbol>_function`, what `dtc_batch` must know of a function."""
    rows = [function.numel_in(i) for i in range(function.n_in())]
    rows += [function.numel_out(i) for i in range(function.n_out())]
    return f"""
static dtc_function {symbol}_function() {{
  static const size_t rows[] = {{{", ".join(map(str, rows)) or "0"}}};
  casadi_int sz_arg, sz_res, sz_iw, sz_w;
  {symbol}_work(&sz_arg, &sz_res, &sz_iw, &sz_w);
  return {{{symbol}, {function.n_in()}, {function.n_out()}, (size_t)sz_arg, (size_t)sz_res,
          (size_t)sz_iw, (size_t)sz_w, rows}};
}}"""


def _entry(symbol: str, function: ca.Function) -> str:
    return f"""{table(symbol, function)}
extern "C" size_t {symbol}_batch_bytes(void) {{ return {symbol}_function().bytes(); }}
extern "C" int {symbol}_batch(size_t n, const double *const *in, const size_t *ld_in,
                              double *const *out, const size_t *ld_out, void *work, size_t bytes) {{
  return dtc_batch({symbol}_function(), n, in, ld_in, out, ld_out, work, bytes);
}}
extern "C" int {symbol}_batch_lanes(void) {{ return DTC_LANES; }}
"""


@cache
def native(name: str) -> str:
    """A file of `dtcasadi/native`."""
    return (files(__package__) / "native" / name).read_text(encoding="utf-8")
