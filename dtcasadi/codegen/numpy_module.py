"""Format `python`: the functions as one module that needs NumPy only.

The lines are those of format `text` (listing.py). Every function also takes many robots at once,
arrays with a last axis over them.
"""

import keyword
from collections.abc import Iterator, Mapping

from ..errors import ModelError
from .description import Export, Exposed, Port, Settings
from .expression import Tree, written
from .listing import Listing, listing, place
from .text import heading
from .texts import comment, filled, maker, number, wrapped

_TAKEN = ("np", "theta0", "theta_blocks", "rows")
_CALLS = {
    **{
        name: f"np.{name}({{0}})"
        for name in "sqrt exp log sin cos tan sinh cosh tanh floor ceil sign log1p expm1".split()
    },
    **{name: f"np.arc{name[1:]}({{0}})" for name in "asin acos atan asinh acosh atanh".split()},
    "abs": "np.fabs({0})",
    "atan2": "np.arctan2({0}, {1})",
    "min": "np.fmin({0}, {1})",
    "max": "np.fmax({0}, {1})",
    "fmod": "np.fmod({0}, {1})",
    "copysign": "np.copysign({0}, {1})",
    "hypot": "np.hypot({0}, {1})",
    "lt": "(1.0*({0} < {1}))",
    "le": "(1.0*({0} <= {1}))",
    "eq": "(1.0*({0} == {1}))",
    "ne": "(1.0*({0} != {1}))",
    "logic_not": "(1.0*({0} == 0))",
    "logic_and": "(1.0*(({0} != 0) & ({1} != 0)))",
    "logic_or": "(1.0*(({0} != 0) | ({1} != 0)))",
    "where": "np.where({0} != 0, {1}, 0.0)",
}


def write(export: Export, settings: Settings) -> Mapping[str, str]:
    """The module.

    Raises:
        ModelError: a function with parts that have no expression, or a name of Python's own.
    """
    for each in export.functions:
        for name in (each.name, *(port.name for port in each.inputs)):
            if keyword.iskeyword(name) or name in _TAKEN:
                expected = "no word of Python or of the module"
                raise ModelError(f"{each.name}: expected {expected}, got {name!r}")
    parts = [_constants(export), *(_function(export, each) for each in export.functions)]
    text = filled(
        "module.txt",
        maker=comment(maker()),
        title=comment(export.title),
        graph=export.graph[:16],
        facts="".join(f"{comment(fact)}\n" for fact in export.facts),
        functions="\n\n\n".join(part for part in parts if part),
    )
    return {f"{export.name}.py": text}


def _constants(export: Export) -> str:
    """theta0, where the blocks of theta are, and the names of rows."""
    lines = []
    if export.theta0 is not None:
        values = wrapped(number(value) for value in export.theta0)
        lines += [f"theta0 = np.array([{values.strip()}], dtype=float)", "theta_blocks = {"]
        for block, place in export.theta_blocks.items():
            lines.append(f"    {comment(block)!r}: slice({place.start}, {place.stop}),")
        lines.append("}")
    if export.labels:
        lines.append("rows = {")
        for port, labels in export.labels.items():
            names = wrapped((repr(comment(label.name)) for label in labels), " " * 8)
            lines.append(f"    {port!r}: [\n{names}\n    ],")
        lines.append("}")
    return "\n".join(lines)


def _function(export: Export, function: Exposed) -> str:
    found = listing(export, function)
    ports = ", ".join(port.name for port in function.inputs)
    lines = [f"def {function.name}({ports}):", *_documentation(function)]
    for port in function.inputs:
        lines.append(f"    {port.name} = _argument({port.name}, {_shape(port)}, {port.name!r})")
    lines += _body(found)
    results = [
        f"_result({_shape(port)}, [\n{wrapped(map(_expression, each.values()))}\n    ])"
        for port, each in zip(function.outputs, found.results, strict=True)
    ]
    lines.append(f"    return {', '.join(results)}")
    return "\n".join(lines)


def _documentation(function: Exposed) -> Iterator[str]:
    title = comment(function.title) or f"Function {function.name}."
    yield f'    """{title}'
    yield ""
    for head, ports in (("Args", function.inputs), ("Returns", function.outputs)):
        if head == "Returns":
            yield ""
        yield f"    {head}:"
        for port in ports:
            unit = f" [{comment(port.unit)}]" if port.unit else ""
            about = f"{comment(port.meaning)}{unit}".strip()
            yield f"        {port.name}: shape {_shape(port)}" + (f", {about}" if about else "")
    yield '    """'


def _body(found: Listing) -> Iterator[str]:
    for block in found.blocks:
        yield ""
        yield from (f"    # {line}" for line in heading(block))
        for line in block.lines:
            yield f"    {line.name} = {_expression(line.tree)}"
    yield ""


def _shape(port: Port) -> str:
    return f"({port.rows},)" if port.columns == 1 else f"({port.rows}, {port.columns})"


def _expression(tree: Tree) -> str:
    return written(tree, lambda leaf: place(leaf, 0), _CALLS)
