"""`dtcasadi bench work-precision`: errors against closed forms, frontiers, what it writes."""

import json
from dataclasses import replace

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.bench.balance import energy_defect, momentum_defect
from dtcasadi.bench.motions import model_of, pose_error, pose_of
from dtcasadi.bench.precision_reference import reference_of, solved
from dtcasadi.bench.precision_runs import Point, on_frontier
from dtcasadi.bench.work_precision import compared, kinds, marked
from dtcasadi.cli import main

SCENE = "stability/fold_back"


@pytest.fixture(scope="module")
def scene() -> dtc.Scene:
    return dtc.load_scene("stability/long_conservative")


def point(method: str, wall: float, error: float, **changes) -> Point:
    given = {"scene": "s", "chart": "planar", "n_discs": 4, "velocity_terms": "full"}
    given |= {"tolerance_or_step": 1e-3, "error_end": error, "total_error": error}
    given |= {"evaluations": 10, "steps": 5}
    return Point(method=method, wall_s=wall, error=error, **(given | changes))  # type: ignore[arg-type]


def test_a_pose_error_counts_places_and_turns():
    """A shift by a length is 1; a turn of the last disc by 0.1 rad is 0.1 arm times 0.1."""
    pose = np.vstack([np.zeros(3), 0.1 * np.eye(3)])
    assert pose_error(pose, pose + [0.0, 1.0, 0.0]) == pytest.approx(1.0)
    c, s = np.cos(0.1), np.sin(0.1)
    turned = pose @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    assert pose_error(pose, turned) == pytest.approx(0.2 * np.sin(0.05))


def test_poses_are_the_same_in_every_chart():
    whole = dtc.load_scene("seed_four_disc")
    poses = []
    for chart in ("planar", "paper"):
        model = whole.build(chart=chart)
        x = whole.x0(model)
        poses.append(pose_of(model, x[: model.n_q], model.theta0))
    assert pose_error(*poses) < 1e-15
    assert poses[0][0] == pytest.approx(
        np.array(model.poses(x[: model.n_q], model.theta0)[1])[:, -1] / 3
    )


def test_the_frontier():
    marks = on_frontier([(1, 1e-3), (2, 1e-3), (2, 1e-6), (1, 1e-2), (3, 1e-7), (3, 1e-5)])
    assert marks == [True, False, True, False, True, False]


def test_frontiers_of_a_model_and_of_all():
    rows = [point("auto", 2.0, 1e-6), point("LSODA", 3.0, 1e-5), point("rodas4", 1.0, 1e-3)]
    rows.append(point("auto", 0.5, 1e-8, velocity_terms="none", total_error=0.1))
    rows.append(point("auto", 0.7, 1e-9, velocity_terms="none", total_error=0.1))
    found = marked(rows)
    assert [row.on_frontier for row in found] == [True, False, True, True, True]
    assert [row.on_overall_frontier for row in found] == [True, False, True, True, False]


def test_levels_compare_on_the_first_model():
    rows = [point("auto", 2.0, 1e-6), point("rk4", 1.0, 1e-4), point("cvodes", 0.5, 1e-3)]
    rows.append(point("rodas4", 0.1, 1e-12, velocity_terms="none"))
    found = {row["error"]: row for row in compared(rows)}
    loose, tight, never = (found[level] for level in (1e-3, 1e-6, 1e-9))
    assert loose["ours"] == "rk4" and loose["others"] == "cvodes"
    assert loose["others_over_ours"] == 0.5 and loose["auto_over_best"] == 4.0
    assert tight["ours_s"] == 2.0 and tight["others"] is None and tight["auto_over_best"] == 1.0
    assert never["ours"] is None and never["auto_over_best"] is None


def test_errors_are_those_of_another_method(scene):
    """Of RK4 at half the step: 16 times smaller, as its order is 4."""
    short = replace(scene, t_end=5.0)
    model = model_of(short)
    reference = reference_of(short, model)
    assert reference.trusted == 5.0 and max(reference.gaps) < 1e-10
    errors = []
    for step in (0.02, 0.01):
        run = dtc.simulate(
            model, short.x0(model), t_end=5.0, method="rk4", step_s=step, pressure=0.0
        )
        times = run.t[::25]
        own = np.array([pose_of(model, q, model.theta0) for q in run.q[:, ::25].T])
        errors.append(max(map(pose_error, own, reference.motion.poses(times))))
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.2)
    loose = reference.errors(solved(short, model, "tsit5", 1e-4))
    tight = reference.errors(solved(short, model, "tsit5", 1e-8))
    assert 1e-7 < loose[0] < 1e-2 and tight[0] < 1e-3 * loose[0] and tight[1] <= tight[0]


def test_balances_close_with_the_tolerance(scene):
    short = replace(scene, t_end=2.0)
    model = model_of(short)
    defects = [
        (energy_defect(short, motion), momentum_defect(short, motion))
        for motion in (solved(short, model, "tsit5", rtol) for rtol in (1e-3, 1e-8))
    ]
    for loose, tight in zip(*defects, strict=True):
        assert loose is not None and tight is not None
        assert tight < 1e-6 and tight < 1e-2 * loose


def test_models_beside_the_scenes_own():
    spatial = [kind.label for kind in kinds(dtc.load_scene("tentacle"), ("auto",), own_model=False)]
    assert spatial[0] == "as given" and {"planar", "chart paper", "2 discs", "3 discs"} <= set(
        spatial
    )
    assert "velocity terms none" in spatial
    assert len(kinds(dtc.load_scene("tentacle"), ("auto",), own_model=True)) == 1


@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_command(tmp_path, whole):
    files = [f"--{kind}={tmp_path / f'chart.{kind}'}" for kind in ("json", "png")]
    words = ["bench", "work-precision", SCENE, "--methods", "auto", "tsit5", "DOP853"]
    assert main([*words, *files, *([] if whole else ["--own-model"])]) == 0
    record = json.loads((tmp_path / "chart.json").read_text())
    wanted = {"scene", "method", "chart", "n_discs", "velocity_terms", "tolerance_or_step"}
    wanted |= {"error", "wall_s", "evaluations", "on_frontier"}
    assert record["schema"] == 1 and wanted <= set(record["points"][0])
    terms = {row["velocity_terms"] for row in record["points"]} - {"static"}
    assert terms == ({"full", "paper", "none"} if whole else {"full"})
    assert any(row["on_frontier"] for row in record["points"])
    assert len(record["levels"]["rows"]) == 8 and record["references"]["as given"]["methods"]
    assert (tmp_path / "chart.png").stat().st_size > 30_000


def test_unknown_methods_are_one_line(capsys):
    assert main(["bench", "work-precision", "--methods", "magic"]) == 2
    assert "--methods: expected names of auto, " in capsys.readouterr().err


@pytest.mark.slow
def test_references_agree_through_a_contact():
    """Impact, pressing and leaving a soft wall; what a looser run is off comes from there."""
    wall = dtc.load_scene("stability/contact_wall")
    model = model_of(wall)
    reference = reference_of(wall, model)
    assert reference.trusted == wall.t_end and len(set(reference.names)) == 2
    touching = dtc.simulate(wall).contacts.t
    assert touching.min() < 0.1 * wall.t_end and touching.max() > 0.5 * wall.t_end
    loose, tight = (
        reference.errors(solved(wall, model, "tsit5", rtol))[0] for rtol in (1e-4, 1e-8)
    )
    assert tight < 1e-2 * loose and tight < 1e-5
