"""`dtcasadi bench mpc` on a cart in place of its robots: what is written, and when."""

import argparse
import json
from types import SimpleNamespace

import numpy as np
import pytest
from c_compilers import needs_compiler
from control_toy import cart
from legible import assert_legible

from dtcasadi.cli.common import Report
from dtcasadi.control import Control
from dtcasadi.profile import Profile
from ocp import Effort, Limits, Problem, Tracking, bench, frontier, stages
from ocp.closed_loop import Plant
from ocp.scenario import Experiment

FIGURES = {
    "median_ms",
    "p99_ms",
    "tracking_rms_over_length",
    "steady_error_over_length",
    "cost_over_converged",
    "violations",
}


def toy(name="planar", estimators=None, **changes):
    """The cart is told where it is, and its model is exact."""
    track = Tracking("place", lambda t: float(t >= 0.5), weight=10.0)
    problem = Problem(10, track, Effort(0.05), Limits(-4.0, 4.0, 20.0))
    posed = stages(cart(0.1), problem)
    plant = Plant(cart(0.05), np.zeros(2), np.zeros(1), seed=None)
    asked = Profile(np.array([0, 0.5, 0.55, 6.0]), np.array([[0.0], [0], [1], [1]]), "linear")
    control = Control(0.1, 10, ("place",), asked)
    scene = SimpleNamespace(control=control, t_end=6.0, name="cart")
    found = Experiment(scene, posed, plant, 2.0, cart(0.05))
    return bench.Case(name, scene, found, None)


@needs_compiler
def test_every_case_and_baseline_is_written_as_it_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "case_of", toy)
    monkeypatch.setattr(bench, "BASELINES", ("pi", "static", "rti_same_span", "sqpmethod_rti"))
    parser = argparse.ArgumentParser()
    bench.add_arguments(parser)
    words = ["--cases", "planar", "regulation", "--steps", "50", "--converged", "2"]
    report = Report("bench mpc", str(tmp_path / "mpc.json"))
    seen = []
    write = report.write_json
    monkeypatch.setattr(report, "write_json", lambda: (write(), seen.append(len(report.record))))
    bench.run(parser.parse_args([*words, "--faults", "100"]), report, estimators=lambda s: None)
    record = json.loads((tmp_path / "mpc.json").read_text())
    assert len(seen) == 6
    assert set(record["cases"]) == {"planar", "regulation"}
    for figures in (*record["cases"].values(), *record["baselines"].values()):
        assert figures.keys() >= FIGURES and figures["violations"] == 0
    # The model is linear: one iteration is the solution, up to the solver's own tolerance.
    assert record["cases"]["planar"]["cost_over_converged"] == pytest.approx(1.0, abs=1e-4)
    assert record["baselines"]["rti_same_span"]["span_s"] == 2.0
    assert record["baselines"]["static"]["cost_over_converged"] > 1.0
    assert report.record["contract"] == {"steps": 100, "broken": 0}


def test_the_chart_is_legible(tmp_path):
    points = [
        (setting, 0.1 * 2**k, 3.0 + (k - 3) ** 2 / 20)
        for k, setting in enumerate(frontier.SETTINGS)
    ]
    frontier.draw(points, tmp_path / "chart.png")
    assert_legible(frontier.draw(points, tmp_path / "chart.svg"))
