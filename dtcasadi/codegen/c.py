"""Format `c`: the generated core, a wrapper with static work space, and a header for people."""

from collections.abc import Mapping

import casadi as ca

from .description import Export, Settings


def core(export: Export) -> str:
    """CasADi's C for all functions: symbols `<name>_raw_<function>`, C linkage not declared.

    Everything else in it begins with `<name>_internal_` or is static. Compiled as C++ with another
    `casadi_real`, it serves SIMD lanes as well.
    """
    generator = ca.CodeGenerator(f"{export.name}_internal", {"with_header": False})
    for each in export.functions:
        generator.add(_renamed(each.source, f"{export.name}_raw_{each.name}"))
    return generator.dump()


def _renamed(function: ca.Function, name: str) -> ca.Function:
    from ..bound import densified

    return densified(function, name)


def write(export: Export, settings: Settings) -> Mapping[str, str]:
    """The files of the folder, by name."""
    return {f"{export.name}_core.c": core(export)}
