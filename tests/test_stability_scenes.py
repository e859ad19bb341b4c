"""The scenes of the stability map hold what their comments say."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dtcasadi as dtc
from dtcasadi.compile import Bound, twin
from dtcasadi.integrators import METHODS, Problem
from dtcasadi.presets import seed_four_disc

NAMES = [name for name in dtc.scene_names() if name.startswith("stability/")]
PLAIN = [name for name in NAMES if not name.endswith("_coordinate")]


@cache
def scene(name: str) -> dtc.Scene:
    return dtc.load_scene(f"stability/{name}")


def test_each_states_its_horizon_and_measure():
    assert len(PLAIN) == 17 and len(NAMES) == 23
    for name in NAMES:
        found = dtc.load_scene(name)
        assert f"reaches {found.t_end:g} s with its energy within twice" in found.measure.text
        assert 0 < found.measure.smallest_step_s <= 1e-3
        assert (found.measure.bound_of in PLAIN) == name.endswith("_coordinate")


def test_the_papers_start_is_the_seed_scenes():
    seed, found = dtc.load_scene("seed_four_disc"), scene("paper_start")
    q, _ = dtc.convert(found.robot, found.q0, found.qd0, found.initial_chart, "cardan")
    expected, _ = dtc.convert(seed.robot, seed.q0, seed.qd0, seed.initial_chart, "cardan")
    assert np.array_equal(q, expected)  # exact zeros stay exact
    assert found.pressure(0.0) == seed.pressure(0.0) and found.t_end == seed.t_end
    assert np.array_equal(found.robot.up, seed_four_disc().up)


@pytest.mark.parametrize("name", [n.removeprefix("stability/") for n in NAMES if "_coord" in n])
def test_coordinate_scenes_differ_in_chart_and_damping_only(name):
    found, plain = scene(name), scene(name.removesuffix("_coordinate"))
    assert found.options == {"chart": "paper", "damping": "coordinate"}
    assert plain.options == {"chart": "cardan"}
    assert found.initial_chart == plain.initial_chart == ("paper",) * 3
    assert np.array_equal(found.q0, plain.q0) and not found.qd0.any() and not plain.qd0.any()
    assert all(damping.c_a == 100 for damping in found.robot.damping)
    for one, other in zip(found.robot.discs, plain.robot.discs, strict=True):
        assert one.mass == other.mass and np.array_equal(one.inertia, other.inertia)


def test_one_thread_passes_every_chart_singularity():
    """|cos| or |sin| of every chart's middle angle, from poses every 2e-3 rad of the swing."""
    whole = scene("through_singularities")
    model = whole.build()
    pieces = whole.pressure.pieces(0.0, whole.t_end)
    METHODS["rk4"].prepare(model)
    run = METHODS["rk4"].integrate(
        Problem(model, whole.x0(model), model.theta0, pieces, 1e-6, 1e-8, 2.5e-4)
    )
    poses = Bound(twin(model.poses))
    columns = zip(run.x[:5].T, run.thetas.T, strict=True)
    R, r = zip(*((p.R[:, 3:], p.r[:, 1]) for p in (poses(*c) for c in columns)), strict=True)
    R, t = np.array(R), np.array(r)  # disc 1 is the world, the thread's length is 1
    # cardan: t_x = sin of the thread's second angle; disc: R_thread^T R_rel, its middle angle.
    a, b = np.arctan2(-t[:, 1], t[:, 2]), np.arcsin(t[:, 0])
    thread = Rotation.from_euler("XY", np.column_stack([a, b])).as_matrix()
    disc = thread.transpose(0, 2, 1) @ R
    cardan = (np.cos(b), np.sqrt(np.maximum(1 - disc[:, 0, 2] ** 2, 0)))
    # paper: beta from the z axis to the thread, psi from the thread to the disc's y axis.
    paper = (np.hypot(t[:, 0], t[:, 1]), np.sqrt(1 - np.einsum("mj,mj->m", R[:, :, 1], t) ** 2))
    nearest = [np.min(distance) for distance in (*cardan, *paper)]
    assert not run.failure and max(nearest) < 1e-3, nearest


def test_a_link_folds_back_over_the_one_before_through_a_spring_of_length_zero():
    run = dtc.simulate(scene("fold_back"), rtol=1e-9, atol=1e-9)
    assert run.success
    fold, spring = (
        np.count_nonzero(np.diff(np.floor((run.q[1] - at) / (2 * np.pi)))) for at in (np.pi, 0.8)
    )
    assert fold >= 3 and spring >= 3
    start = scene("fold_back").robot.springs[-1].start
    assert np.allclose(start, [0, -np.sin(0.8), np.cos(0.8)], atol=1e-16)


def test_the_strip_winds_round_a_straight_tube():
    """At rest: centres on a line 50 mm apart, each disc turned by 20 degrees about it."""
    found = scene("curved_strip")
    model = found.build()
    R, r = (np.array(part) for part in model.poses(np.zeros(model.n_q), model.theta0))
    for i in range(5):
        turned = Rotation.from_euler("z", 20 * i, degrees=True).as_matrix()
        assert np.allclose(R[:, 3 * i : 3 * i + 3], turned, atol=1e-14)
        centre = r[:, i] + turned @ found.robot.discs[i].centroid
        assert np.allclose(centre, [0, 0.025, 0.05 * i], atol=1e-15)
    # Posts run along the tube, so their rest length is the discs' distance.
    assert all(s.rest_length == pytest.approx(0.05) for s in found.robot.springs[:8])


@pytest.mark.slow
def test_it_twists_when_blown_up():
    run = dtc.simulate(scene("curved_strip"))
    R, _ = run.poses(np.array([0, -1]))
    before, after = (Rotation.from_matrix(pose[-1]).as_rotvec(degrees=True)[2] for pose in R)
    assert run.success and before == pytest.approx(80) and 12 < before - after < 20


def test_the_coil_starts_straight():
    found = scene("pre_curved")
    model = found.build()
    R, r = (np.array(part) for part in model.poses(found.q0, model.theta0))
    assert np.allclose(np.hsplit(R, 6), np.eye(3), atol=1e-14)
    assert np.allclose(r[:2], 0, atol=1e-15)
    # Without force where the coordinates are zero: each segment bent by 30 degrees, turned by 10.
    assert np.max(np.abs(np.array(model.spring(np.zeros(model.n_q), model.theta0)))) < 1e-12
    bend = found.robot.threads[0].bend
    assert np.degrees(np.arccos(bend[2, 2])) == pytest.approx(30, abs=1)


def test_what_the_numbers_of_the_others_are():
    """Decay rates of the small tube, the conservative chain's fastest mode."""
    chain = scene("long_conservative").build()
    F_x = np.array(chain.ode_jacobian(np.zeros(chain.n_x), [], chain.theta0)[1])
    eigenvalues = np.linalg.eigvals(F_x)
    assert np.max(np.abs(eigenvalues.real)) < 1e-8 * np.max(eigenvalues.imag)
    assert np.max(eigenvalues.imag) == pytest.approx(10.5, abs=0.1)
    small = scene("small_stiff").build()
    F_x = np.array(small.ode_jacobian(scene("small_stiff").x0(small), [2e4], small.theta0)[1])
    assert np.min(np.linalg.eigvals(F_x).real) == pytest.approx(-1.2e5, rel=0.05)


def test_a_stiff_gas_costs_linearly_implicit_methods_no_steps():
    """The finger with its air supply, and with the command as its pressure."""
    gas = scene("stiff_gas")
    plain = replace(gas, options={**gas.options, "actuator": "direct"})
    model, x0 = gas.build(), gas.x0(gas.build())
    F_x = np.array(model.ode_jacobian(x0, [2e3], model.theta0)[1])
    decays = np.sort(np.linalg.eigvals(F_x).real)
    assert decays[0] == pytest.approx(-1.0e4, rel=0.5) and decays[1] > -2e3
    ends, steps = {}, {}
    for method in ("rodas4", "ros3", "tsit5"):
        runs = [dtc.simulate(each, method=method, rtol=1e-3, atol=1e-5) for each in (gas, plain)]
        assert all(run.success for run in runs)
        steps[method] = [len(run.t) for run in runs]
        ends[method] = runs[0].q[:, -1]
    for method in ("rodas4", "ros3"):
        assert steps[method][0] <= 1.05 * steps[method][1], steps
        assert np.allclose(ends[method], ends["tsit5"], atol=1e-4)
    assert steps["tsit5"][0] > 2.5 * steps["tsit5"][1], steps
