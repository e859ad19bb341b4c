"""`dtcasadi sweep`: the report, its JSON and file, and what it says of wrong input."""

import json

import numpy as np
import pytest
from c_compilers import needs_cxx
from scene_texts import SMALL

from dtcasadi import cli


@pytest.fixture
def scene(tmp_path) -> str:
    file = tmp_path / "small.toml"
    file.write_text(SMALL + '\n[model]\nchart = "planar"\n')
    return str(file)


@needs_cxx
def test_a_sweep_with_a_failing_run(scene, tmp_path, capsys):
    output, record = tmp_path / "r", tmp_path / "r.json"
    words = ["sweep", scene, "-o", str(output), "--json", str(record), "--workers", "1"]
    words += ["--over", "discs[2].mass = 1, 2, -1", "--over", "payload=uniform(0,1,4)"]
    words += ["--step", "0.01", "--method", "heun", "--t-end", "0.05", "--save", "q.path"]
    assert cli.main(words) == 0
    text = capsys.readouterr().out
    assert "12 runs: 8 done, 4 failed, 0 lost" in text
    assert "4 x discs[2].mass: expected a positive number, got -1" in text
    assert f"{output}.npz" in text
    found = json.loads(record.read_text())
    assert found["schema"] == 1 and found["sweep"]["failed"] == 4
    with np.load(f"{output}.npz") as file:
        arrays = {name: file[name] for name in file.files}
    assert arrays["input_names"].tolist() == ["discs[2].mass", "payload"]
    assert arrays["q.path"].shape == (12, 6, 4)
    table = {row["column"]: row for row in found["sweep"]["table"]}
    good = arrays["status"] == 0
    assert table["tip z m"]["median"] == np.median(arrays["tip"][good, 2])


@pytest.mark.parametrize(
    "word, message",
    [
        ("pressure", "dtcasadi: --over: expected PATH=VALUES, got 'pressure'"),
        ("=1", "dtcasadi: --over: expected PATH=VALUES, got '=1'"),
        ("pressure=a", "dtcasadi: over pressure: expected lin(a,b,n), log(a,b,n)"),
    ],
)
def test_wrong_axes(scene, tmp_path, capsys, word, message):
    words = ["sweep", scene, "-o", str(tmp_path / "r.npz"), "--over", word]
    assert cli.main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(message)
    assert not (tmp_path / "r.npz").exists()


def test_a_path_twice(scene, tmp_path, capsys):
    words = ["sweep", scene, "-o", str(tmp_path / "r.npz"), "--over", "a=1", "--over", "a=2"]
    assert cli.main(words) == 2
    assert "--over: expected each path once, got a twice" in capsys.readouterr().err
