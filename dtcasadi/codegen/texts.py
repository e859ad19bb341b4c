"""Pieces of generated text: templates, comments, numbers, names of a prefix."""

import re
from collections.abc import Iterable
from functools import cache
from importlib.resources import files

import numpy as np

from ..versions import version_of

_FIELD = re.compile(r"@([A-Za-z_]+)@")
_WIDTH = 98


def filled(template: str, **fields: object) -> str:
    """A template of `codegen/templates` with every @field@ replaced."""
    return _FIELD.sub(lambda match: str(fields[match[1]]), _template(template))


@cache
def _template(name: str) -> str:
    return (files(__package__) / "templates" / name).read_text(encoding="utf-8")


def comment(text: str) -> str:
    """A text of any origin as one line that is safe inside a comment of C, Python or Markdown.

    Nothing in it ends a C comment, joins lines or is a trigraph.
    """
    line = " ".join(str(text).split())
    line = "".join(c if " " <= c <= "~" and c not in "\\`<>" else "." for c in line)
    return line.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").replace('"', "'")


def wrapped(items: Iterable[str], indent: str = "    ") -> str:
    """Items separated by commas over lines of bounded length."""
    lines, line = [], indent
    for item in items:
        if len(line) + len(item) + 2 > _WIDTH and line != indent:
            lines.append(line.rstrip())
            line = indent
        line += f"{item}, "
    lines.append(line.rstrip().rstrip(","))
    return "\n".join(lines)


def number(value: float, *, single: bool = False) -> str:
    """A finite number as a C constant of the precision in use, exact to its last bit."""
    if not single:
        return repr(float(value))
    largest = float(np.finfo(np.float32).max)
    rounded = float(np.clip(value, -largest, largest))
    text = np.format_float_scientific(np.float32(rounded), unique=True, trim="0")
    return f"{text}f"


def maker() -> str:
    """What wrote a file."""
    return f"dtcasadi {version_of('dtcasadi') or ''}".strip()
