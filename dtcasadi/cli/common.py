"""What the commands share: arguments, the report on screen and as JSON, errors as lines."""

import argparse
import errno
import json
import math
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

SCHEMA = 1
FAILED, BAD_INPUT, INTERRUPTED = 1, 2, 130


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line each and that takes no abbreviations."""

    def __init__(self, **options: Any):
        super().__init__(**{"allow_abbrev": False, **options})

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and end with exit code 2."""
        line = " ".join(message.split())
        self.exit(BAD_INPUT, f"{self.prog}: {line} (see {self.prog} --help)\n")


class Report:
    """What a command has to say: printed as it comes, and written as JSON at the end.

    Every printed value goes through `line`, which records it under the current section.

    Attributes:
        record: what the JSON file will hold.
        files: what the command has written so far.
    """

    def __init__(self, command: str, json_path: str | None = None):
        self.record: dict[str, Any] = {"schema": SCHEMA, "command": command}
        self.files: list[Path] = []
        self._json = Path(json_path) if json_path else None
        self._section = self.record

    def check(self) -> None:
        """Raise OSError now if the JSON file could not be written later."""
        if self._json:
            check_target(self._json)

    def section(self, key: str, title: str) -> None:
        """Start a section of the text and of the record."""
        self._section = self.record.setdefault(key, {})
        print(f"\n{title}", flush=True)

    def line(self, template: str, **values: Any) -> None:
        """Print a line and record the values in it.

        Args:
            template: as of `str.format`, with the names of the values.
            values: numbers, words or None.
        """
        self._section.update(values)
        print("  " + template.format(**values), flush=True)

    def row(self, table: str, template: str, **values: Any) -> None:
        """Print a row of a table and record its values at the end of the list of that name.

        Numbers appear with three digits, None as a dash; the template gives the widths.
        """
        self._section.setdefault(table, []).append(values)
        print("  " + template.format(**{k: _cell(v) for k, v in values.items()}), flush=True)

    def entry(self, name: str, template: str, values: dict[str, Any]) -> None:
        """Print a row that starts with a name, and record its values under it."""
        self._section[name] = values
        cells = {key: _cell(value) for key, value in values.items()}
        print("  " + template.format(name=name, **cells), flush=True)

    def note(self, **values: Any) -> None:
        """Record values without printing them."""
        self._section.update(values)

    def wrote(self, path: Path) -> None:
        """Remember a file that is complete."""
        self.files.append(path)

    def list_files(self) -> None:
        """Print and record the files written so far."""
        self.record["files"] = [str(path) for path in self.files]
        if self.files:
            print("\nfiles")
        for path in self.files:
            print(f"  {path}")

    def write_json(self) -> None:
        """Write the record, whole or not at all, if a file was asked for."""
        if self._json:
            write_json(self._json, self.record)
            if self._json not in self.files:
                self.wrote(self._json)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"
    return str(value)


def write_json(path: Path, record: Any) -> None:
    """Write a record as JSON; what JSON has no number for becomes null.

    Raises:
        OSError: the file cannot be written; an older one is left as it was.
    """
    from ..files import written

    text = json.dumps(_plain(record), indent=1, allow_nan=False, ensure_ascii=False)
    with written(path) as file:
        file.write(text.encode("utf-8", "backslashreplace") + b"\n")


def _plain(value: Any) -> Any:
    """The value in types that JSON has."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # NumPy's arrays and numbers
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def check_target(path: Path) -> Path:
    """The path, if a file can be written there.

    Raises:
        OSError: its folder is missing or not writable, or it is a folder itself.
    """
    folder = path.parent
    if not folder.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, "the folder is not writable", str(folder))
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "expected a file, got a folder", str(path))
    return path


def made_folder(path: Path) -> Path:
    """The folder, created with those above it where missing, and writable.

    Raises:
        OSError: it cannot be created, is a file, or is not writable.
    """
    if path.exists() and not path.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "expected a folder, got a file", str(path))
    path.mkdir(parents=True, exist_ok=True)
    check_target(path / "any")
    return path


@contextmanager
def phase(report: Report, name: str, template: str) -> Iterator[None]:
    """Time a block and say so in the section `phases`; the template's value is `seconds`."""
    start = time.perf_counter()
    yield
    seconds = time.perf_counter() - start
    report.record.setdefault("phases", {})[name] = seconds
    print(f"  {template.format(seconds=seconds)}", flush=True)


def guarded(run: Callable[..., int | None], options: Any, report: Report) -> int:
    """Run a command, turning errors, warnings and interrupts into lines and an exit code."""
    from ..errors import DtcasadiError

    with warnings.catch_warnings():
        warnings.showwarning = _one_line
        try:
            report.check()
            code = run(options, report) or 0
            report.write_json()
        except DtcasadiError as error:
            _complain(str(error))
        except BrokenPipeError:
            # Whoever read the output has gone, as `head` does; nobody is left to tell.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return FAILED
        except OSError as error:
            _complain(_reason(error))
        except KeyboardInterrupt:
            kept = ", ".join(str(path) for path in report.files) or "nothing was written"
            print(f"dtcasadi: interrupted; kept: {kept}", file=sys.stderr)
            return INTERRUPTED
        else:
            return code
    return BAD_INPUT


def _complain(text: str) -> None:
    for line in text.splitlines():
        print(f"dtcasadi: {line}", file=sys.stderr)


def _reason(error: OSError) -> str:
    """An operating system's error as one line."""
    reason = (error.strerror or str(error) or type(error).__name__).lower()
    return f"{error.filename}: {reason}" if error.filename else reason


def _one_line(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"dtcasadi: {' '.join(str(message).split())}", file=sys.stderr)
