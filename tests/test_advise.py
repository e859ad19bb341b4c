"""dtcasadi.advise: the promise against `simulate`, planarity, files, what it refuses."""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from advised import distance_over_range, tip_path, true_error, tube
from c_compilers import needs_compiler
from swept import scene_of

import dtcasadi as dtc
from dtcasadi import cli
from dtcasadi.advise import planarity
from dtcasadi.advise.lab import Lab
from dtcasadi.advise.reference import SHARE
from dtcasadi.advise.search import Search
from dtcasadi.errors import AdviseError
from dtcasadi.statics.search import virtual_search

KEYS = ["n_discs", "chart", "velocity_terms", "dynamic", "method", "step_s"]


def plane_of(scene: dtc.Scene):
    return planarity(scene, scene.build(chart="cardan"))


def with_force(force) -> dtc.Scene:
    scene = scene_of()
    return replace(scene, robot=replace(scene.robot, forces=(force,)))


def test_a_symmetric_scene_is_planar():
    found = plane_of(scene_of())
    assert found.planar and found.largest < 1e-12
    assert "A payload or a load beside the plane" in found.sentence()
    assert plane_of(with_force(dtc.Payload(2, 1.0, np.array([0.0, 0.5, 0.2])))).planar


@pytest.mark.parametrize(
    "force",
    [
        dtc.Payload(2, 1.0, np.array([0.3, 0.0, 0.0])),
        dtc.PointLoad(2, 1.0, np.array([1.0, 0.0, 0.0])),
        dtc.Couple(2, 1.0, np.array([0.0, 1.0, 0.0])),
        dtc.PointLoad(2, 1.0, np.array([0.0, 1.0, 0.0]), np.array([0.2, 0.0, 0.0])),
    ],
)
def test_loads_beside_the_plane(force):
    found = plane_of(with_force(force))
    assert not found.planar and found.largest > 1e-4
    assert found.sentence().endswith("a force or a chamber acts beside the plane")


def test_what_else_breaks_a_plane():
    scene = scene_of()
    aside = replace(scene, robot=replace(scene.robot, up=(0.1, 1.0, 0.0)))
    assert "gravity has a part along x" in plane_of(aside).sentence()
    out = {"q0": np.array([0.1, 0.1, 0, 0, 0]), "qd0": np.zeros(5), "initial_chart": "cardan"}
    found = plane_of(scene_of(options={"chart": "cardan"}, **out))
    assert "the robot starts out of the plane" in found.sentence()
    wound = plane_of(tube(twist=90)).sentence()
    assert "threads 1, 2, 3, 4 are bent or twisted out of the plane at rest" in wound
    # Four bellows, the pair across at unlike pressures: parts are symmetric, loads are not.
    grub = dtc.load_scene("grub").rediscretised(2)
    found = plane_of(grub)
    assert found.breaks == ("a force or a chamber acts beside the plane",)
    values = grub.pressure.values.copy()
    values[:, 2] = values[:, 3]
    alike = replace(grub, pressure=dtc.Profile(grub.pressure.times, values))
    assert plane_of(alike).planar


@pytest.fixture(scope="module")
def advice() -> dtc.Advice:
    return dtc.advise(scene_of(t_end=1.0), 0.02)


@needs_compiler
def test_the_promise_on_a_small_robot(advice):
    truth = {"chart": "cardan"}
    given = advice.given
    in_space = replace(given, options={**given.options, **truth})
    assert advice.best is not None and advice.reference.converged
    found = replace(advice, given=given)
    assert true_error(found, method="DOP853", rtol=1e-10, atol=1e-12) <= 0.02
    # Nothing at half its cost keeps the tolerance: each such candidate against the same truth.
    times = np.linspace(0.0, 1.0, 101)
    exact = tip_path(in_space, times, method="DOP853", rtol=1e-10, atol=1e-12)
    lab = Lab(given, "tip", 0.02)
    cheap = [m for m in advice.candidates if m.cost <= 0.5 * advice.best.cost and not m.failure]
    for one in cheap:
        path = lab.path(one.candidate).points[:, 0]
        assert distance_over_range(path, exact, lab.length) > 0.02, one


@needs_compiler
@pytest.mark.parametrize("off", [0.03, np.inf])
def test_a_reference_that_is_off_allows_nothing(advice, off):
    search = Search(
        Lab(advice.given, "tip", 0.02), replace(advice.reference, uncertainty=off), 0.02
    )
    assert search.run() is None
    assert len(search.measured) == 1, "nor is anything run in vain"


@needs_compiler
def test_what_is_measured(advice):
    best = advice.best
    assert advice.planarity.planar and best.candidate.chart == "planar"
    assert best.candidate.n_discs == 2, "discs that are given are never refined"
    assert {one.candidate.n_discs for one in advice.candidates} == {2}
    methods = {one.candidate.method for one in advice.candidates}
    assert methods == {"statics", "auto", "heun", "rk4", "ros2", "rodas4"}
    assert {one.candidate.velocity_terms for one in advice.candidates} == {"full", "none"}
    within = [m for m in advice.candidates if m.error <= 0.02 and m.candidate.step_s]
    assert best.cost == min(m.cost for m in within)
    assert advice.reference.uncertainty <= SHARE * 0.02
    assert advice.scene.build().n_discs == 2
    assert "error" in repr(advice)


@needs_compiler
def test_the_command(tmp_path, capsys):
    files = {name: tmp_path / name for name in ("a.json", "a.png", "small.toml")}
    scene = tmp_path / "rod.toml"
    scene.write_text(ROD)
    words = ["advise", str(scene), "--tolerance", "0.05", "--json", str(files["a.json"])]
    words += ["--png", str(files["a.png"]), "--write", str(files["small.toml"])]
    assert cli.main(words) == 0
    text = capsys.readouterr().out
    assert "<- advised" in text and "reference: converged; extrapolated from" in text
    found = json.loads(files["a.json"].read_text())
    assert found["schema"] == 1 and found["reference_converged"] is True
    assert list(found["advised"]) == KEYS
    assert all(set(KEYS) <= set(one) for one in found["candidates"])
    assert found["error"] <= 0.05 and found["cost"] > 0
    small = dtc.load_scene(files["small.toml"])
    advised = found["advised"]
    assert small.robot.n_discs == advised["n_discs"] < 17
    assert small.options["chart"] == advised["chart"] == "planar"
    assert small.options["velocity_terms"] == advised["velocity_terms"]
    assert small.step_s == advised["step_s"]
    # It runs as advised.
    run = dtc.simulate(small)
    assert run.success and run.method == advised["method"]
    assert run.steps == math.ceil(small.t_end / advised["step_s"] - 1e-9)
    # The scene's start, bent a little, and its load go along.
    assert (
        small.q0.sum() == pytest.approx(0.2) and small.robot.forces[0].disc == small.robot.n_discs
    )
    assert files["a.png"].stat().st_size > 10_000


ROD = """\
schema = 1
[robot]
up = [0, 1, 0]
[robot.rod]
n_discs = 5
length = 1
bending_stiffness = 1
twisting_stiffness = 1
shear_stiffness = 400
mass_per_length = 1
retardation_time = 0.3
gravity_free = false
[[robot.forces]]
kind = "point_load"
disc = 5
magnitude = 1
direction = [0, -1, 0]
[model]
chart = "planar"
[initial]
beta = 0.05
[run]
t_end = 2
""".replace("gravity_free = false\n", "")


@pytest.mark.slow
@needs_compiler
def test_pressure_response():
    found = dtc.advise(tube(chart="planar"), 0.02, quantity="pressure-response")
    best = found.best
    assert best is not None and not best.candidate.dynamic and best.candidate.step_s is None
    assert {m.candidate.method for m in found.candidates} == {"statics"}
    # Against a tube cut four times as fine as the finest one, by `equilibrium` alone.
    finest = found.reference.candidate.n_discs - 1
    ends = []
    for n_discs in (best.candidate.n_discs, 4 * finest + 1):
        scene = found.given.rediscretised(n_discs)
        model = scene.build(chart="planar")
        # Compiling the finest one's search would take longer than its nine equilibria.
        model.once("search", partial(virtual_search, model))
        tips = []
        for pressure in np.linspace(0.0, 10e3, 9):
            R, r = dtc.equilibrium(model, pressure).poses
            tips.append(r[-1] + R[-1] @ scene.robot.discs[-1].centre_of_mass)
        ends.append(np.array(tips))
    assert distance_over_range(*ends, 0.2) <= 0.02
    errors = {m.candidate.n_discs: m.error for m in found.candidates}
    # Errors go with the square of a segment's length; the coarsest pair is not there yet.
    sizes = sorted(errors)[1:3]
    (order,) = -np.diff(np.log([errors[n] for n in sizes])) / np.diff(np.log(np.array(sizes) - 1))
    assert order == pytest.approx(2.0, abs=0.35)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"tolerance": 0}, "tolerance: expected a finite positive number, got 0"),
        ({"tolerance": 2}, "tolerance: expected a share of the range of motion"),
        ({"quantity": "end"}, "quantity: expected one of tip, shape, pressure-response, got 'end'"),
    ],
)
def test_wrong_arguments(arguments, message):
    with pytest.raises(AdviseError) as error:
        dtc.advise(scene_of(), **{"tolerance": 0.02, **arguments})
    assert message in str(error.value)


def test_no_pressure_to_respond_to():
    still = scene_of(pressure=dtc.Profile.constant(0.0))
    with pytest.raises(AdviseError, match="tip or shape for a scene without pressure"):
        dtc.advise(still, quantity="pressure-response")
