"""Whether a command's JSON holds what the command prints."""

import json
import re
from pathlib import Path

import numpy as np


def numbers(text: str) -> list[str]:
    """Numbers as they are printed, those in file names and words left out."""
    return re.findall(r"(?<![\w./-])[-+]?\d+\.?\d*(?:e[-+]?\d+)?(?![\w./]*\w)", text)


def values(record: object) -> list[float]:
    """Every number in a record, those inside its texts included."""
    if isinstance(record, bool) or record is None:
        return []
    if isinstance(record, int | float):
        return [float(record)]
    if isinstance(record, str):
        return [float(number) for number in numbers(record)]
    items = record.values() if isinstance(record, dict) else record
    return [value for item in items for value in values(item)]  # type: ignore[attr-defined]


def assert_json_holds(text: str, record: dict) -> None:
    """Every printed number is a rounded one of the record."""
    known = np.array(values(record))
    for number in numbers(text):
        mantissa = number.lower().partition("e")[0]
        digit = 10.0 ** -len(mantissa.partition(".")[2])
        scale = 10.0 ** float(number.lower().partition("e")[2] or 0)
        off = np.abs(known - float(number)).min()
        assert off <= 0.5001 * max(digit * scale, 5e-4 * abs(float(number))), f"{number} in {text}"


def read(path: Path) -> dict:
    """A JSON file in which nothing may be NaN."""

    def refuse(word: str) -> float:
        raise AssertionError(f"{word} is not JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
