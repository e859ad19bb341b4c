"""Recorded logs: units, gaps, and one clear line for every fault."""

import random
from typing import Any

import numpy as np
import pytest

from dtcasadi.errors import LogError
from dtcasadi.logs import parse_csv, read_log

GOOD = "t [ms],command1 [kPa],tip.x [mm],chip.gx [deg/s]\n0,1,2,\n5,,nan,180\n"


def test_units_become_si_and_gaps_nan():
    log = parse_csv(GOOD.encode())
    np.testing.assert_array_equal(log.t, [0, 0.005])
    np.testing.assert_array_equal(log.channels["command1"], [1000, np.nan])
    np.testing.assert_array_equal(log.channels["tip.x"], [0.002, np.nan])
    np.testing.assert_allclose(log.channels["chip.gx"], [np.nan, np.pi], rtol=1e-15)
    assert log.units == {"command1": "Pa", "tip.x": "m", "chip.gx": "rad/s"}


def test_a_log_written_is_read_back(tmp_path):
    log = parse_csv(GOOD.encode())
    path = log.save(tmp_path / "log.csv")
    again = read_log(path)
    np.testing.assert_array_equal(again.t, log.t)
    for name, values in log.channels.items():
        np.testing.assert_array_equal(again.channels[name], values)
    columns: dict[str, Any] = {f"{n} [{log.units[n]}]": v for n, v in log.channels.items()}
    columns["t [s]"] = log.t
    save: Any = np.savez  # whose stub takes names of arrays for options
    save(tmp_path / "log.npz", **columns)
    again = read_log(tmp_path / "log.npz")
    np.testing.assert_array_equal(again.channels["tip.x"], log.channels["tip.x"])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (GOOD.replace("180", "fast"), r"line 3: chip.gx: expected a number, got 'fast'"),
        (GOOD.replace("180", "1e40"), r"line 3: chip.gx: expected a number up to 1e\+30"),
        (GOOD.replace("180", "inf"), r"line 3: chip.gx: expected a number up to 1e\+30"),
        (GOOD.replace("5,,nan", ",,nan"), "line 3: t: expected a time, got nothing"),
        (GOOD.replace("nan,180", "nan"), "line 3: expected 4 cells, got 3"),
        (GOOD.replace("kPa", "psi"), "command1: expected a unit of s, ms, .*, got 'psi'"),
        (GOOD.replace("t [ms]", "time [ms]"), "expected a channel t"),
        (GOOD.replace("t [ms]", "t [mm]"), "t: expected finite times"),
        (GOOD.replace("tip.x", "command1"), "command1: expected one channel of this name, got two"),
        (GOOD.replace("tip.x", "../x"), r"header: expected names such as t \[s\]"),
        ("", "expected a header and at least one row"),
    ],
)
def test_faults_name_line_and_channel(text, line):
    with pytest.raises(LogError, match=line):
        parse_csv(text.encode())


def test_channels_are_taken_together():
    log = parse_csv(GOOD.encode())
    assert log.columns([("nose.x", "m")]) is None
    with pytest.raises(LogError, match="tip.y: expected a channel beside tip.x"):
        log.columns([("tip.x", "m"), ("tip.y", "m")])
    with pytest.raises(LogError, match=r"tip.x: expected a unit of \[rad\], got \[m\]"):
        log.columns([("tip.x", "rad")])


def mutate(count: int, folder) -> None:
    draw = random.Random(0)
    path = folder / "good.npz"
    save: Any = np.savez
    save(path, **{"t [s]": np.arange(3.0), "tip.x [mm]": np.ones(3)})
    sources = {".csv": GOOD.encode(), ".npz": path.read_bytes()}
    for k in range(count):
        suffix, data = draw.choice(list(sources.items()))
        changed = bytearray(data)
        for _ in range(draw.randint(1, 6)):
            at = draw.randrange(len(changed) or 1)
            piece = draw.choice([b"", b",", b"\n", b'"', b"\0", b"nan", b"1e999", bytes([k % 256])])
            changed[at : at + draw.randint(0, 3)] = piece
        target = folder / f"log{suffix}"
        target.write_bytes(changed)
        try:
            log = read_log(target)
        except LogError as error:
            assert "\n" not in str(error)
        else:
            assert np.all(np.isfinite(log.t))


def test_mutated_logs_give_a_line_or_a_log(tmp_path):
    mutate(200, tmp_path)


@pytest.mark.slow
def test_ten_thousand_mutated_logs(tmp_path):
    mutate(10_000, tmp_path)


def test_files_that_cannot_be_read(tmp_path):
    for name in ("none.csv", "\0.csv", "."):
        with pytest.raises(LogError, match="expected a readable"):
            read_log(tmp_path / name if name != "." else tmp_path)
