"""Re-centring (`dtcasadi.recentring`): the motion stays, the coordinates start again at zero."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracles.cases import error, numbers
from oracles.chain import cartesian_accelerations, cartesian_velocities, spread
from oracles.robots import random_robot, rotation
from scipy.spatial.transform import Rotation

import dtcasadi as dtc
from dtcasadi import recentring as rc
from dtcasadi.bound import Bound
from dtcasadi.charts import CHARTS, convert_segment, pose_of, rates_map
from dtcasadi.kernels.recentring import absorbed, chart_change
from dtcasadi.presets import seed_four_disc
from dtcasadi.robot import Robot, Thread

CARDAN = CHARTS["cardan"]
N = 4
MIDDLE = [5 * i + k for i in range(N - 1) for k in (1, 3)]


@cache
def model() -> dtc.Model:
    return dtc.build(random_robot(np.random.default_rng(3), N), actuator="regulator")


def moved(robot: Robot, theta: np.ndarray) -> Robot:
    """The robot whose own A and B are those of theta's first block."""
    frames = theta[: 18 * len(robot.threads)].reshape(-1, 2, 3, 3).swapaxes(-1, -2)
    pairs = zip(robot.threads, frames, strict=True)
    return replace(robot, threads=tuple(replace(t, bend=f[0], twist=f[1]) for t, f in pairs))


def state(rng: np.random.Generator, widest: float = 1.4) -> np.ndarray:
    """A state whose middle angles lie outside 45 degrees, the others anywhere."""
    q = rng.uniform(-np.pi, np.pi, 15)
    q[MIDDLE] = rng.choice([-1, 1], 6) * rng.uniform(0.8, widest, 6)
    return np.concatenate([q, rng.normal(size=15), rng.uniform(1.0, 5.0, model().n_u)])


def frames_of(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    return np.concatenate([A.ravel(order="F"), B.ravel(order="F")])


def absorbing(q: np.ndarray, A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A' = A R_thread and B' = B R_disc by SciPy's rotations."""
    R_thread, R_disc = Rotation.from_euler("XY", q[:2]), Rotation.from_euler("XYZ", q[2:])
    return A @ R_thread.as_matrix(), B @ R_disc.as_matrix()


def closed_form(q: np.ndarray, B_new: np.ndarray) -> np.ndarray:
    """D = [[cos b, 0, 0], [0, 1, 0], [B'^T z sin b, 0, R_d^T [x, Rx(d) y, Rx(d) Ry(e) z]]]."""
    _, b, d, e, f = q
    y = Rotation.from_euler("X", d).apply([0.0, 1.0, 0.0])
    axes = np.array([[1.0, 0.0, 0.0], y, Rotation.from_euler("XY", [d, e]).apply([0.0, 0.0, 1.0])])
    D = np.zeros((5, 5))
    D[0, 0], D[1, 1] = np.cos(b), 1.0
    D[2:, 0] = B_new.T @ [0.0, 0.0, np.sin(b)]
    D[2:, 2:] = Rotation.from_euler("XYZ", [d, e, f]).inv().apply(axes).T
    return D


def test_jacobian_of_the_exact_change_is_the_closed_form(rng):
    """D, its determinant, and what it keeps: the rates of R_rel and of t, G' D = G."""
    for _ in range(50):
        A, B, q, qd = (
            rotation(rng),
            rotation(rng),
            rng.uniform(-np.pi, np.pi, 5),
            rng.normal(size=5),
        )
        A_new, B_new = absorbing(q, A, B)
        old, new = frames_of(A, B), frames_of(A_new, B_new)
        q_new, D, _ = numbers(chart_change(), q, qd, old, new)
        # Round-off of some ten rotations in a row.
        assert np.max(np.abs(q_new)) < 2e-15
        assert np.max(np.abs(numbers(absorbed(), q, old) - new)) < 2e-15
        assert np.max(np.abs(D - closed_form(q, B_new))) < 1e-13
        assert abs(np.linalg.det(D) - np.cos(q[1]) * np.cos(q[3])) < 1e-13
        before = rates_map(Thread(1.0, bend=A, twist=B), CARDAN.words, q)
        after = rates_map(Thread(1.0, bend=A_new, twist=B_new), CARDAN.words, np.zeros(5))
        assert np.max(np.abs(after @ D - before)) < 1e-13
        assert np.max(np.abs(np.linalg.pinv(after) @ before - D)) < 1e-13


def test_change_to_the_same_frames_is_the_identity(rng):
    frames = frames_of(rotation(rng), rotation(rng))
    q, qd = rng.uniform(-1.2, 1.2, 5), rng.normal(size=5)
    q_new, D, cross = numbers(chart_change(), q, qd, frames, frames)
    # Round-off over cos^2 of the middle angles, 0.13.
    assert np.max(np.abs(q_new - q)) < 1e-14
    assert np.max(np.abs(D - np.eye(5))) < 1e-13
    assert np.max(np.abs(cross)) < 1e-12


def test_poses_and_velocities_stay(rng):
    m, x = model(), state(rng)
    assert m.recentres and rc.off_centre(m, x) == (0, 1, 2)
    x_new, theta, _ = m.recentre(x, m.theta0)
    assert not np.any(x_new[:15]) and np.array_equal(x_new[30:], x[30:])
    robot = moved(m.robot, theta)
    for i, (old, new) in enumerate(zip(m.robot.threads, robot.threads, strict=True)):
        pose = pose_of(old, CARDAN.words, x[5 * i : 5 * i + 5])
        for before, after in zip(pose, pose_of(new, CARDAN.words, np.zeros(5)), strict=True):
            assert np.max(np.abs(after - before)) < 1e-15  # 3e-16 typically
    charts = spread("cardan", N)
    before = numbers(cartesian_velocities(m.robot, charts), x[:15], x[15:30])
    after = numbers(cartesian_velocities(robot, charts), x_new[:15], x_new[15:30])
    for value, expected in zip(after, before, strict=True):
        assert error(value, expected) < 1e-13
    for value, expected in zip(
        numbers(m.poses, x_new[:15], theta), numbers(m.poses, x[:15], m.theta0), strict=True
    ):
        assert error(value, expected) < 1e-14


def test_dynamics_stay(rng):
    """Energies, accelerations of every disc (oracle kinematics), M' = D^-T M D^-1, p' = D^-T p."""
    m, x = model(), state(rng, widest=1.0)
    x_new, theta, T = m.recentre(x, m.theta0)
    pressure, still = rng.uniform(1.0, 5.0, m.n_u), np.zeros(15)
    robots = m.robot, moved(m.robot, theta)
    energies, accelerations, masses, momenta = [], [], [], []
    for robot, now, th in zip(robots, (x, x_new), (m.theta0, theta), strict=True):
        q, qd = now[:15], now[15:30]
        kinetic, potential = m.kinetic_energy(q, qd, th), m.potential_energy(q, th)
        energies.append([float(kinetic), float(potential)])
        qdd = numbers(m.forward_dynamics, q, qd, pressure, still, th)
        kinematics = cartesian_accelerations(robot, spread("cardan", N))
        accelerations.append(np.vstack(numbers(kinematics, q, qd, qdd)))
        masses.append(numbers(m.mass_matrix, q, th))
        momenta.append(numbers(m.momenta, q, qd, th))
    assert error(np.array(energies[1]), np.array(energies[0])) < 1e-13
    assert error(accelerations[1], accelerations[0]) < 1e-11  # round-off times cond(M), 1e4
    C = rc.momentum_map(m, T)
    assert error(masses[1], C @ masses[0] @ C.T) < 1e-12  # round-off times cond(D)^2, 1e2
    assert error(momenta[1], C @ momenta[0]) < 1e-12


def test_covariance_map_is_the_derivative_of_the_exact_change(rng):
    """T against central differences of `charts.convert_segment` at the fixed new A, B."""
    m, x = model(), state(rng, widest=1.2)
    x[[6, 8]] = 0.5, -0.6  # the second segment is on its centre
    assert rc.off_centre(m, x) == (0, 2)
    _, theta, T = m.recentre(x, m.theta0)
    robot = moved(m.robot, theta)

    def change(x: np.ndarray) -> np.ndarray:
        result = x.copy()
        for i in (0, 2):
            q, qd = slice(5 * i, 5 * i + 5), slice(5 * i + 15, 5 * i + 20)
            ends = (m.robot.threads[i], CARDAN), (robot.threads[i], CARDAN)
            result[q], result[qd] = convert_segment(i + 1, *ends, x[q], x[qd])
        return result

    step = 1e-5
    columns = [(change(x + e) - change(x - e)) / (2 * step) for e in step * np.eye(m.n_x)]
    # Truncation step^2 times third derivatives (of order 10); round-off 1e-16 / step.
    assert np.max(np.abs(T - np.array(columns).T)) < 2e-8
    kept = np.r_[5:10, 20:25, 30 : m.n_x]
    assert np.array_equal(T[kept], np.eye(m.n_x)[kept])


def test_no_pose_is_singular_within_its_limit(rng):
    """The paper's robot, any pose within 45 degrees of its centre (arbitrary A and B).

    Over 1e4 such poses cond(M) has median 8e2, 99 % below 2.4e3, largest 4.9e3. It cannot exceed
    cond(D)^2 < 14 times that of the centred pose, at most 2.3e3.
    """
    m = dtc.build(seed_four_disc())
    mass = Bound(m.mass_matrix, matrices=frozenset({"M"}))
    conditions, ratios = [], []
    for _ in range(300):
        q = rng.uniform(-np.pi, np.pi, 15)
        q[MIDDLE] = rng.uniform(-rc.LIMIT, rc.LIMIT, 6)
        pairs = [(rotation(rng), rotation(rng)) for _ in range(3)]
        theta = np.concatenate([frames_of(*pair) for pair in pairs])
        conditions.append(np.linalg.cond(mass(q, theta)))
        _, centred, _ = rc.recentre(m, np.concatenate([q, 0 * q]), theta, range(3))
        ratios.append(conditions[-1] / np.linalg.cond(mass(0 * q, centred)))
    assert 6e2 < np.median(conditions) < 1.1e3
    assert np.percentile(conditions, 99) < 3.5e3 and max(conditions) < 6e3
    assert max(ratios) < 14


def test_a_singular_pose_is_left(rng):
    """At cos b = cos e = 0: the pose stays and becomes regular; no momenta belong to it."""
    m, x = model(), state(rng)
    x[MIDDLE] = np.pi / 2
    x_new, theta, T = m.recentre(x, m.theta0)
    assert np.linalg.cond(numbers(m.mass_matrix, x[:15], m.theta0)) > 1e12
    assert np.linalg.cond(numbers(m.mass_matrix, x_new[:15], theta)) < 1e5
    R, R_new = (numbers(m.poses, *at)[0] for at in ((x[:15], m.theta0), (x_new[:15], theta)))
    assert error(R_new, R) < 1e-14
    with pytest.raises(dtc.errors.ChartError, match="momenta: expected a pose that is not sing"):
        rc.momentum_map(m, T)


def unchanged(m: dtc.Model, x: np.ndarray) -> None:
    x_new, theta, T = m.recentre(x, m.theta0)
    assert np.array_equal(x_new, x) and np.array_equal(theta, m.theta0)
    assert np.array_equal(T, np.eye(m.n_x))


def test_identity_on_centre(rng):
    m, x = model(), state(rng)
    x[MIDDLE] = rng.uniform(-0.78, 0.78, 6)
    assert rc.off_centre(m, x) == ()
    unchanged(m, x)


@pytest.mark.parametrize(
    "options",
    [{"chart": "paper"}, {"chart": "planar"}, {"chart": "ball"}, {"damping": "coordinate"}],
)
def test_identity_where_the_model_cannot(rng, options):
    m = dtc.build(model().robot, **options)
    x = rng.uniform(-3.0, 3.0, m.n_x)
    assert not m.recentres and len(rc.guard_indices(m)) == 0 and rc.off_centre(m, x) == ()
    unchanged(m, x)
    with pytest.raises(dtc.errors.ChartError, match="segment 1 cannot re-centre: that takes"):
        rc.recentre(m, x, m.theta0, (0,))


def test_mixed_charts_and_other_parameters(rng):
    """Only a re-centred segment's part of x and theta changes."""
    robot = model().robot
    charts = ["planar", "cardan", "cardan"]
    m = dtc.build(robot, chart=charts, wrenches=(2,), parameters=("gravity",))
    assert rc.guard_indices(m).tolist() == [3, 5, 8, 10]
    x = rng.uniform(-0.7, 0.7, m.n_x)
    x[:2], x[10] = 2.0, -1.0
    theta = m.theta0 + rng.normal(size=len(m.theta0)) * (np.arange(len(m.theta0)) >= 36)
    x_new, theta_new, _ = m.recentre(x, theta)
    assert np.flatnonzero(x_new != x).tolist() == [*range(7, 12), *range(19, 24)]
    assert set(np.flatnonzero(theta_new != theta)) <= set(range(18, 36))
    for value, expected in zip(
        numbers(m.poses, x_new[:12], theta_new), numbers(m.poses, x[:12], theta), strict=True
    ):
        assert error(value, expected) < 1e-14


def test_frames_stay_rotations(rng):
    """1e5 re-centrings in a row, the products of which would drift by 1e-14 and more."""
    absorb = Bound(absorbed())
    absorb.inputs.frames[:] = frames_of(rotation(rng), rotation(rng))
    for q in rng.uniform(-np.pi, np.pi, (100_000, 5)):
        absorb.inputs.q[:] = q
        absorb.run()
        absorb.inputs.frames[:] = absorb.outputs.frames_new
    for R in absorb.inputs.frames.reshape(2, 3, 3):
        assert np.max(np.abs(R @ R.T - np.eye(3))) < 1e-15
        assert np.linalg.det(R) > 0


@pytest.mark.parametrize("chart", ["cardan", "paper"])
def test_unwound_is_the_conversion(rng, chart):
    """Coordinates after a re-centring equal those converted without it."""
    m, x = model(), state(rng)
    x[:15] = np.clip(x[:15], -1.4, 1.4)  # principal angles
    x_new, theta, _ = m.recentre(x, m.theta0)
    expected = dtc.convert(m.robot, x[:15], x[15:30], "cardan", chart)
    for value, wanted in zip(rc.unwound(m, x_new, theta, chart), expected, strict=True):
        assert error(value, wanted) < 1e-12  # round-off over cos of the middle angles, 0.17


def test_unwound_run_is_continuous():
    """A motion of several turns with middle angles past 45 degrees, re-centred as it goes."""
    m, n = model(), 200
    t = np.linspace(0.0, 1.0, n)
    phase = np.arange(15)[:, None]
    q = 1.2 * np.sin(7 * t + phase)
    q[[0, 5, 12]] = 20 * t - 0.1  # past three turns
    x, theta, count = np.zeros((m.n_x, n)), np.empty((len(m.theta0), n)), 0
    now = m.theta0
    for k in range(n):
        robot = moved(m.robot, now)
        for i, (own, centred) in enumerate(zip(m.robot.threads, robot.threads, strict=True)):
            mine = slice(5 * i, 5 * i + 5)
            ends = (own, CARDAN), (centred, CARDAN)
            x[mine, k] = convert_segment(i + 1, *ends, q[mine, k], np.zeros(5))[0]
        count += len(rc.off_centre(m, x[:, k]))
        x[:, k], now, _ = m.recentre(x[:, k], now)
        theta[:, k] = now
    assert count > 20
    value, rates = rc.unwound(m, x, theta, "cardan")
    assert np.max(np.abs(value - q)) < 1e-12 and rates.shape == q.shape


def test_unwound_refuses_what_the_chart_has_not(rng):
    m, x = model(), state(rng)
    with pytest.raises(dtc.errors.ChartError, match="segment 1: chart planar cannot represent"):
        rc.unwound(m, x, m.theta0, "planar")


def test_faults_are_named(rng):
    m, x = model(), state(rng)
    with pytest.raises(dtc.errors.ModelError, match=r"x: expected shape \(\d+,\), got \(3,\)"):
        m.recentre(x[:3], m.theta0)
    with pytest.raises(dtc.errors.ModelError, match=r"theta: expected shape \(54,\)"):
        m.recentre(x, m.theta0[:-1])
    x[20] = np.nan
    with pytest.raises(dtc.errors.ModelError, match="x: expected finite numbers to re-centre"):
        m.recentre(x, m.theta0)
    assert rc.off_centre(m, np.full(m.n_x, np.inf)) == ()


@pytest.mark.parametrize("off", range(8))
def test_the_graph_for_c_is_recentre(rng, off):
    """Any of the segments off centre, the others not."""
    m = model()
    x, theta = state(rng), m.theta0.copy()
    theta[: len(m.centres) * 18] = np.concatenate(
        [frames_of(rotation(rng), rotation(rng)) for _ in m.centres]
    )
    for place in m.centres:
        if not off >> place.segment & 1:
            x[place.q] = rng.uniform(-0.7, 0.7, 5)
    expected = m.recentre(x, theta)
    x_next, theta_next, count, D, cross = (v.full() for v in rc.recentre_function(m)(x, theta))
    np.testing.assert_allclose(x_next[:, 0], expected[0], atol=1e-14)
    np.testing.assert_allclose(theta_next[:, 0], expected[1], atol=1e-14)
    assert count[0, 0] == off.bit_count()
    T = np.eye(m.n_x)
    for k, place in enumerate(m.centres):
        q, block = place.q, slice(5 * k, 5 * k + 5)
        qd = slice(q.start + m.n_q, q.stop + m.n_q)
        T[q, q] = T[qd, qd] = D[:, block]
        T[qd, q] = cross[:, block]
    np.testing.assert_allclose(T, expected[2], atol=1e-13)
