"""`dtcasadi bench accuracy`: the anchors, their references, orders and shares."""

import json
import math
from functools import cache

import matplotlib.image
import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.bench import references
from dtcasadi.bench.accuracy import entry, measured, observed_order
from dtcasadi.bench.accuracy_picture import picture
from dtcasadi.bench.columns import Column, beam_references
from dtcasadi.bench.exact import exact_values
from dtcasadi.cli import main
from dtcasadi.robot import Robot
from dtcasadi.statics.search import virtual_search

# Published or exact, to the digits given.
KNOWN = {
    "tip_load_0_5": (0.16214, 0.01592, 0.24453),
    "tip_load_1": (0.30172, 0.05643, 0.46135),
    "tip_load_2": (0.49346, 0.16064, 0.78175),
    "tip_load_5": (0.71379, 0.38763, 1.21537),
    "tip_load_10": (0.81061, 0.55500, 1.43029),
    "heavy_elastica_1": (0.123471, 0.008754, 0.165116),
    "heavy_elastica_5": (0.495905, 0.153343, 0.697005),
    "heavy_elastica_10": (0.700200, 0.343646, 1.052643),
}
SINGLE = {"euler": 2.467401, "greenhill": 7.837347, "beck": 20.05, "beck_damped": 10.9}
BETA = (1.875104, 4.694091, 7.854757)
# Error times (n_discs - 1)^2 / 100 as found with another discretization's code, near 8 segments.
CONSTANTS = {
    "euler": 0.0065 * 64,
    "heavy_elastica_5_drop": 0.00045 * 49,
    "greenhill": 0.0083 * 49,
    "cantilever_f1": -0.0054 * 49,
    "beck": 0.061 * 49,
    "tip_load_1_drop": -0.00092 * 64 / 0.30172,
}
# Modes and loads so high that eight discs are too few to see the order.
COARSE = {"cantilever_f3", "hanging_chain_3", "heavy_elastica_10_drop"}


@cache
def coarse() -> dict:
    return measured((8, 16), with_cost=False)[0]


def test_references_are_the_published_numbers():
    found = beam_references()
    for name, values in KNOWN.items():
        for part, value in zip(("drop", "shortening", "angle"), values, strict=True):
            assert found[f"{name}_{part}"] == pytest.approx(value, abs=0.6e-5)
    for name, value in SINGLE.items():
        assert found[name] == pytest.approx(value, abs=0.06 if name == "beck_damped" else 1e-3)
    for k, beta in enumerate(BETA, 1):
        assert math.sqrt(found[f"cantilever_f{k}"]) == pytest.approx(beta, abs=5e-7)
    assert references.hanging_chain(3) == pytest.approx([1.202413, 2.760039, 4.326864], abs=5e-7)
    assert references.pendulums(3) == pytest.approx([0.415775, 2.294280, 6.289945], abs=5e-7)
    assert references.large_pendulum(math.pi / 2) == pytest.approx(1.1803406, abs=5e-8)


def test_orders_are_two():
    for name, anchor in coarse().items():
        if anchor["order"] is not None and name not in COARSE:
            assert anchor["order"] == pytest.approx(2.0, abs=0.2), name


@pytest.mark.parametrize("name", CONSTANTS)
def test_errors_are_the_expected_ones(name):
    """Euler's is (tan x / x)^2 - 1 with x = pi / (4 segments); the others were fitted."""
    for n_discs, row in coarse()[name]["by_discs"].items():
        scaled = row["relative_error"] * (int(n_discs) - 1) ** 2
        assert scaled == pytest.approx(CONSTANTS[name], rel=0.1)
        if name == "euler":
            x = math.pi / (4 * (int(n_discs) - 1))
            exact = (math.tan(x) / x) ** 2 - 1
            assert row["relative_error"] == pytest.approx(exact, rel=2e-3)


def test_shear_has_a_small_part_in_the_errors():
    for name, anchor in coarse().items():
        for row in anchor["by_discs"].values():
            if anchor["order"] is not None:
                share = abs(row["timoshenko_share"] / row["relative_error"])
                # Drop and shortening of the stiffest beam hardly have an error.
                assert share < (0.2 if name.startswith("heavy_elastica_1_") else 0.03), name
    # Of a small drop the share is 3 EI / (GA L^2).
    share = coarse()["tip_load_0_5_drop"]["by_discs"]["8"]["timoshenko_share"]
    assert share == pytest.approx(3 / 1e4 / 49, rel=0.1)


def test_exact_anchors_are_exact():
    found = exact_values()
    assert found["n_pendulum_3"].reference == pytest.approx(0.415775, abs=5e-7)
    for name, (reference, _, value) in found.items():
        # Integration at 1e-11; the top is bisected to 1e-10.
        assert value == pytest.approx(reference, rel=1e-9), name


def test_damped_beck_is_where_a_damped_column_flutters():
    """The limit of small damping against a column of this damping, followed to its flutter.

    So slow a growth counts only where it takes more than 1e-10 of the stiffest springs to stop it:
    1e-4 of the load beyond its onset.
    """
    column = Column(4)
    rod = Robot.from_rod(*(1.0, 1.0, column.shear, 0.1, 1.0, 4), retardation_time=1e-4, gravity=0.0)
    pressed = dtc.Chamber((1, 4), areas=np.ones(4))
    damped = dtc.build(
        Robot(rod.discs, rod.threads, rod.springs, (pressed,), gravity=0.0), chart="planar"
    )
    virtual_search(damped)
    path = dtc.branch(damped, "pressure", -10.0, -14.0, points=4)
    assert [event.kind for event in path.events] == ["flutter"]
    assert -path.events[0].s == pytest.approx(column.values()["beck_damped"], rel=5e-4)


@pytest.mark.slow
def test_all_sizes():
    """Orders of everything from 32 to 64 discs, and the figure asked for."""
    anchors, _ = measured((4, 8, 16, 32, 64), with_cost=False)
    for name, anchor in anchors.items():
        if anchor["order"] is not None:
            assert anchor["order"] == pytest.approx(2.0, abs=0.1), name
    heavy = anchors["heavy_elastica_5_drop"]["by_discs"]["32"]
    assert abs(heavy["value"] / 0.495905 - 1) < 2e-4


def test_an_entry():
    found = entry(2.0, {4: 2.2, 8: 2.0 + 0.2 * (3 / 7) ** 2}, 0.9)
    assert found["order"] == pytest.approx(2.0)
    assert found["by_discs"]["4"] == {
        "value": 2.2,
        "relative_error": pytest.approx(0.1),
        "timoshenko_share": pytest.approx(0.1),
    }
    assert observed_order({4: 0.1}) is None
    assert observed_order({4: 1e-12, 8: 1e-13}) is None


def test_the_command_writes_json_and_picture(tmp_path, capsys):
    target, drawn = tmp_path / "a.json", tmp_path / "a.png"
    files = ["--json", str(target), "--png", str(drawn)]
    assert main(["bench", "accuracy", "--sizes", "4", "8", "--no-cost", *files]) == 0
    record = json.loads(target.read_text())
    assert record["schema"] == 1
    names = {"heavy_elastica_5_drop", "tip_load_1_drop", "euler", "greenhill", "beck"}
    names |= {"cantilever_f1", "hanging_chain_1", "n_pendulum_3"}
    assert names <= record["anchors"].keys()
    for anchor in record["anchors"].values():
        assert {"reference", "order", "by_discs"} == anchor.keys()
        for row in anchor["by_discs"].values():
            assert {"value", "relative_error"} <= row.keys()
    assert "heavy_elastica_5_drop" in capsys.readouterr().out
    assert matplotlib.image.imread(drawn).shape[1] > 800


def test_the_picture_shows_cost_where_it_was_measured():
    cost = {8: {"ode_us": 1.0}, 16: {"ode_us": 3.0}}
    figure = picture(coarse(), cost, None)
    assert [axes.get_xlabel() for axes in figure.axes][1].startswith("one call")
    assert len(picture(coarse(), {8: {}, 16: {}}, None).axes) == 1


def test_wrong_sizes_are_refused(capsys):
    assert main(["bench", "accuracy", "--sizes", "3"]) == 2
    assert "from 4 to 256" in capsys.readouterr().err
