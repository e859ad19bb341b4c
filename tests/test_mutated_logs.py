"""Mutated logs through the whole of `dtcasadi estimate`: a line that says where, or a result."""

import random
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from watched import WATCHED_AIR

import dtcasadi as dtc
from dtcasadi.cli import main
from dtcasadi.logs import Log
from dtcasadi.scene import parse_scene
from estimators import registry, report, runner, scenario
from estimators.truth import moved, recorded

SCENE = parse_scene(WATCHED_AIR.encode())


@cache
def good() -> Log:
    return recorded(SCENE, moved(SCENE, 0.1))


@cache
def discrete() -> dtc.DiscreteModel:
    return scenario.discrete_of(SCENE)


@pytest.fixture
def prepared(tmp_path, monkeypatch):
    """Scene, and log, on disk; models and filters are built once, long gaps are not waited for."""
    (tmp_path / "small.toml").write_text(WATCHED_AIR)
    good().save(tmp_path / "log.csv")
    columns = {f"{name} [{good().units[name]}]": v for name, v in good().channels.items()}
    np.savez(tmp_path / "log.npz", **{"t [s]": good().t, **columns})
    for name in ("ekf", "spv"):
        choice = registry.ESTIMATORS[name]
        made = choice.build(SCENE, discrete())
        ready = replace(choice, build=lambda scene, discrete, made=made: made)
        monkeypatch.setitem(registry.ESTIMATORS, name, ready)
    slope = report.Tip.of(SCENE).slope(discrete())
    monkeypatch.setattr(report.Tip, "slope", lambda tip, discrete: slope)
    monkeypatch.setattr(scenario, "discrete_of", lambda scene: discrete())
    monkeypatch.setattr(runner, "_LONGEST_GAP", 100)
    return tmp_path


def estimated(folder: Path, log: str, name: str, capsys) -> tuple[int, str, str]:
    """Exit code, result, and what was complained of."""
    code = main(["estimate", str(folder / "small.toml"), str(folder / log), "--estimator", name])
    return code, *capsys.readouterr()


PIECES = [b"", b",", b"\n", b'"', b"\0", b"nan", b"1e999", b"-", b"9", b"e9", b" [mm]", b"\r"]


def mutated(data: bytes, draw: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(draw.choice([1, 1, 1, 2, 6])):
        at = draw.randrange(len(changed) or 1)
        piece = draw.choice([*PIECES, b"%d" % draw.randrange(100), bytes([draw.randrange(256)])])
        changed[at : at + draw.randint(0, 3)] = piece
    return bytes(changed)


@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_a_line_or_a_result(prepared, capsys, count):
    draw, ends = random.Random(0), [0, 0]
    sources = {name: (prepared / name).read_bytes() for name in ("log.csv", "log.npz")}
    for _ in range(count):
        name = draw.choice(["log.csv", "log.csv", "log.npz"])
        (prepared / name).write_bytes(mutated(sources[name], draw))
        code, text, complaint = estimated(prepared, name, draw.choice(["ekf", "spv"]), capsys)
        ends[bool(code)] += 1
        if code:
            assert code == 2 and complaint.count("\n") == 1 and str(prepared / name) in complaint
        else:
            assert not complaint and re.search(r"\d+ steps; .* contact force", text, re.DOTALL)
            assert "nan" not in text
    assert min(ends) > count // 20


@pytest.mark.parametrize("cell", ["fast", "1e999", "0x1", "--1"])
def test_the_line_names_file_line_and_channel(prepared, capsys, cell):
    path = prepared / "log.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()]
    for column, head in enumerate(rows[0]):
        line = 2 + column % (len(rows) - 1)
        wrong = [list(row) for row in rows]
        wrong[line - 1][column] = cell
        path.write_text("\n".join(map(",".join, wrong)) + "\n")
        code, _, complaint = estimated(prepared, "log.csv", "ekf", capsys)
        assert code == 2
        assert f"{path}: line {line}: {head.split(' ')[0]}: expected a number" in complaint
