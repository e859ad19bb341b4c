"""The scenes of rigid contact: cone, penetration, energy, and what the forces balance at rest."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from oracles.cases import numbers

import dtcasadi as dtc

SCENES = ("wall", "cylinder", "fold", "floor")


@cache
def ran(name: str) -> dtc.Run:
    """The scene's run, which takes longest to compile."""
    run = dtc.simulate(dtc.load_scene(f"contact/{name}"))
    assert run.success and run.method == "moreau", run.message
    return run


@pytest.mark.parametrize("name", SCENES)
def test_the_scenes_hold_rigid_contact(name):
    robot = dtc.load_scene(f"contact/{name}").robot
    assert robot.plates is not None or any(each.rigid for each in robot.obstacles)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_what_touches_obeys_the_laws(name):
    """Coulomb's law to 1e-8 and impulses that only take; what is touched is not entered."""
    run = ran(name)
    touched = run.touched
    assert touched is not None and len(run.contacts) > 10
    assert touched.defect < 1e-8
    assert touched.loss.max() <= 1e-13 * max(1.0, np.abs(touched.loss).max())
    radius = max(np.ptp(disc.outline, axis=0).max() for disc in run.model.robot.discs) / 2
    assert run.contacts.gap.min() > -1e-4 * radius


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wall", "cylinder"])
def test_contact_balances_all_other_forces_at_rest(name):
    """Statics at the end of the run: inverse dynamics without motion is J^T f.

    J by differentiation of the places of the points; rates of the last millimetres fade with the
    retardation time, so some thousandth of the force may still be the damping's.
    """
    run = ran(name)
    model, contacts = run.model, run.contacts
    q, theta = run.q[:, -1], run.thetas[:, -1]
    still = np.zeros(model.n_q)
    needed = np.array(model.inverse_dynamics(q, still, still, run.pressure[:, -1], theta)).ravel()
    last = contacts.t == run.t[-1]
    assert np.any(last)
    sq = ca.MX.sym("q", model.n_q)
    R, r = model.poses(sq, theta)
    R_end, r_end = run.poses([-1])
    given = np.zeros(model.n_q)
    for disc, place, force in zip(
        contacts.disc[last], contacts.place[last], contacts.force[last], strict=True
    ):
        k = disc - 1
        point = R_end[0, k].T @ (place - r_end[0, k])
        moved = r[:, k] + ca.mtimes(R[:, 3 * k : 3 * disc], ca.DM(point))
        slope = numbers(ca.Function("slope", [sq], [ca.jacobian(moved, sq)]), q)
        given += slope.T @ force
    assert np.abs(needed).max() > 1e-3
    assert np.abs(needed - given).max() < 5e-3 * np.abs(needed).max()


@pytest.mark.slow
def test_the_tube_holds_on_to_the_cylinder():
    """Weight, contact forces and string balance, all round the cylinder, and nothing creeps.

    Beside poses and contact forces only masses enter: the string's force is the rest of the balance
    of forces, and has to lie along the string and balance moments. Round-off of 10 N over 0.1 m.
    """
    scene = dtc.load_scene("contact/cylinder")
    run = dtc.simulate(scene, t_end=8.0)
    R, r = (each[0] for each in run.poses([-1]))
    discs, contacts = run.model.robot.discs, run.contacts
    last = contacts.t == run.t[-1]
    force, place = contacts.force[last], contacts.place[last]
    down = np.array([0.0, -run.model.robot.gravity, 0.0])
    weights = [disc.mass * down for disc in discs]
    centres = [r[k] + R[k] @ disc.centre_of_mass for k, disc in enumerate(discs)]
    base = r[2]
    string = -force.sum(axis=0) - sum(weights[2:])
    assert np.abs(np.cross(string, r[1] - base)).max() < 1e-10
    on_bead = np.cross(r[1], -string) + np.cross(centres[1], weights[1])  # about the root
    assert np.abs(on_bead).max() < 1e-10
    moment = np.cross(place - base, force).sum(axis=0)
    moment += sum(np.cross(c - base, w) for c, w in zip(centres[2:], weights[2:], strict=True))
    assert np.abs(moment).max() < 1e-10
    weight = -sum(weights[2:])[1]
    assert force.sum(axis=0)[1] == pytest.approx(weight, rel=0.02)  # and the string's bead
    out = (place - scene.robot.obstacles[0].shape.start) * [0, 1, 1]
    angles = np.sort(np.degrees(np.arctan2(out[:, 1], out[:, 2])))
    span = 360 - np.diff(angles, append=angles[0] + 360).max()
    assert len(angles) >= 10 and span > 300
    out /= np.linalg.norm(out, axis=1)[:, np.newaxis]
    across = force - np.sum(force * out, axis=1)[:, np.newaxis] * out
    assert across[:, 1].sum() > weight  # normals pull down: without friction it would slip
    _, then = run.poses([np.searchsorted(run.t, 2.0)])
    assert np.abs(r - then[0]).max() < 1e-12  # 12 000 steps
