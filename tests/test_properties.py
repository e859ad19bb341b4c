"""Properties of the model over random robots (hypothesis, derandomized), in the virtual machine."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.cases import error, numbers
from oracles.chain import WORDS
from oracles.robots import coordinates, random_robot

import dtcasadi as dtc

seeds = st.integers(0, 2**32 - 1)
# The first segment always moves; at least one coordinate in every robot.
chart_lists = st.tuples(st.sampled_from(["cardan", "paper", "planar", "hinge", "ball"])).flatmap(
    lambda first: st.lists(st.sampled_from(sorted(WORDS)), max_size=3).map(
        lambda rest: first + tuple(rest)
    )
)


def robot_and_state(seed: int, charts: tuple[str, ...]) -> tuple:
    """A robot whose discs' masses span four decades, and a state."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, len(charts) + 1, decades=2.0)
    q = coordinates(rng, charts)
    qd, tau = rng.normal(size=(2, len(q)))
    return robot, q, qd, rng.uniform(-1.0, 5.0, len(robot.chambers)), tau


def check_mass_matrix(seed: int, charts: tuple[str, ...]) -> None:
    """M is symmetric, and 2 T = qd . M qd > 0 in every direction."""
    robot, q, qd, _, _ = robot_and_state(seed, charts)
    model = dtc.build(robot, chart=list(charts))
    M = numbers(model.mass_matrix, q, model.theta0).reshape(len(q), len(q))
    assert error(M, M.T) <= 1e-15  # the same entry twice, or sums in another order
    # Scaled to a unit diagonal so that masses of different decades do not hide an indefinite M.
    scale = np.sqrt(np.diag(M))
    assert np.linalg.eigvalsh(M / np.outer(scale, scale))[0] > 0
    T = numbers(model.kinetic_energy, q, qd, model.theta0)
    assert T[0] == pytest.approx(qd @ M @ qd / 2, rel=1e-12)  # round-off


def check_assemblies(seed: int, charts: tuple[str, ...]) -> None:
    """Flat and call-graph assemblies of the same kernels differ by round-off only."""
    robot, q, qd, pressure, tau = robot_and_state(seed, charts)
    flat = dtc.build(robot, chart=list(charts), assembly="flat")
    graph = dtc.build(robot, chart=list(charts), assembly="graph")
    theta = flat.theta0
    assert np.array_equal(theta, graph.theta0)
    M = numbers(flat.mass_matrix, q, theta).reshape(len(q), len(q))
    for name, arguments in {
        "mass_matrix": (q,),
        "coriolis": (q, qd),
        "gravity": (q,),
        "spring": (q,),
        "damping": (q, qd),
        "inflation": (q, pressure),
        "inverse_dynamics": (q, qd, tau, pressure),
        "inverse_dynamics_jacobian": (q, qd, tau, pressure),
        "kinetic_energy": (q, qd),
        "potential_energy": (q,),
        "momenta": (q, qd),
        "lagrangian_gradient": (q, qd),
        "poses": (q,),
        "angular_jacobians": (q,),
    }.items():
        both = [numbers(getattr(m, name), *arguments, theta) for m in (flat, graph)]
        pairs = [both] if isinstance(both[0], np.ndarray) else zip(*both, strict=True)
        for a, b in pairs:
            # Round-off of some thousand operations; terms may cancel to nothing (one hinge's
            # coriolis), so that M sets a least scale.
            scale = max(np.max(np.abs(b), initial=0.0), np.max(M))
            assert np.max(np.abs(a - b), initial=0.0) < 1e-11 * scale, name
    a, b = (numbers(m.forward_dynamics, q, qd, pressure, tau, theta) for m in (flat, graph))
    # Measured in forces: M's condition number, up to 1e9 here, does not enter.
    assert np.max(np.abs(M @ (a - b))) <= 1e-11 * np.max(np.abs(M) @ np.abs(a))


# Few in the default run, as every example builds its models anew.
few = settings(max_examples=3, deadline=None, derandomize=True, database=None)
quick = settings(max_examples=10, deadline=None, derandomize=True, database=None)
thorough = settings(max_examples=200, deadline=None, derandomize=True, database=None)

test_mass_matrix = quick(given(seeds, chart_lists)(check_mass_matrix))
test_assemblies_agree = few(given(seeds, chart_lists)(check_assemblies))
test_mass_matrix_of_many = pytest.mark.slow(thorough(given(seeds, chart_lists)(check_mass_matrix)))
test_assemblies_of_many = pytest.mark.slow(thorough(given(seeds, chart_lists)(check_assemblies)))
