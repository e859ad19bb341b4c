"""Strict reading of TOML tables: every key accounted for, every fault collected with its path."""

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from . import checks
from .errors import ActuatorError, ProfileError, RobotError, SceneError
from .scene_units import PURE, Unit

REQUIRED: Any = object()
_MAX_FAULTS = 50
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]{1,60}")
Shape = tuple[int | None, ...]
LINE = "one line of text"


class Faults:
    """The errors of one scene, in the order of reading."""

    def __init__(self, source: str) -> None:
        self._source = printable(source)
        self._lines: list[str] = []
        self._more = 0

    def add(self, path: str, expected: str, got: object) -> None:
        """Note one error; beyond a limit only their number is kept."""
        if self.full:
            self._more += 1
            return
        where = f"{path}: " if path else ""
        self._lines.append(f"{self._source}: {where}expected {expected}, got {got}")

    @property
    def full(self) -> bool:
        """Whether further errors are only counted."""
        return len(self._lines) == _MAX_FAULTS

    def __len__(self) -> int:
        return len(self._lines) + self._more

    def check(self) -> None:
        """Raise what was collected.

        Raises:
            SceneError: at least one fault was noted.
        """
        if self._lines:
            more = [f"{self._source}: and {self._more} more errors"] if self._more else []
            raise SceneError(self._lines + more)


class Table:
    """One TOML table: `number`, `array`, ... take its keys, `close` refuses what nobody took.

    A value that is wrong or missing is noted in the faults and replaced by a placeholder, so that
    reading goes on and finds the other errors; `make` builds nothing from a table with faults.
    """

    def __init__(self, faults: Faults, path: str, content: Mapping[str, object]) -> None:
        self.faults, self.path = faults, path
        self._content = content
        self._written: dict[str, str] = {}  # key asked for -> as it stands in the file
        self._seen: set[str] = set()
        self._keys: dict[str, None] = {}  # every key asked for, in order
        self._variants: dict[str, None] = {}  # the same, with their units
        self.sound = True  # no fault was noted in this table itself

    def fault(self, key: str, expected: str, got: object) -> None:
        """Note an error of a key, under the name it has in the file."""
        self.sound = False
        name = re.match("[a-z_]*", key)[0]  # type: ignore[index]
        written = self._written.get(name, name) + key[len(name) :]
        self.faults.add(f"{self.path}.{written}".strip("."), expected, got)

    def holds(self, key: str, unit: Unit = PURE) -> bool:
        """Whether the key, or a variant with a unit, is in the table."""
        return any(name in self._content for name in unit.variants(key))

    def peek(self, key: str, unit: Unit = PURE) -> object:
        """The value as written, not yet taken; None where the key is absent."""
        values = [self._content[name] for name in unit.variants(key) if name in self._content]
        return values[0] if values else None

    def take(self, key: str, expected: str, unit: Unit = PURE, default: Any = REQUIRED) -> Any:
        """(value as written, its factor to SI); None where the key is absent."""
        variants = unit.variants(key)
        self._keys[key] = None
        self._variants.update(dict.fromkeys(variants))
        present = [name for name in variants if name in self._content]
        self._seen.update(present)
        if not present:
            if default is REQUIRED:
                self.fault(key, expected, "nothing")
            return None
        self._written[key] = present[0]
        if len(present) > 1:
            self.fault(key, f"only one of {', '.join(variants)}", " and ".join(present))
        return self._content[present[0]], variants[present[0]]

    def number(
        self,
        key: str,
        unit: Unit = PURE,
        *,
        default: Any = REQUIRED,
        positive: bool = False,
        nonnegative: bool = False,
    ) -> Any:
        """A finite number in SI units."""
        kind = "positive " if positive else "non-negative " if nonnegative else ""
        found = self.take(key, f"a finite {kind}number{unit.label}", unit, default)
        if found is None:
            return math.nan if default is REQUIRED else default
        bounds = {"positive": positive, "nonnegative": nonnegative}
        # As written, so that the message shows what the file holds, then in SI units.
        value = self._attempt(checks.number, key, found[0], **bounds)
        if value is not None:
            value = self._attempt(checks.number, key, found[1].apply(value), **bounds)
        return math.nan if value is None else value

    def array(self, key: str, shape: Shape, unit: Unit = PURE, *, default: Any = REQUIRED) -> Any:
        """Finite numbers of the shape (None: any length) in SI units."""
        wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
        found = self.take(key, f"finite numbers of shape {wanted}{unit.label}", unit, default)
        if found is None and default is not REQUIRED:
            return default
        value = found and self._attempt(checks.array, key, found[0], shape)
        if value is not None:
            value = self._attempt(checks.array, key, found[1].apply(value), shape)
        return np.full([n or 0 for n in shape], np.nan) if value is None else value

    def row(self, key: str, n: int | None, unit: Unit = PURE, *, default: Any = REQUIRED) -> Any:
        """Numbers in SI units, shape (n,); a single one stands for all."""
        if isinstance(self.peek(key, unit), int | float):
            return np.full(1 if n is None else n, self.number(key, unit, default=default))
        return self.array(key, (n,), unit, default=default)

    def integer(self, key: str, low: int, high: int, *, default: Any = REQUIRED) -> int:
        """An integer from low to high."""
        found = self.take(key, f"an integer from {low} to {high}", default=default)
        if found is None:
            return low if default is REQUIRED else default
        value = self._attempt(checks.index, key, found[0], low, high)
        return low if value is None else value

    def text(
        self, key: str, expected: str, fits: Callable[[str], object], *, default: Any = REQUIRED
    ) -> str:
        """A string that fits."""
        found = self.take(key, expected, default=default)
        if found is None:
            return "" if default is REQUIRED else default
        if isinstance(found[0], str) and fits(found[0]):
            return found[0]
        self.fault(key, expected, checks.shown(found[0]))
        return ""

    def choice(self, key: str, choices: Sequence[str], *, default: Any = REQUIRED) -> str:
        """One of the strings."""
        return self.text(key, one_of(choices), lambda text: text in choices, default=default)

    def truth(self, key: str, *, default: Any = REQUIRED) -> Any:
        """True or false."""
        found = self.take(key, "true or false", default=default)
        if found is None or isinstance(found[0], bool):
            return found[0] if found else default
        self.fault(key, "true or false", checks.shown(found[0]))
        return False

    def table(self, key: str, *, default: Any = REQUIRED) -> "Table | None":
        """A sub-table; None where there is none."""
        found = self.take(key, "a table", default=default)
        if found is None:
            return None
        if isinstance(found[0], dict):
            return Table(self.faults, f"{self.path}.{key}".strip("."), found[0])
        self.fault(key, "a table", checks.shown(found[0]))
        return None

    def tables(self, key: str, *, default: Any = REQUIRED) -> list[dict[str, object]]:
        """The contents of an array of tables; a single table counts as an array of one."""
        expected = f"[[{self.path}.{key}]] tables"
        found = self.take(key, expected, default=default)
        content = [] if found is None else found[0]
        content = [content] if isinstance(content, dict) else content
        if isinstance(content, list) and all(isinstance(entry, dict) for entry in content):
            return content
        self.fault(key, expected, checks.shown(content))
        return []

    def named(self, build: Callable[[str, object], Any]) -> dict[str, Any]:
        """build(key, value) of every key, where keys are names that are not known beforehand."""
        self._seen.update(self._content)
        found = {}
        for key, value in self._content.items():
            label = key if _BARE_KEY.fullmatch(key) else checks.shown(key)
            found[key] = self._attempt(build, label, value)
        return found

    def make(self, build: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """build(...), or None when this table has faults or build finds one."""
        return self._attempt(build, *arguments, **options) if self.sound else None

    def close(self) -> None:
        """Refuse every key that nobody asked for."""
        for key in [key for key in self._content if key not in self._seen]:
            bare = _BARE_KEY.fullmatch(key) and not self.faults.full
            near = difflib.get_close_matches(key, self._variants, 1) if bare else []
            hint = f" (did you mean {near[0]}?)" if near else ""
            self.sound = False
            path = f"{self.path}.{key if bare else checks.shown(key)}".strip(".")
            self.faults.add(path, f"one of {', '.join(self._keys)}{hint}", "an unknown key")

    def _attempt(self, build: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """build(...), its error noted under this table's path."""
        try:
            return build(*arguments, **options)
        except (RobotError, ProfileError, ActuatorError) as error:
            self.fault(error.field, error.expected, error.got)
            return None


def one_of(choices: Iterable[str]) -> str:
    """The choices as a text: `a, b or c`."""
    *most, last = choices
    return f"{', '.join(most)} or {last}" if most else last


def given(fields: dict[str, Any]) -> dict[str, Any]:
    """The fields that a file gives; the others keep the defaults of what is built from them."""
    return {name: value for name, value in fields.items() if value is not None}


def is_line(text: str) -> bool:
    """Whether a text is a line for people."""
    return text.isprintable() and 0 < len(text.strip()) and len(text) <= 200


def printable(text: str) -> str:
    """The text with what a terminal would act on, or cannot encode, written as an escape."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
