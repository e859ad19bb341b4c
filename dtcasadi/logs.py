"""Recorded data: times and named channels with units, from CSV or NPZ, checked.

CSV: a header `t [s], command1 [kPa], tip.x [mm], ...`, then a row of numbers for each instant, in
the order of arrival; an empty cell or `nan` is a channel without a reading. NPZ: the same names as
arrays of one length. Names are `command<k>` or those of sensors' channels, `<sensor>.<channel>`.
"""

import csv
import io
import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import LogError
from .files import written
from .scene_tables import printable

MAX_BYTES = 500_000_000
UNITS = {
    "": ("", 1.0),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "Pa": ("Pa", 1.0),
    "kPa": ("Pa", 1e3),
    "bar": ("Pa", 1e5),
    "m": ("m", 1.0),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "rad": ("rad", 1.0),
    "deg": ("rad", math.pi / 180),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", math.pi / 180),
    "m/s^2": ("m/s^2", 1.0),
    "N": ("N", 1.0),
}
_HEAD = re.compile(r"\s*([a-z][a-z0-9_]{0,60}(?:\.[a-z][a-z0-9_]{0,60})?)\s*(?:\[([^\[\]]*)\])?\s*")
_LARGEST = 1e30


@dataclass(frozen=True, eq=False)
class Log:
    """Recorded channels in SI units.

    Attributes:
        t: instant of each row [s], shape (n,), in the order of arrival.
        channels: name -> readings, shape (n,); NaN where there is none.
        units: name -> SI unit.
        source: what errors call it.
    """

    t: np.ndarray
    channels: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    source: str = "log"

    def columns(self, expected: Iterable[tuple[str, str | None]]) -> np.ndarray | None:
        """Channels side by side, shape (n, k); None where the log has none of them.

        Args:
            expected: name and SI unit of each; None: any unit.

        Raises:
            LogError: some are missing, or one has another unit.
        """
        wanted = list(expected)
        present = [name for name, _ in wanted if name in self.channels]
        if not present:
            return None
        for name, unit in wanted:
            if name not in self.channels:
                raise LogError(f"{self.source}: {name}: expected a channel beside {present[0]}")
            if unit is not None and self.units[name] != unit:
                raise LogError(
                    f"{self.source}: {name}: expected a unit of [{unit}], got [{self.units[name]}]"
                )
        return np.column_stack([self.channels[name] for name, _ in wanted])

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write as CSV, whole or not at all.

        Raises:
            OSError: the file cannot be written.
        """
        heads = ["t [s]", *(f"{name} [{self.units[name]}]" for name in self.channels)]
        rows = zip(self.t, *self.channels.values(), strict=True)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows(["" if math.isnan(v) else repr(float(v)) for v in row] for row in rows)
        with written(Path(path)) as file:
            file.write(text.getvalue().encode())
        return Path(path)


def read_log(path: str | os.PathLike[str]) -> Log:
    """A log from a .csv or .npz file.

    Raises:
        LogError: one line that names the file, and line and channel where there are any.
    """
    target = Path(path)
    source = printable(str(target)) or "''"
    try:
        if not target.is_file():
            raise LogError(f"{source}: expected a readable .csv or .npz file, got none")
        if target.stat().st_size > MAX_BYTES:
            raise LogError(f"{source}: expected at most {MAX_BYTES:_} bytes, got more")
        data = target.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "a path that no file can have"
        raise LogError(f"{source}: expected a readable log, got {reason.lower()}") from None
    return parse_npz(data, source) if target.suffix == ".npz" else parse_csv(data, source)


def parse_csv(data: bytes, source: str = "log") -> Log:
    """A log from the bytes of a CSV file.

    Raises:
        LogError: as of `read_log`.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise LogError(f"{source}: expected text in UTF-8, got byte {error.start}") from None
    reader = csv.reader(io.StringIO(text))
    try:
        rows = [(reader.line_num, row) for row in reader if any(row)]
    except csv.Error as error:
        where = f"{source}: line {reader.line_num}"
        raise LogError(f"{where}: expected comma-separated values, got {error}") from None
    if len(rows) < 2:
        raise LogError(f"{source}: expected a header and at least one row, got {len(rows)} lines")
    heads = [_head(cell, source) for cell in rows[0][1]]
    names = [name for name, _ in heads]
    values = np.full((len(rows) - 1, len(heads)), np.nan)
    for i, (line, row) in enumerate(rows[1:]):
        if len(row) != len(heads):
            raise LogError(f"{source}: line {line}: expected {len(heads)} cells, got {len(row)}")
        for j, cell in enumerate(row):
            values[i, j] = _number(
                cell, f"{source}: line {line}: {names[j]}", needed=names[j] == "t"
            )
    return _log(dict(zip(names, values.T, strict=True)), dict(heads), names, source)


def parse_npz(data: bytes, source: str = "log") -> Log:
    """A log from the bytes of an NPZ file: arrays called as the heads of a CSV.

    Raises:
        LogError: as of `read_log`.
    """
    import zipfile
    import zlib

    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name]) for name in file.files}
    except (
        ValueError,
        OSError,
        EOFError,
        KeyError,
        NotImplementedError,
        zipfile.BadZipFile,
        zlib.error,
        SyntaxError,
        MemoryError,
        RuntimeError,
    ):
        raise LogError(f"{source}: expected an .npz file of numbers, got another one") from None
    heads = [_head(name, source) for name in arrays]
    columns = {}
    for (name, _), array in zip(heads, arrays.values(), strict=True):
        if array.ndim != 1 or array.dtype.kind not in "fiu" or not len(array):
            raise LogError(f"{source}: {name}: expected a row of numbers, got {array.dtype}")
        columns[name] = array.astype(float)
    return _log(columns, dict(heads), [name for name, _ in heads], source)


def _head(cell: str, source: str) -> tuple[str, str]:
    match = _HEAD.fullmatch(cell)
    if not match:
        raise LogError(
            f"{source}: header: expected names such as t [s] or tip.x [mm], got "
            f"{printable(cell)[:60]!r}"
        )
    unit = (match[2] or "").strip()
    if unit not in UNITS:
        known = ", ".join(name for name in UNITS if name)
        raise LogError(
            f"{source}: {match[1]}: expected a unit of {known}, got {printable(unit)[:30]!r}"
        )
    return match[1], unit


def _number(cell: str, where: str, *, needed: bool) -> float:
    text = cell.strip()
    if not text or text.lower() == "nan":
        if needed:
            raise LogError(f"{where}: expected a time, got nothing")
        return math.nan
    try:
        value = float(text)
    except ValueError:
        raise LogError(f"{where}: expected a number, got {printable(text)[:40]!r}") from None
    if "_" in text or not abs(value) <= _LARGEST:
        raise LogError(f"{where}: expected a number up to {_LARGEST:g}, got {printable(text)[:40]}")
    return value


def _log(
    columns: dict[str, np.ndarray], units: dict[str, str], names: list[str], source: str
) -> Log:
    for name in names:
        if names.count(name) > 1:
            raise LogError(f"{source}: {name}: expected one channel of this name, got two")
    if "t" not in columns:
        raise LogError(f"{source}: expected a channel t [s], got {', '.join(names)[:80]}")
    if len({len(column) for column in columns.values()}) > 1:
        raise LogError(f"{source}: expected channels of one length, got several")
    scaled = {name: column * UNITS[units[name]][1] for name, column in columns.items()}
    t = scaled.pop("t")
    if UNITS[units["t"]][0] not in ("s", "") or not np.all(np.abs(t) <= _LARGEST):
        raise LogError(f"{source}: t: expected finite times [s]")
    si = {name: UNITS[units[name]][0] for name in scaled}
    return Log(t, scaled, si, source)
