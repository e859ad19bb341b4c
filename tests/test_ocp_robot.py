"""Every transcription and solver on the robot: the same optimum from the same start."""

import numpy as np
import pytest
from control_case import case

import dtcasadi as dtc
from dtcasadi.sensors import Marker
from ocp import Effort, Limits, Problem, Solver, Tracking, available, stages, transcribe

# OSQP is left out: a first-order method, minutes to eight digits.
NAMES = [name for name in available() if name != "sqpmethod-osqp"]


@pytest.fixture(scope="module")
def found():
    """The planar seed robot bent towards a point, saturated at first."""
    model = dtc.load_scene("seed_four_disc").build(chart="planar", actuator="regulator")
    sensors = (Marker(name="tip", disc=4, noise=0.01),)
    # The step of midpoint is collocation at one Gauss point: both are the same program.
    discrete = model.discrete(0.05, method="midpoint", sensors=sensors)
    limits = Limits(0.0, 12.0, rate=50.0)
    tracking = Tracking("tip", (2.0, 3.0), channels=("y", "z"), weight=20.0)
    x0 = np.zeros(model.n_x)
    x0[-1] = 6.0
    problem = Problem(8, tracking, Effort(change=0.1), limits)
    return case(stages(discrete, problem), x0, np.array([6.0]))


@pytest.fixture(scope="module")
def optimum(found):
    """By IPOPT with exact second derivatives from CasADi: no code shared with Gauss-Newton."""
    return Solver(transcribe(found.stages, "legendre", degree=1, exact=True), "ipopt")(
        found.instance, found.plan
    )


@pytest.mark.parametrize("name", NAMES)
def test_shooting_reaches_the_optimum_with_every_solver(found, optimum, name):
    assert optimum.good
    # DAQP is for dense programs.
    scheme = "single" if name == "sqpmethod-daqp" else "shooting"
    solution = Solver(transcribe(found.stages, scheme), name)(found.instance, found.plan)
    assert solution.good, solution.text
    assert solution.residuals.largest < 1e-6
    # Interior points stop at barriers of 1e-9, the proximal steps of DAQP at 1e-9 too.
    assert solution.cost == pytest.approx(optimum.cost, rel=1e-7)
    assert np.allclose(solution.u, optimum.u, atol=1e-3)  # where the cost is flat, as its root
    assert np.all(solution.u <= 12.0 + 1e-6) and np.min(solution.u) > -1e-6
    assert solution.u[0] == pytest.approx(3.5, abs=1e-3)  # 50 a second down from 6


@pytest.mark.parametrize("name", ["ipopt", "fatrop", "sqpmethod-qrqp"])
def test_collocation_is_the_same_program(found, optimum, name):
    solution = Solver(transcribe(found.stages, "legendre", degree=1), name)(
        found.instance, found.plan
    )
    assert solution.good, solution.text
    assert solution.cost == pytest.approx(optimum.cost, rel=1e-7)
    assert np.allclose(solution.x, optimum.x, atol=1e-4)


def test_a_warm_start_is_quicker(found, optimum):
    solver = Solver(transcribe(found.stages), "sqpmethod-qrqp")
    cold = solver(found.instance, found.plan)
    assert solver(found.instance, cold).iterations <= 1 < cold.iterations
