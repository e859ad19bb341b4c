"""Lines of text from SX expressions: every value used twice gets a name, and so do long parts."""

from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import casadi as ca

from .expression import Node, Tree, node, width

_WIDTH = 84


class Line(NamedTuple):
    """`name = tree`."""

    name: str
    tree: Tree


def lines_of(targets: list[tuple[str, ca.SX]], temporary: Callable[[], str]) -> list[Line]:
    """One line for each target, and before it one for what is used twice or would be too long."""
    outputs = ca.vertcat(*(entry for _, entry in targets))
    symbols = ca.symvar(outputs)
    f = ca.Function("block", symbols, [outputs], {"cse": True})
    steps, uses, ends = _steps(f)
    lines: list[Line] = []
    trees: dict[int, Tree] = {}
    for key, (operation, arguments) in steps.items():
        if operation == ca.OP_INPUT:
            trees[key] = symbols[arguments[0]].name()
        elif operation == ca.OP_CONST:
            trees[key] = f.instruction_constant(key)
        else:
            parts = tuple(trees[argument] for argument in arguments)
            while sum(map(width, parts)) > _WIDTH and any(isinstance(p, Node) for p in parts):
                parts = _shortened(parts, lines, temporary)
            tree = node(operation, parts)
            if uses[key] > 1:
                # A result that others use keeps its own name.
                name = targets[ends[key][0]][0] if key in ends else temporary()
                lines.append(Line(name, tree))
                tree = name
            trees[key] = tree
    done = {line.name for line in lines}
    finals = {k: key for key, places in ends.items() for k in places}
    for k, (name, _) in enumerate(targets):
        if name not in done:
            lines.append(Line(name, trees[finals[k]]))
    return lines


def _steps(
    f: ca.Function,
) -> tuple[dict[int, tuple[int, list[int]]], Counter[int], dict[int, list[int]]]:
    """Instructions with the instructions they take, how often each is used, where results are."""
    work: dict[int, int] = {}
    steps: dict[int, tuple[int, list[int]]] = {}
    uses: Counter[int] = Counter()
    ends: dict[int, list[int]] = {}
    for k in range(f.n_instructions()):
        operation, taken = f.instruction_id(k), f.instruction_input(k)
        if operation == ca.OP_OUTPUT:
            ends.setdefault(work[taken[0]], []).append(f.instruction_output(k)[1])
            uses[work[taken[0]]] += 1
            continue
        leaf = operation in (ca.OP_INPUT, ca.OP_CONST)
        arguments = list(taken) if leaf else [work[place] for place in taken]
        if not leaf:
            uses.update(arguments)
        steps[k] = operation, arguments
        work[f.instruction_output(k)[0]] = k
    return steps, uses, ends


def _shortened(
    parts: tuple[Tree, ...], lines: list[Line], temporary: Callable[[], str]
) -> tuple[Tree, ...]:
    """The parts with the longest one under a name of its own."""
    longest = max(
        (i for i, part in enumerate(parts) if isinstance(part, Node)), key=lambda i: width(parts[i])
    )
    name = temporary()
    lines.append(Line(name, parts[longest]))
    return tuple(name if i == longest else part for i, part in enumerate(parts))
