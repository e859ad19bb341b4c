"""`dtcasadi statics` and `dtcasadi bench statics`: what they print and write."""

from pathlib import Path

import pytest
from printed import assert_json_holds, read

from dtcasadi import cli

SCENE = "seed_four_disc"


def test_one_equilibrium(tmp_path, capsys):
    words = ["statics", SCENE, "--png", str(tmp_path / "modes.png")]
    assert cli.main([*words, "--json", str(tmp_path / "s.json")]) == 0
    text, record = capsys.readouterr().out, read(tmp_path / "s.json")
    assert_json_holds(text.partition("\nfiles\n")[0], record)
    assert record["schema"] == 1 and record["command"] == "statics"
    found = record["equilibrium"]
    assert found["success"] and found["stable"] and found["pressure_Pa"] == [12.0]
    # The scene's rest pose, in formulas known to four digits.
    assert found["q"] == pytest.approx(
        [-1.2107, 1.2308, -1.0029, 1.1753, -0.5933, 1.5081], abs=1e-4
    )
    assert found["tension_N"] > 0 and len(record["modes"]["eigenvalues_real"]) == 12
    assert Path(record["files"][0]).stat().st_size > 1000


def test_no_equilibrium_ends_with_1_and_no_pose(tmp_path, capsys):
    words = ["statics", SCENE, "--pressure", "20", "--json", str(tmp_path / "s.json")]
    assert cli.main([*words, "--png", str(tmp_path / "modes.png")]) == 1
    assert "no equilibrium found" in capsys.readouterr().out
    found = read(tmp_path / "s.json")["equilibrium"]
    assert not found["success"] and "q" not in found
    assert not (tmp_path / "modes.png").exists()


def test_a_branch(tmp_path, capsys):
    words = ["statics", SCENE, "--from", "1", "--to", "20", "--points", "30"]
    words += ["--png", str(tmp_path / "d.png"), "--json", str(tmp_path / "s.json")]
    assert cli.main(words) == 0
    text, record = capsys.readouterr().out, read(tmp_path / "s.json")
    assert_json_holds(text.partition("\nfiles\n")[0], record)
    branch = record["branch"]
    assert [event["kind"] for event in branch["events"]] == ["flutter", "limit"]
    assert len(branch["s"]) == len(branch["q"]) == len(branch["tip_m"]) == len(branch["kind"])
    assert branch["success"] and max(branch["s"]) < 14.5


def test_a_branch_that_ends_at_a_limit_point(capsys):
    words = ["statics", SCENE, "--from", "13", "--to", "20", "--points", "20", "--steps"]
    assert cli.main(words) == 1
    assert "method='arc' passes limit points" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["--parameter", "springs.stiffness", "--from", "1", "--to", "1.2"],
        ["--parameter", "wrench[2]", "--wrench", "4", "--from", "0", "--to", "1"],
    ],
)
def test_other_parameters(words, capsys):
    assert cli.main(["statics", SCENE, *words, "--points", "3"]) == 0
    assert f"equilibria against {words[1]}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--from", "1"], "expected both --from and --to, or neither"),
        (["--pressure", "1", "2"], "pressure: expected finite numbers of shape (1), got"),
        (["--parameter", "presure", "--from", "0", "--to", "1"], "parameters: expected paths"),
        (["--png", "a.bmp"], "a.bmp: expected a name ending in"),
    ],
)
def test_bad_input_is_one_line_and_2(words, line, capsys):
    assert cli.main(["statics", SCENE, *words]) == 2
    (printed,) = capsys.readouterr().err.splitlines()
    assert line in printed


def test_bench(tmp_path, capsys):
    words = ["bench", "statics", "--repeats", "1", "--json", str(tmp_path / "b.json")]
    assert cli.main(words) == 0
    record = read(tmp_path / "b.json")
    assert_json_holds(capsys.readouterr().out, record)
    rows = record["statics"]["timings"]
    assert [(row["chart"], row["n_q"]) for row in rows] == [("planar", 6), ("cardan", 15)]
    assert all(0 < row["iterations"] < 20 and row["search_us"] > 0 for row in rows)
