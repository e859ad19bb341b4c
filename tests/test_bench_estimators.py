"""`dtcasadi bench estimators`, and the case in which the filter's model is wrong."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dtcasadi.cli import main
from estimators import benchmark, timing
from estimators.registry import ESTIMATORS
from estimators.timing import Case

FIGURES = {"us_per_step", "tip_rmse_over_length", "force_error", "nees_in_band", "convergence_s"}
NAMES = {"ekf", "ukf", "mhe", "smoother", "spv"}
TIMES = {"us_per_step", "linearization", "covariance", "sensors"}
PUBLISHED = Path(__file__).parents[1] / "benchmarks/results/estimators.json"


class Quick:
    """A stand-in for what takes a minute to compile and time; the command asks it for the same."""

    def __init__(self, chart: str, **options: object):
        self.x = np.zeros(8)

    def ekf_us(self) -> dict[str, float]:
        return {"predict": 1.0, "update": 1.0, **dict.fromkeys(TIMES, 2.0)}

    def ukf_us(self) -> float:
        return 20.0

    def mhe_us(self) -> float:
        return 200.0

    def smoother_us(self) -> float:
        return 100.0

    def spv_us(self) -> float:
        return 0.5

    def filterpy_us(self) -> float | None:
        return None


def checked(record: dict[str, Any]) -> None:
    """Every figure of every estimator is there, and is a number where it can be one."""
    assert record["schema"] == 1 and record["command"] == "bench"
    assert TIMES | {"states", "with_wrench_us", "midpoint_exact_us"} <= set(record["time"])
    assert set(record["estimators"]) == NAMES
    for name, row in record["estimators"].items():
        assert set(row) == FIGURES and row["us_per_step"] > 0
        assert row["tip_rmse_over_length"] > 0 and row["force_error"] > 0
        # Smoothed errors of one run are no independent draws.
        assert row["nees_in_band"] is None if name == "smoother" else 0 <= row["nees_in_band"] <= 1
        assert row["convergence_s"] is None or row["convergence_s"] >= 0
    assert record["filterpy_us_per_step"] is None or record["filterpy_us_per_step"] > 0


def written(folder: Path, monkeypatch: pytest.MonkeyPatch, *words: str) -> dict[str, Any]:
    """What the command writes, its errors given; the picture is there."""
    errors = {"tip_rmse_over_length": 0.01, "force_error": 0.02}
    monkeypatch.setattr(benchmark, "mismatch", lambda choices: dict.fromkeys(choices, errors))
    monkeypatch.setattr(benchmark, "convergence", lambda choices, chart: dict.fromkeys(choices))
    files = [str(folder / name) for name in ("b.json", "b.png")]
    assert main(["bench", "estimators", *words, "--json", files[0], "--png", files[1]]) == 0
    assert (folder / "b.png").stat().st_size > 5000
    return json.loads((folder / "b.json").read_text())


def test_the_record_has_the_figures_of_every_estimator(tmp_path, monkeypatch, capsys):
    shares = dict.fromkeys(NAMES - {"smoother"}, 0.95)
    monkeypatch.setattr(benchmark, "consistency", lambda choices, runs, steps: shares)
    monkeypatch.setattr(timing, "Case", Quick)
    record = written(tmp_path, monkeypatch)
    checked(record)
    one = written(tmp_path, monkeypatch, "--estimator", "ukf")["estimators"]
    assert one == {"ukf": record["estimators"]["ukf"]}
    assert record["estimators"]["smoother"]["us_per_step"] == 102.0
    printed = capsys.readouterr().out
    assert all(name in printed for name in NAMES)


def test_an_unknown_estimator_is_one_line(capsys):
    assert main(["bench", "estimators", "--estimator", "magic"]) == 2
    assert "estimator: expected one of ekf, " in capsys.readouterr().err


def test_the_published_record_is_of_this_form():
    checked(json.loads(PUBLISHED.read_text()))


@pytest.mark.slow
def test_the_figures_are_measured(tmp_path, monkeypatch):
    """The same with filters that are built, timed and run."""
    words = ("--chart", "planar", "--runs", "1", "--steps", "4")
    checked(written(tmp_path, monkeypatch, *words))


def test_the_timed_filter_works():
    """What is timed is a filter that updates, not one that failed."""
    case = Case("planar")
    ekf = case.ekf()
    est = ekf.update(ekf.predict(ekf.start, case.u), case.y, case.names, case.u)
    assert not est.failure and est.used == 12
    # At rest with the readings of that place, where it stays.
    assert abs(est.x - case.x).max() < 1e-6


@pytest.mark.slow
def test_all_stay_near_a_robot_that_is_another_than_theirs():
    """8 discs, 15 % stiffer, hysteresis, 1 % of the samples lost, against 4 discs."""
    found = benchmark.mismatch(ESTIMATORS)
    assert set(found) == set(ESTIMATORS)
    for errors in found.values():
        assert errors["tip_rmse_over_length"] < 0.03
