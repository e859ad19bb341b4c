"""dtcasadi.batch: many robots in one call, each against CasADi's virtual machine."""

import threading

import casadi as ca
import numpy as np
import pytest
from c_compilers import QUICK_CXX, needs_compiler, needs_cxx

import dtcasadi as dtc
from dtcasadi.batch import OneByOneWarning
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.builders import FUNCTIONS
from dtcasadi.errors import ModelError
from dtcasadi.lanes import obstacle
from dtcasadi.linear import Factored, solve_spd

# Fused multiply-adds and another sine, against round-off times the condition of M (1e3).
TOLERANCE = 1e-12


def model_of(n_discs: int, chart: str, **options) -> dtc.Model:
    free = ("springs.stiffness", f"discs[{n_discs}].mass")
    return dtc.build(seed_robot(n_discs), chart=chart, parameters=free, **options)


def robots(batch: dtc.Batch, model: dtc.Model, n: int, rng: np.random.Generator) -> list:
    """Arguments for n robots, no two alike in state, stiffness or payload."""
    frames = model.theta_blocks.get("frames", slice(0, 0)).stop
    theta = np.repeat(np.asarray(model.theta0)[:, None], n, axis=1)
    theta[frames:] *= rng.uniform(0.5, 2.0, (len(theta) - frames, n))
    ranges = {"u": (0.0, 12.0), "pressure": (0.0, 12.0)}
    return [
        theta
        if port == "theta"
        # Away from zero, where the chart of the paper is singular.
        else rng.uniform(*ranges.get(port, (0.3, 0.8)), (batch.function.size1_in(port), n))
        for port in batch.function.name_in()
    ]


def assert_as_one_by_one(batch: dtc.Batch, function: ca.Function, arrays: list) -> None:
    """Compare with the virtual machine, robot by robot."""
    results = batch(*arrays)
    results = results if isinstance(results, tuple) else (results,)
    n = arrays[0].shape[1]
    for i in range(n):
        expected = function.call([ca.DM(array[:, i]) for array in arrays])
        for name, result, one in zip(function.name_out(), results, expected, strict=True):
            one, mine = one.full(), result[..., i].reshape(one.shape)
            scale = np.abs(one).max() if one.size else 1.0
            assert np.abs(mine - one).max(initial=0.0) <= TOLERANCE * scale, (name, i)


@needs_cxx
@pytest.mark.parametrize("n_robots", [1, 7, 8, 9])
@pytest.mark.parametrize("chart", ["cardan", "planar"])
def test_each_lane_is_its_own_robot(chart, n_robots, rng):
    model = model_of(2, chart)
    batch = dtc.batch(model, flags=QUICK_CXX)
    assert batch.lanes > 1 and batch.why == ""
    arrays = robots(batch, model, n_robots, rng)
    assert_as_one_by_one(batch, model.plain("ode"), arrays)


@needs_cxx
def test_implicit_steps_with_hand_written_solvers(rng):
    model = model_of(3, "hinge", assembly="graph")
    discrete = model.discrete(1e-3, method="ros2")
    batch = dtc.batch(discrete, flags=QUICK_CXX)
    assert batch.lanes > 1
    assert batch.function.name_out() == ["x_next", "status"]
    assert_as_one_by_one(batch, discrete.step, robots(batch, model, 9, rng))


@needs_cxx
def test_each_lane_has_its_own_pivots(rng):
    n, m = 6, 2
    A, b = ca.MX.sym("A", n, n), ca.MX.sym("b", n, m)
    solved = Factored(A, native=True).solve(b)
    spd = solve_spd(ca.mtimes(A, A.T), b, native=True)
    solve = ca.Function("solve", [A, b], [solved, spd], ["A", "b"], ["x", "y"])
    batch = dtc.batch(solve, flags=QUICK_CXX)
    assert batch.lanes > 1
    # Nothing on the diagonal of half of them: without pivoting the first step would divide by zero.
    matrices = rng.normal(size=(n, n, 19))
    matrices[range(n), range(n), ::2] = 0.0
    sides = rng.normal(size=(n, m, 19))
    result = batch(matrices, sides)
    assert result.x.shape == (n, m, 19)
    for i in range(19):
        one = matrices[:, :, i]
        # Round-off times the condition, twice that of A for A A^T.
        allowed = 1e-13 * np.linalg.cond(one)
        x = np.linalg.solve(one, sides[:, :, i])
        assert np.abs(result.x[:, :, i] - x).max() <= allowed * np.abs(x).max()
        y = np.linalg.solve(one @ one.T, sides[:, :, i])
        allowed *= np.linalg.cond(one)
        assert np.abs(result.y[:, :, i] - y).max() <= allowed * np.abs(y).max()


@needs_cxx
def test_a_failing_robot_leaves_the_others_alone(rng):
    model = model_of(2, "planar")
    batch = dtc.batch(model, flags=QUICK_CXX)
    arrays = robots(batch, model, 9, rng)
    good = batch(*arrays)
    arrays[0][1, 3] = np.nan
    bad = batch(*arrays)
    assert np.isnan(bad[:, 3]).any()
    others = [0, 1, 2, 4, 5, 6, 7, 8]
    assert np.array_equal(bad[:, others], good[:, others])


@needs_cxx
def test_layouts_and_what_is_the_same_for_all(rng):
    model = model_of(2, "planar")
    batch = dtc.batch(model, flags=QUICK_CXX)
    x, u, theta = robots(batch, model, 11, rng)
    theta = np.repeat(theta[:, :1], 11, axis=1)
    expected = batch(x, u, theta)
    wide = np.zeros((len(x), 20))
    wide[:, 3:14] = x
    for states in (np.asfortranarray(x), x[:, ::-1][:, ::-1], wide[:, 3:14], x.tolist()):
        assert np.array_equal(batch(states, u, theta[:, 0]), expected)
    broadcast = np.broadcast_to(theta[:, :1], theta.shape)
    assert np.array_equal(batch(x, u, broadcast), expected)
    assert batch(x[:, :0], u[:, :0], theta[:, 0]).shape == (len(x), 0)


def test_without_a_compiler_of_c_plus_plus(monkeypatch, rng):
    monkeypatch.setenv("DTCASADI_CXX", "none")
    model = model_of(2, "planar")
    with pytest.warns(OneByOneWarning, match="ode: one robot at a time: .*DTCASADI_CXX=none"):
        batch = dtc.batch(model)
    assert batch.lanes == 1 and "DTCASADI_CXX=none" in batch.why
    for n in (1, 7, 7, 9):
        assert_as_one_by_one(batch, model.plain("ode"), robots(batch, model, n, rng))
    x, u, theta = robots(batch, model, 3, rng)
    same = np.repeat(theta[:, :1], 3, axis=1)
    assert np.array_equal(batch(x, u, theta[:, 0]), batch(x, u, same))
    assert batch(x[:, :0], u[:, :0], theta[:, 0]).shape == (len(x), 0)


def test_what_branches_on_numbers_runs_one_by_one():
    x = ca.MX.sym("x", 2)
    call = ca.Function("sized", [x], [ca.sign(x)], ["x"], ["y"])
    for inside in (ca.if_else(x[0] > 0, x[1], 0.0), ca.solve(ca.diag(x), x, "qr"), call(x)):
        function = ca.Function("branching", [x], [inside], ["x"], ["y"])
        with pytest.warns(OneByOneWarning, match="contains"):
            batch = dtc.batch(function)
        points = np.array([[1.0, -1.0, 2.0], [3.0, 4.0, -5.0]])
        expected = np.hstack([np.array(function(point)) for point in points.T])
        assert np.array_equal(batch(points), expected)


@pytest.mark.parametrize(("chart", "assembly"), [("cardan", "flat"), ("paper", "graph")])
def test_no_kernel_branches(chart, assembly):
    model = model_of(2, chart, assembly=assembly)
    assert not [why for name in FUNCTIONS if (why := obstacle(model.native(name)))]


KINDS = ("forward_dynamics", "mass_matrix", "poses", "canonical_ode", "ode_jacobian")


@needs_cxx
@pytest.mark.slow
@pytest.mark.parametrize(
    ("n_discs", "chart", "names", "methods"),
    [
        (2, "cardan", FUNCTIONS, ("rk4", "sdirk2")),
        (2, "paper", KINDS, ()),
        (4, "cardan", KINDS, ("rk4",)),
        (4, "planar", KINDS, ("ros2",)),
        (4, "paper", KINDS[:3], ()),
    ],
)
def test_functions_lane_by_lane(n_discs, chart, names, methods, rng):
    model = model_of(n_discs, chart)
    for name in names:
        batch = dtc.batch(model, name, flags=QUICK_CXX)
        assert batch.lanes > 1, batch.why
        assert_as_one_by_one(batch, model.plain(name), robots(batch, model, 9, rng))
    for method in methods:
        discrete = model.discrete(1e-4, method=method)
        batch = dtc.batch(discrete, flags=QUICK_CXX)
        assert batch.lanes > 1, batch.why
        assert_as_one_by_one(batch, discrete.step, robots(batch, model, 9, rng))


@needs_cxx
def test_threads_share_a_batch(rng):
    model = model_of(2, "planar")
    batch = dtc.batch(model, flags=QUICK_CXX)
    sets = [robots(batch, model, 50 + k, rng) for k in range(8)]
    expected = [batch(*arrays) for arrays in sets]
    results: list = [None] * len(sets)

    def work(k: int) -> None:
        for _ in range(20):
            results[k] = batch(*sets[k])

    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(sets))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(map(np.array_equal, results, expected))


@needs_cxx
def test_arguments_are_checked(rng):
    model = model_of(2, "planar")
    batch = dtc.batch(model, flags=QUICK_CXX)
    x, u, theta = robots(batch, model, 3, rng)
    wrong = {
        "ode: expected 3 arguments (x, u, theta), got 1": (x,),
        "ode: x: expected shape (4,) or (4, 'n'), got (3, 3)": (x[:3], u, theta),
        "ode: x: expected real numbers, got": (x + 1j, u, theta),
        "ode: expected arguments with a column for each robot, got [2, 3] columns": (
            x,
            u[:, :2],
            theta,
        ),
        "ode: expected arguments with a column for each robot, got none with columns": (
            x[:, 0],
            u[:, 0],
            theta[:, 0],
        ),
    }
    for message, arrays in wrong.items():
        with pytest.raises(ModelError) as caught:
            batch(*arrays)
        assert str(caught.value).startswith(message)
    for arguments in ((model, "odes"), (model.discrete(1e-3), "odes"), ("ode",), (model.ode, "x")):
        with pytest.raises(ModelError):
            dtc.batch(*arguments)


@needs_compiler
def test_a_kernel_that_lanes_cannot_take_runs_one_by_one():
    body = "if (A[0] > 0) B[0] = A[0]; else B[0] = -A[0];"
    x = ca.MX.sym("x")
    options = {"jit": False}
    dense = [ca.Sparsity.dense(1, 1)]
    kernel = ca.Function.jit("kernel", body, ["A"], ["B"], dense, dense, options)
    with pytest.warns(OneByOneWarning, match="compiler"):
        batch = dtc.batch(ca.Function("folded", [x], [kernel(x)], ["x"], ["y"]))
    assert np.array_equal(batch(np.array([[1.0, -2.0, 3.0]])), [[1.0, 2.0, 3.0]])
