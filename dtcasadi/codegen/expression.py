"""Scalar expressions as small trees, and how a format writes them."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import casadi as ca

from ..errors import ModelError


class Node(NamedTuple):
    """An operation on trees; leaves are names (str) and numbers (float)."""

    operation: str
    arguments: tuple["Tree", ...]


Tree = Node | str | float

_INFIX = {"+": 1, "-": 1, "*": 2, "/": 2, "**": 4}
_NEGATIVE = 2  # of a leading minus
_OPERATIONS = {
    ca.OP_ADD: "+",
    ca.OP_SUB: "-",
    ca.OP_MUL: "*",
    ca.OP_DIV: "/",
    ca.OP_NEG: "neg",
    ca.OP_POW: "**",
    ca.OP_CONSTPOW: "**",
    ca.OP_SQRT: "sqrt",
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh",
    ca.OP_ATANH: "atanh",
    ca.OP_FABS: "abs",
    ca.OP_FMIN: "min",
    ca.OP_FMAX: "max",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_FMOD: "fmod",
    ca.OP_COPYSIGN: "copysign",
    ca.OP_SIGN: "sign",
    ca.OP_HYPOT: "hypot",
    ca.OP_LOG1P: "log1p",
    ca.OP_EXPM1: "expm1",
    ca.OP_LT: "lt",
    ca.OP_LE: "le",
    ca.OP_EQ: "eq",
    ca.OP_NE: "ne",
    ca.OP_NOT: "logic_not",
    ca.OP_AND: "logic_and",
    ca.OP_OR: "logic_or",
    ca.OP_IF_ELSE_ZERO: "where",
}
# Functions of the text format and their meaning; Python's are in `numpy_module`.
FUNCTIONS = tuple(name for name in _OPERATIONS.values() if name.isidentifier() and name != "neg")


_SHORT: dict[int, Callable[[Tree], Tree]] = {
    ca.OP_SQ: lambda x: Node("**", (x, 2.0)),
    ca.OP_TWICE: lambda x: Node("*", (2.0, x)),
    ca.OP_INV: lambda x: Node("/", (1.0, x)),
}


def elementwise(operation: int) -> bool:
    """Whether a CasADi operation has an expression."""
    return operation in _OPERATIONS or operation in _SHORT


def node(operation: int, arguments: tuple[Tree, ...]) -> Tree:
    """The tree of a CasADi operation.

    Raises:
        ModelError: one that formats have no name for.
    """
    if operation in _SHORT:
        return _SHORT[operation](*arguments)
    if operation not in _OPERATIONS:
        raise unnamed(operation)
    return Node(_OPERATIONS[operation], arguments)


def unnamed(operation: int) -> ModelError:
    """The error of a CasADi operation without an expression."""
    names = [n for n in dir(ca) if n.startswith("OP_") and getattr(ca, n) == operation]
    return ModelError(f"format: expected operations with a name, got CasADi's {names[0]}")


def leaves(tree: Tree) -> Iterator[str]:
    """The names in a tree."""
    if isinstance(tree, Node):
        for part in tree.arguments:
            yield from leaves(part)
    elif isinstance(tree, str):
        yield tree


def width(tree: Tree) -> int:
    """About how many characters a tree takes."""
    if isinstance(tree, Node):
        return 3 + sum(map(width, tree.arguments))
    return len(tree if isinstance(tree, str) else number(tree))


def number(value: float) -> str:
    """The shortest text of a number that reads back as the same; integers without a point.

    Raises:
        ModelError: it is not finite.
    """
    if not math.isfinite(value):
        raise ModelError(f"format: expected finite constants, got {value}")
    return str(int(value)) if abs(value) < 1e15 and value == int(value) else repr(value)


def written(tree: Tree, leaf: Callable[[str], str], calls: Mapping[str, str]) -> str:
    """A tree in infix form.

    Parentheses keep the order of every operation, so that it evaluates to the same bits.

    Args:
        tree: the tree.
        leaf: what a name is written as.
        calls: what a function is called, where not by its own name; {0}, {1} are its arguments.
    """

    def inner(tree: Tree) -> tuple[str, int]:
        if isinstance(tree, str):
            return leaf(tree), 9
        if isinstance(tree, float):
            return number(tree), 9 if tree >= 0 else _NEGATIVE
        operation, parts = tree.operation, [inner(part) for part in tree.arguments]
        if operation == "neg":
            return f"-{_held(parts[0], _NEGATIVE + 1)}", _NEGATIVE
        if operation in _INFIX:
            level = _INFIX[operation]
            # Only a power binds its left side more tightly than a chain of its like.
            left = _held(parts[0], level + (operation == "**"))
            right = _held(parts[1], level + 1)
            space = " " if level == 1 else ""
            return f"{left}{space}{operation}{space}{right}", level
        arguments = [text for text, _ in parts]
        if operation in calls:
            return calls[operation].format(*arguments), 9
        return f"{operation}({', '.join(arguments)})", 9

    return inner(tree)[0]


def _held(part: tuple[str, int], level: int) -> str:
    text, mine = part
    return text if mine >= level else f"({text})"
