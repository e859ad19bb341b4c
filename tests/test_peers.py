"""The model against Pinocchio and MuJoCo on the same chain, up to 16 discs (75 coordinates)."""

import numpy as np
import pytest
from oracles import cases
from oracles.cases import error, numbers
from oracles.chain import spread
from oracles.mujoco_chain import MujocoChain
from oracles.pinocchio_chain import PinocchioChain
from oracles.robots import coordinates

MIXED = ("cardan", "hinge", "paper", "ball", "rigid", "planar", "cardan")
# What the comparison asks for: some hundred round-offs, times cond(M) (up to 1e6) in qdd.
RELATIVE = 1e-10


@pytest.mark.parametrize("peer", [PinocchioChain, MujocoChain])
@pytest.mark.parametrize("n", [2, 4, 8, 16])
def test_cardan_chain(rng, n, peer):
    """M, bias and accelerations, each relative to the largest entry."""
    charts = spread("cardan", n)
    model, chain = cases.model(n, charts, bare=True), peer(cases.robot(n, bare=True), charts)
    theta = model.theta0
    for _ in range(3):
        q = coordinates(rng, charts)
        qd, tau = rng.normal(size=(2, len(q)))
        assert error(numbers(model.mass_matrix, q, theta), chain.mass_matrix(q)) < RELATIVE
        bias = numbers(model.coriolis, q, qd, theta) + numbers(model.gravity, q, theta)
        assert error(bias, chain.bias(q, qd)) < RELATIVE
        qdd = numbers(model.forward_dynamics, q, qd, [], tau, theta)
        assert error(qdd, chain.forward_dynamics(q, qd, tau)) < RELATIVE


@pytest.mark.parametrize(
    ("n", "chart"),
    [
        *((n, "cardan") for n in (2, 4, 8, 16)),
        *((n, "paper") for n in (2, 4, 16)),
        *((16, "planar"), (4, "ball"), (8, MIXED)),
        *(pytest.param(n, "planar", marks=pytest.mark.slow) for n in (2, 4, 8)),
        *(pytest.param(n, "ball", marks=pytest.mark.slow) for n in (2, 8, 16)),
        pytest.param(8, "paper", marks=pytest.mark.slow),
    ],
)
def test_residual_in_any_chart(rng, n, chart):
    """|M qdd - rhs| / (|M| |qdd| + |rhs|), M and rhs by Pinocchio: no cond(M) enters."""
    charts = spread(chart, n)
    model = cases.model(n, charts, bare=True)
    chain = PinocchioChain(cases.robot(n, bare=True), charts)
    for _ in range(3):
        q = coordinates(rng, charts)
        qd, tau = rng.normal(size=(2, len(q)))
        qdd = numbers(model.forward_dynamics, q, qd, [], tau, model.theta0)
        M, rhs = chain.mass_matrix(q), tau - chain.bias(q, qd)
        norm = np.linalg.norm
        residual = norm(M @ qdd - rhs) / (norm(M, 2) * norm(qdd) + norm(rhs))
        assert residual <= 1e-13 * len(q)  # backward error of a solve with n_q unknowns
