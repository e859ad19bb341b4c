"""Forces of one's own: the protocol by independent kinematics, derivatives, energy, parameters."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.forces import Motion, by_power, state, with_forces
from own_forces import Magnet, MagnetByEnergy, Sail, Tendon
from test_derivatives import exact

import dtcasadi as dtc
from dtcasadi.forces import (
    Couple,
    Drag,
    FabricBunching,
    FollowerLoad,
    Payload,
    PointLoad,
    WallSpring,
)

CHARTS = ("cardan", "paper", "ball")
ROUND_OFF = 1e-12  # of some thousand operations, relative to the largest entry
CONDITIONED = 1e-9  # through M, cond(M) up to 1e4 here


def tension_of(at: Motion, tendon: Tendon) -> tuple[ca.SX, ca.SX]:
    """Length of the cable and its rate, from plain kinematics."""
    places = [at.place(disc, np.array(tendon.point)) for disc in tendon.discs]
    length = sum(ca.norm_2(b - a) for a, b in zip(places, places[1:], strict=False))
    return length, ca.jtimes(length, at.q, at.qd)


@pytest.mark.parametrize("assembly", ["flat", "graph"])
def test_a_tendon_over_several_discs(rng, assembly):
    """It passes over segments: -(k (L - L0) + c dL/dt) dL/dq."""
    tendon = Tendon((1, 2, 4), 3.0, 0.5)
    plain = cases.robot(4)
    at = Motion(plain, CHARTS)
    length, rate = tension_of(at, tendon)
    tension = tendon.stiffness * (length - tendon.rest) + tendon.damping * rate
    expected = ca.Function("Q", [at.q, at.qd], [-tension * ca.gradient(length, at.q)])
    model = dtc.build(with_forces(plain, tendon), chart=list(CHARTS), assembly=assembly)
    q, qd, _ = state(rng, CHARTS)
    Q = numbers(model.forces, q, qd, model.theta0)
    assert error(Q, numbers(expected, q, qd)) < ROUND_OFF
    # Inside the chain its reaction acts on the first disc: nothing reaches the segment before.
    inner = dtc.build(with_forces(plain, Tendon((2, 3, 4), 3.0, 0.5)), chart=list(CHARTS))
    assert np.max(np.abs(numbers(inner.forces, q, qd, inner.theta0)[:5])) < 1e-13


def test_a_force_of_the_world_with_rates(rng):
    sail = Sail(4, 0.8)
    plain = cases.robot(4)

    def loads(at: Motion) -> list[tuple[ca.SX, ca.SX]]:
        R, point = at.R(4), np.array([0.1, 0.2, 0.3])
        slip = R.T @ (ca.SX(sail.wind) - at.velocity(4, np.zeros(3)))
        push = sail.area * slip[2] ** 3 * R @ ca.SX([0, 0, 1])
        w = at.w(4)
        return [(push, at.velocity(4, point)), (-sail.area * w * ca.sumsqr(w), w)]

    model = dtc.build(with_forces(plain, sail), chart=list(CHARTS))
    q, qd, _ = state(rng, CHARTS)
    expected = by_power(plain, CHARTS, loads)(q, qd)
    assert error(numbers(model.forces, q, qd, model.theta0), expected) < ROUND_OFF
    # What the wind gives at rest is supplied, the rest of it dissipated.
    without = dtc.build(plain, chart=list(CHARTS))
    x, pressure = np.concatenate([q, qd]), np.zeros(model.n_u)
    gained = np.subtract(
        numbers(model.power, x, pressure, model.theta0),
        numbers(without.power, x, pressure, model.theta0),
    )
    at_rest = numbers(model.forces, q, 0 * qd, model.theta0)
    assert gained[0] == pytest.approx([qd @ at_rest], rel=1e-9)
    assert gained[1] == pytest.approx([qd @ (at_rest - expected)], rel=1e-9)


def test_wrenches_from_an_energy_alone(rng):
    both = [
        dtc.build(with_forces(cases.robot(4), kind(3, 2.0)), chart=list(CHARTS))
        for kind in (Magnet, MagnetByEnergy)
    ]
    q, qd, _ = state(rng, CHARTS)
    given, derived = (numbers(model.forces, q, qd, model.theta0) for model in both)
    assert error(derived, given) < ROUND_OFF
    for model in both:
        symbol = ca.SX.sym("q", model.n_q)
        slope = ca.gradient(model.potential_energy(symbol, model.theta0), symbol)
        slope = numbers(ca.Function("slope", [symbol], [slope]), q)
        static = numbers(model.gravity, q, model.theta0) + numbers(model.spring, q, model.theta0)
        assert error(static - given, slope) < 1e-11


FORCES = (
    Magnet(3, 2.0),
    Tendon((1, 2, 3), 3.0, 0.5),
    Tendon((2, 3), 1.0, 0.2),
    Sail(2, 0.8),
    Sail(3, 0.3),
    PointLoad(3, 2.0, (0.2, 0.3, -1.0)),
    FollowerLoad(2, -1.0, (0.1, 1.0, 0.3)),
    Couple(3, 0.6, (1.0, 0.2, 0.0)),
    Payload(3, 0.7, (0.1, 0.2, -0.1)),
    Drag(3, (0.3, 0.2, 0.1), 0.5, 0.1, (0.2, -0.3, 0.4)),
    WallSpring((1, 2), (0.1, 0.9, 0.0), (0.3, 1.1, 0.1), 2.0, 0.5, 0.3, 0.1),
    FabricBunching((2, 3), (0.0, 1.0, 0.0), (0.1, 1.2, 0.0), 3.0, 3.0, 0.2),
)


@pytest.mark.parametrize(
    "options",
    [{}, {"assembly": "graph"}, {"velocity_terms": "none"}, {"velocity_terms": "paper"}],
    ids=lambda o: "_".join(map(str, o.values())) or "default",
)
def test_derivatives_are_exact(rng, options):
    """By recursion against differentiation of the flat functions, all kinds of forces at once."""
    charts = ("cardan", "paper")
    robot = with_forces(cases.robot(3), *FORCES)
    model = dtc.build(robot, chart=list(charts), wrenches=(2,), **options)
    q, qd, qdd = state(rng, charts)
    theta = model.theta0.copy()
    theta[model.theta_blocks["wrench"]] = rng.normal(size=6)
    arguments = q, qd, qdd, rng.uniform(1.0, 5.0, model.n_u), theta
    value = numbers(model.inverse_dynamics_jacobian, *arguments)
    for mine, reference in zip(value, exact(model.inverse_dynamics, arguments, 2), strict=True):
        assert error(mine, reference) < 1e-11
    arguments = np.concatenate([q, qd]), arguments[3], theta
    _, *value = numbers(model.ode_jacobian, *arguments)
    for mine, reference in zip(value, exact(model.ode, arguments, 2), strict=True):
        assert error(mine, reference.reshape(mine.shape)) < CONDITIONED


def test_assemblies_agree(rng):
    robot = with_forces(cases.robot(3), *FORCES)
    models = [dtc.build(robot, assembly=assembly) for assembly in ("flat", "graph")]
    q, qd, qdd = state(rng, ("cardan",) * 2)
    flat, graph = (
        [
            numbers(m.inverse_dynamics, q, qd, qdd, np.ones(m.n_u), m.theta0),
            numbers(m.potential_energy, q, m.theta0),
            numbers(m.canonical_ode, q, qd, np.ones(m.n_u), qdd, m.theta0)[1],
        ]
        for m in models
    )
    for a, b in zip(flat, graph, strict=True):
        assert error(a, b) < CONDITIONED


def test_numbers_of_forces_as_parameters(rng):
    """A path frees a number of one force, or of all that have it; text says which there are."""
    robot = with_forces(cases.robot(3), *FORCES)
    model = dtc.build(robot, parameters=("forces[1].place", "forces.stiffness"))
    assert model.theta0[model.theta_blocks["forces[1].place"]].tolist() == [0.3, 0.4, 0.5]
    stiffness = model.theta_blocks["forces.stiffness"]
    assert model.theta0[stiffness].tolist() == [3.0, 1.0, 2.0, 3.0]
    changed = list(robot.forces)
    changed[0] = Magnet(3, 2.0, (0.0, 1.0, 0.0))
    changed[1] = Tendon((1, 2, 3), 4.0, 0.5)
    other = dtc.build(with_forces(robot, *changed))
    theta = model.theta0.copy()
    theta[model.theta_blocks["forces[1].place"]] = [0.0, 1.0, 0.0]
    theta[stiffness.start] = 4.0
    q, qd, _ = state(rng, ("cardan",) * 2)
    expected = numbers(other.forces, q, qd, other.theta0)
    assert error(numbers(model.forces, q, qd, theta), expected) < ROUND_OFF
    for path, text in (
        ("forces[1].weight", r"forces\[1\].weight: expected one of strength, place, soft, got"),
        ("forces[13].mass", r"expected an index from 1 to 12, got 13"),
        ("forces.disc", r"expected one of .*stiffness"),
    ):
        with pytest.raises(dtc.errors.ModelError, match=text):
            dtc.build(robot, parameters=[path])


def test_energy_is_conserved_or_accounted_for():
    """Springs, a magnet and a tendon without its damper conserve; sail and damper are booked."""
    scene = dtc.load_scene("seed_four_disc")
    quiet = replace(scene.robot, damping=dtc.Damping(), chambers=())
    x0 = np.concatenate([0.3 * np.ones(6), np.zeros(6)])
    accuracy = {"rtol": 1e-10, "atol": 1e-12, "method": "dopri5", "t_end": 1.0}
    for forces, lost in (
        ((MagnetByEnergy(3, 5.0), PointLoad(4, 3.0, (0, 0, 1))), False),
        ((Tendon((1, 3), 2.0, 0.5), Sail(4, 0.8), Couple(4, 1.0, (1, 0, 0))), True),
    ):
        model = dtc.build(with_forces(quiet, *forces), chart="planar")
        run = dtc.simulate(model, x0, **accuracy)
        assert run.success, run.message
        turned = np.ptp(run.energy["kinetic"])
        assert np.max(np.abs(run.energy["residual"])) < 1e-8 * turned  # rtol over some 100 steps
        assert (np.ptp(run.energy["dissipated"]) > 1e-3 * turned) == lost


@pytest.mark.parametrize("name", ["ode", "ode_jacobian", "potential_energy"])
def test_no_force_needs_a_condition(name):
    """No `?:` in generated C, which a SIMD type cannot take."""
    robot = with_forces(cases.robot(3), *FORCES)
    function = dtc.build(robot, chart="planar", inflation="volume").function(name).expand()
    codes = {function.instruction_id(k) for k in range(function.n_instructions())}
    assert ca.OP_FMAX in codes
    assert not codes & {ca.OP_IF_ELSE_ZERO, ca.OP_CALL}
