"""The oracles against each other: a disagreement here is a fault of an oracle, not of the model."""

import pytest
from oracles.cases import error, evaluate
from oracles.chain import spread
from oracles.lagrangian import lagrangian
from oracles.mujoco_chain import MujocoChain
from oracles.newton import last_disc_tension
from oracles.pinocchio_chain import PinocchioChain
from oracles.robots import coordinates, random_robot

MIXED = ("ball", "rigid", "cardan")


@pytest.mark.parametrize(
    ("n", "chart"), [(2, "cardan"), (3, "paper"), (3, "planar"), (4, "hinge"), (4, MIXED)]
)
def test_lagrangian_pinocchio_and_mujoco_agree(rng, n, chart):
    """M, bias and accelerations of the bare chain by three programs."""
    robot, charts = random_robot(rng, n, bare=True), spread(chart, n)
    q = coordinates(rng, charts)
    qd, qdd = rng.normal(size=(2, len(q)))
    plain = evaluate(lagrangian(robot, charts), q, qd, qdd, [])
    bias = plain["coriolis"] + plain["gravity"]
    # MuJoCo cannot hold the paper's chart: see its module.
    for peer in (PinocchioChain, MujocoChain) if chart != "paper" else (PinocchioChain,):
        chain = peer(robot, charts)
        # 1e-12: round-off of some 1e3 operations; M's condition number, up to 1e4, in qdd.
        assert error(chain.mass_matrix(q), plain["M"]) < 1e-12
        assert error(chain.bias(q, qd), bias) < 1e-12
        assert error(chain.forward_dynamics(q, qd, plain["tau"]), qdd) < 1e-10


def test_tension_is_what_keeps_the_last_disc_on_its_thread(rng):
    """Newton's law of the last disc along its thread, forces written out one by one."""
    robot, charts = random_robot(rng, 3), spread("cardan", 3)
    q = coordinates(rng, charts)
    qd, qdd = rng.normal(size=(2, len(q)))
    pressure = rng.uniform(1.0, 5.0, len(robot.chambers))
    plain = evaluate(lagrangian(robot, charts), q, qd, qdd, pressure)
    expected = last_disc_tension(robot, charts, q, qd, qdd, pressure)
    assert plain["tension"][-1] == pytest.approx(expected, rel=1e-12)  # round-off
