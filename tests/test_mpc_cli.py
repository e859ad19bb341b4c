"""`dtcasadi mpc`, pictures and film of closed loops."""

import json

import numpy as np
import pytest
from control_toy import cart
from legible import assert_legible
from test_control_scene import TEXT

from dtcasadi.cli import main
from ocp import Effort, Limits, Problem, Tracking, stages
from ocp.baselines import PIControl
from ocp.closed_loop import Plant, closed_loop
from ocp.plots import picture

SMALL = TEXT.replace("truth_discs = 4", "truth_stiffness = 1.1").replace("t_end = 1", "t_end = 1.5")


@pytest.mark.slow
def test_a_scene_is_controlled_said_drawn_and_filmed(tmp_path, capsys):
    scene = tmp_path / "small.toml"
    scene.write_text(SMALL.split("[[control.keep_out]]")[0])
    targets = {key: str(tmp_path / f"loop.{key}") for key in ("json", "png", "gif")}
    words = ["mpc", str(scene), "--json", targets["json"], "--png", targets["png"]]
    assert main([*words, "--animate", targets["gif"]]) == 0
    said = capsys.readouterr().out
    assert "steady error" in said and "limits violated in 0 calls" in said
    record = json.loads((tmp_path / "loop.json").read_text())
    assert record["schema"] == 1 and record["loop"]["violations"] == 0
    assert record["loop"]["rests"][0]["steady"] < 1.0  # degrees, from a cold filter
    assert sum(record["loop"]["statuses"].values()) == record["loop"]["calls"] == 31
    assert (tmp_path / "loop.png").stat().st_size > 20_000
    assert (tmp_path / "loop.gif").read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["seed_four_disc"], "expected a scene with [control], got one without"),
        (["control/bend", "--png", "/no/such/folder/x.png"], "no such folder"),
        (["control/bend", "--animate", "film.mov"], ".gif"),
        (["control/bend", "--controller", "fuzzy"], "invalid choice: 'fuzzy'"),
    ],
)
def test_wrong_words_give_one_line(words, text, capsys):
    assert main(["mpc", *words]) == 2
    assert text in capsys.readouterr().err


def test_a_picture_shows_every_output_command_and_limit(tmp_path):
    tracking = (
        Tracking("both", lambda t: (np.sin(t), np.cos(t)), channels=(1,)),
        Tracking("place"),
    )
    problem = stages(cart(), Problem(5, tracking, Effort(0.1), Limits(-3, 3, 20)))
    plant = Plant(cart(0.05), np.zeros(2), np.zeros(1), seed=None)
    tracking = (Tracking("both", np.sin, channels=(1,)), Tracking("place"))
    problem = stages(cart(), Problem(5, tracking, Effort(0.1), Limits(-3, 3, 20)))
    loop = closed_loop(PIControl(problem, np.zeros(1)), plant, problem, t_end=2.0)
    assert_legible(picture(loop, tmp_path / "loop.svg", title="a cart"))
    text = (tmp_path / "loop.svg").read_text()
    for word in ("both y0", "place y0", "pressure [kPa]", "call [ms]", "time [s]", "a cart"):
        assert f"<!-- {word} -->" in text, word
