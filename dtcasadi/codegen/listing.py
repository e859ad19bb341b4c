"""A Function as a list of named intermediates, grouped by kernel and disc.

Graphs that call per-segment kernels (`dtcasadi.assemble.Graph`) keep the structure of the
recursion: each call becomes a block of lines under the kernel's title and the disc it belongs to,
its results under their own names. Everything else becomes lines as well, whatever the Function.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, count
from typing import NamedTuple

import casadi as ca

from ..errors import ModelError
from .description import Export, Exposed
from .expression import Tree, elementwise, leaves
from .kernel_notes import NOTES
from .lines import Line, lines_of
from .operations import computed, moved

KERNEL = re.compile(r"seg_(\w+?)_\d+")
_COORDINATES = ("q", "qd", "qdd", "tau", "p")
_WORDS = {ca.OP_MTIMES: "product", ca.OP_SOLVE: "solution", ca.OP_DOT: "product"}


class Block(NamedTuple):
    """Lines that belong together: a title, the disc they are about (0: none), units by name."""

    title: str
    disc: int
    units: dict[str, str]
    lines: list[Line]


class Listing(NamedTuple):
    """Blocks in order, then each result's entries (row, column from 0) as trees.

    Leaves that begin with $ are entries of arguments, `$port,row` or `$port,row,column` from 0.
    """

    blocks: list[Block]
    results: list[dict[tuple[int, int], Tree]]


def listing(export: Export, exposed: Exposed) -> Listing:
    """The lines of an exported function.

    Raises:
        ModelError: something in it that has no expression, such as C code.
    """
    return _Lister(export, exposed).finished()


def place(leaf: str, start: int) -> str:
    """A leaf as formats write it: a name, or an entry of an argument counted from `start`."""
    if not leaf.startswith("$"):
        return leaf
    port, *at = leaf[1:].split(",")
    return f"{port}[{', '.join(str(int(k) + start) for k in at)}]"


class _Lister:
    """Walks a Function with SX values whose symbols are the names written so far."""

    def __init__(self, export: Export, exposed: Exposed):
        self._name = exposed.name
        self._blocks: list[Block] = []
        self._disc: dict[str, int] = {}  # of each name
        self._own: set[str] = set()  # names that belong to one segment: coordinates, their sines
        self._stems: set[str] = set()
        self._names = {port.name for port in (*exposed.inputs, *exposed.outputs)}
        self._counts: dict[str, Iterator[int]] = {}
        function = exposed.function
        values = [
            self._argument(export, port.name, port.rows, port.columns) for port in exposed.inputs
        ]
        found = self._call(function, values)
        self._results = [
            {
                (row, column): self._leaf(ca.densify(value)[row, column])
                for column in range(value.shape[1])
                for row in range(value.shape[0])
            }
            for value in found
        ]

    def finished(self) -> Listing:
        """What was found; a block whose arguments tell no disc is about the disc that uses it."""
        makers = {
            line.name: k
            for k, block in enumerate(self._blocks)
            if any(block.units.values()) and not block.disc
            for line in block.lines
        }
        used_by: dict[int, int] = {}
        for block in self._blocks:
            for line in block.lines:
                for name in leaves(line.tree) if block.disc else ():
                    if name in makers:
                        used_by.setdefault(makers[name], block.disc)
        for k, disc in used_by.items():
            self._blocks[k] = self._blocks[k]._replace(disc=disc)
        return Listing(self._blocks, self._results)

    # ---- names ---------------------------------------------------------------------------------

    def _argument(self, export: Export, port: str, rows: int, columns: int) -> ca.SX:
        """Symbols for a port's entries, each with its disc where it is about one."""
        discs = _discs(export, port, rows)
        entries = []
        for column in range(columns):
            for row in range(rows):
                name = f"${port},{row}" if columns == 1 else f"${port},{row},{column}"
                entries.append(ca.SX.sym(name))
                if discs:
                    self._disc[name] = discs[row]
                    self._own.add(name)
        return ca.reshape(ca.vertcat(*entries), rows, columns) if entries else ca.SX(rows, columns)

    def _leaf(self, value: ca.SX) -> Tree:
        return value.name() if value.is_symbolic() else float(value)

    def _numbered(self, word: str) -> str:
        return f"{word}{next(self._counts.setdefault(word, count(1)))}"

    def _fresh(self, name: str) -> str:
        return _unused([name], self._names)[0]

    # ---- walking -------------------------------------------------------------------------------

    def _call(self, function: ca.Function, values: list[ca.SX]) -> list[ca.SX]:
        values = [ca.project(value, function.sparsity_in(i)) for i, value in enumerate(values)]
        if function.is_a("SXFunction"):
            return self._kernel(function, values)
        if not function.is_a("MXFunction"):
            kind = f"{function.name()} ({function.class_name()})"
            raise ModelError(f"{self._name}: expected functions with expressions, got {kind}")
        return self._walk(function, values)

    def _walk(self, f: ca.Function, values: list[ca.SX]) -> list[ca.SX]:
        """The instructions of an MX Function in order."""
        work: dict[int, ca.SX] = {}
        results: list[dict[int, ca.SX]] = [{} for _ in range(f.n_out())]
        for k in range(f.n_instructions()):
            operation, places = f.instruction_id(k), f.instruction_output(k)
            expression = f.instruction_MX(k)
            if operation == ca.OP_INPUT:
                info = expression.info()
                start = info["offset"]
                entries = values[info["ind"]].nz[start : start + expression.nnz()]
                work[places[0]] = ca.SX(expression.sparsity(), entries)
                continue
            given = [work[place] if place >= 0 else None for place in f.instruction_input(k)]
            if operation == ca.OP_OUTPUT:
                info = expression.info()
                results[info["ind"]][info["offset"]] = given[0]
                continue
            if operation == ca.OP_CALL:
                called = expression.which_function()
                given = [
                    ca.SX(*called.size_in(i)) if value is None else value
                    for i, value in enumerate(given)
                ]
                found = self._call(called, given)
            else:
                found = self._apply(operation, expression, given)
            for place, value in zip(places, found, strict=True):
                if place >= 0:
                    work[place] = value
        return [
            ca.SX(f.sparsity_out(i), ca.vertcat(*(parts[k].nz[:] for k in sorted(parts))))
            if parts
            else ca.SX(f.sparsity_out(i))
            for i, parts in enumerate(results)
        ]

    def _apply(self, operation: int, expression: ca.MX, given: list[ca.SX]) -> list[ca.SX]:
        """An MX operation; what it computes gets names, what it only moves keeps them."""
        if (results := moved(operation, expression, given)) is not None:
            return results
        value = computed(operation, expression, given)
        word = _WORDS.get(operation, "value")
        title = "solution by elimination without exchange of rows" if word == "solution" else ""
        named = self._block(title, 0, [self._numbered(word)], [""], [value])
        if elementwise(operation):
            self._inherit(named[0], value)
        return named

    def _inherit(self, named: ca.SX, value: ca.SX) -> None:
        """Entries made from one segment's coordinates alone belong to it as well."""
        for name, entry in zip(named.nz[:].elements(), value.nz[:].elements(), strict=True):
            if name.is_symbolic():
                sources = [symbol.name() for symbol in ca.symvar(entry)]
                discs = {self._disc[source] for source in sources if source in self._disc}
                if len(discs) == 1 and not self._own.isdisjoint(sources):
                    self._disc.setdefault(name.name(), discs.pop())
                    self._own.add(name.name())

    def _kernel(self, function: ca.Function, values: list[ca.SX]) -> list[ca.SX]:
        """An SX Function: a kernel, or any other, as one block."""
        matched = KERNEL.fullmatch(function.name())
        kernel = matched[1] if matched else ""
        note = NOTES.get(kernel)
        symbols = {s.name() for s in ca.symvar(ca.veccat(*values))}
        discs = {name: self._disc[name] for name in symbols if name in self._disc}
        mine = {disc for name, disc in discs.items() if name in self._own}
        # A joint belongs to the disc beyond it, whatever else it takes from its neighbours.
        disc = max(mine) if mine else min(discs.values(), default=0)
        first = min(mine, default=disc) - 1 if mine else disc
        found = function.call(values)
        fields, units, places = [], [], []
        for k in range(len(found)):
            field, unit = function.name_out(k), ""
            at = disc
            if note:
                field, unit = note.output(k)
                if len(found) > len(note.outputs):  # a span: the same for one disc after another
                    at = first + k // len(note.outputs)
            fields.append(f"{field}_{at}" if at else field)
            units.append(unit)
            places.append(at)
        title = note.title if note else "" if kernel else function.name()
        stems = _unused(fields, self._stems)
        results = self._block(title or kernel, disc, stems, units, found)
        for at, result in zip(places, results, strict=True):
            for symbol in ca.symvar(result) if at else ():
                self._disc.setdefault(symbol.name(), at)
                if kernel == "trigonometry":
                    self._own.add(symbol.name())
        return results

    def _block(
        self, title: str, disc: int, stems: list[str], units: list[str], values: list[ca.SX]
    ) -> list[ca.SX]:
        """Lines for values in terms of earlier names; the values as names."""
        block = Block(title, disc, {}, [])
        named: list[ca.SX] = []
        targets: list[tuple[str, ca.SX]] = []
        for stem, unit, value in zip(stems, units, values, strict=True):
            value, entries = ca.SX(value), []
            for suffix, entry in zip(_suffixes(value), value.nz[:].elements(), strict=True):
                if entry.is_symbolic() or entry.is_constant():
                    entries.append(entry)
                    continue
                name = self._fresh(f"{stem}{suffix}")
                entries.append(ca.SX.sym(name))
                targets.append((name, entry))
                block.units.setdefault(stem, unit)
            named.append(ca.SX(value.sparsity(), ca.vertcat(*entries)))
        if targets:
            block.lines.extend(lines_of(targets, self._temporary(next(iter(block.units)))))
            self._blocks.append(block)
        return named

    def _temporary(self, stem: str) -> Callable[[], str]:
        numbers = count(1)
        return lambda: self._fresh(f"{stem}_t{next(numbers)}")


def _unused(names: Sequence[str], taken: set[str]) -> list[str]:
    """The names with the same letters behind each where some are taken; taken from now on."""
    for tag in chain([""], "bcdefghijklmnopqrstuvwxyz", (f"r{n}" for n in count(1))):
        tagged = [name + tag for name in names]
        if taken.isdisjoint(tagged):
            taken.update(tagged)
            return tagged
    raise AssertionError


def _discs(export: Export, port: str, rows: int) -> list[int]:
    """The disc each row of a port is about: coordinates move the disc beyond them."""
    model = export.model
    if model is None or rows == 0:
        return []
    discs = [i + 2 for i, chart in enumerate(model.charts) for _ in chart.coordinate_names]
    if port in _COORDINATES and rows == len(discs):
        return discs
    return [*discs, *discs] if port == "x" and rows == 2 * len(discs) else []


def _suffixes(value: ca.SX) -> list[str]:
    """What tells the nonzeros of a result apart, counted from 1 and column by column."""
    rows, columns = value.shape
    if value.is_scalar():
        return [""] * value.nnz()
    at = zip(*value.sparsity().get_triplet(), strict=True)
    if (rows, columns) == (3, 1):
        return ["_" + "xyz"[row] for row, _ in at]
    if columns == 1:
        return [f"_{row + 1}" for row, _ in at]
    return [f"_{row + 1}_{column + 1}" for row, column in at]
