"""Format `text`: readable expressions in ASCII, one named intermediate per line, as in the paper.

One file for each function. `#` starts a comment, and every other line is one of

    function NAME
    input PORT[ROWS]              or PORT[ROWS, COLUMNS]
    output PORT[ROWS]             likewise
    NAME = EXPRESSION             an intermediate, before its first use
    PORT[ROW] = EXPRESSION        an entry of a result, or PORT[ROW, COLUMN]; counted from 1
    end

with numbers, names, entries of inputs, parentheses, + - * / ** (its right side first) and the
functions of `expression.FUNCTIONS` in an EXPRESSION. Comparisons give 1 or 0; where(c, x) is x
where c is not 0, else 0.
"""

from collections.abc import Iterator, Mapping
from textwrap import wrap

from .description import Export, Exposed, Port, Settings
from .expression import FUNCTIONS, Tree, written
from .listing import Block, Listing, listing, place
from .texts import comment, maker

_GRAMMAR = (
    "Lines: function, input, output (sizes in brackets), NAME = EXPRESSION, end; entries of",
    "inputs and outputs counted from 1. Expressions: numbers, names, + - * / ** ( ) and",
    *wrap(f"{', '.join(FUNCTIONS)}.", 96),
    "Comparisons give 1 or 0; where(c, x) is x where c is not 0, else 0.",
    "Values are SI, angles in rad. Intermediates: what, disc it is about, component.",
)


def write(export: Export, settings: Settings) -> Mapping[str, str]:
    """One text for each function.

    Raises:
        ModelError: a function with parts that have no expression.
    """
    return {f"{export.name}_{each.name}.txt": _text(export, each) for each in export.functions}


def _text(export: Export, function: Exposed) -> str:
    found = listing(export, function)
    return "\n".join([*_head(export, function), *_body(function, found), "end", ""])


def _head(export: Export, function: Exposed) -> Iterator[str]:
    yield f"# {comment(maker())}: {comment(export.title)}"
    yield from (f"# {comment(fact)}" for fact in export.facts)
    yield from (f"# {line}" for line in _GRAMMAR)
    yield ""
    yield f"function {function.name}"
    if function.title:
        yield f"# {comment(function.title)}"
    for way, ports in (("input", function.inputs), ("output", function.outputs)):
        for port in ports:
            yield _port(way, port)
            yield from _rows(export, port)


def _port(way: str, port: Port) -> str:
    size = str(port.rows) if port.columns == 1 else f"{port.rows}, {port.columns}"
    unit = f" [{comment(port.unit)}]" if port.unit else ""
    about = f"{comment(port.meaning)}{unit}".strip()
    return f"{way} {port.name}[{size}]" + (f"  # {about}" if about else "")


def _rows(export: Export, port: Port) -> Iterator[str]:
    """What each row of a labelled port is."""
    labels = export.labels.get(port.name, ())
    if port.columns == 1 and len(labels) == port.rows:
        for row, label in enumerate(labels, 1):
            yield f"#   {port.name}[{row}]  {comment(label.name)} [{comment(label.unit)}]"
    if port.name == "theta":
        for block, place in export.theta_blocks.items():
            yield f"#   theta[{place.start + 1}] to theta[{place.stop}]  {comment(block)}"


def _body(function: Exposed, found: Listing) -> Iterator[str]:
    for block in found.blocks:
        yield ""
        yield from (f"# {line}" for line in heading(block))
        for line in block.lines:
            yield f"{line.name} = {_expression(line.tree)}"
    for port, entries in zip(function.outputs, found.results, strict=True):
        yield ""
        yield f"# {port.name}"
        for (row, column), tree in entries.items():
            at = f"{row + 1}" if port.columns == 1 else f"{row + 1}, {column + 1}"
            yield f"{port.name}[{at}] = {_expression(tree)}"


def heading(block: Block) -> Iterator[str]:
    """A block's disc and title, then the units of its results."""
    disc = f"disc {block.disc}: " if block.disc else ""
    if disc or block.title:
        yield comment(f"{disc}{block.title}")
    units = ", ".join(f"{name} [{unit}]" for name, unit in block.units.items() if unit)
    yield from wrap(comment(units), 92, initial_indent="  ", subsequent_indent="  ")


def _expression(tree: Tree) -> str:
    return written(tree, lambda leaf: place(leaf, 1), {})
