"""Chains, pendulums, discs and tops: what discs and threads represent without discretizing.

Only the hanging chain is an approximation here; the others are exact up to the integration.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import references

if TYPE_CHECKING:
    from ..robot import Robot

_G = 9.81
_TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}


class Exact(NamedTuple):
    """A value that no number of discs improves."""

    reference: float
    n_discs: int
    value: float


def hanging(masses: list[float], length: float) -> "Robot":
    """Links hanging along z, a mass where the next thread joins; the discs' inertia decouples."""
    from ..parts import Disc, Thread
    from ..robot import Robot

    inertia = 1e-14 * length**2 * np.eye(3)
    discs = [Disc(mass, mass * inertia) for mass in (1.0, *masses)]
    up = np.array([0.0, 0.0, -1.0])
    return Robot(discs, (Thread(length),) * len(masses), up=up, gravity=_G)  # type: ignore[arg-type]


def chain_references() -> dict[str, float]:
    """Each anchor of a hanging chain and its reference."""
    return {f"hanging_chain_{k}": float(f) for k, f in enumerate(references.hanging_chain(3), 1)}


def chain_frequencies(n_discs: int) -> dict[str, float]:
    """Angular frequencies of a hanging chain in sqrt(g / L)."""
    n = n_discs - 1
    # Half of both neighbouring segments' mass.
    robot = hanging([1 / n] * (n - 1) + [0.5 / n], 1 / n)
    squares = _swings(robot)[:3] / _G
    return {f"hanging_chain_{k}": math.sqrt(s) for k, s in enumerate(squares, 1)}


def exact_values() -> dict[str, Exact]:
    """Every exact anchor."""
    names = ("n_pendulum_3", "n_pendulum_3_f2", "n_pendulum_3_f3")
    swings = _swings(hanging([2.0] * 3, 0.4)) * 0.4 / _G
    pairs = zip(names, references.pendulums(3), swings, strict=True)
    found = {name: Exact(float(known), 4, float(value)) for name, known, value in pairs}
    found["large_pendulum"] = Exact(references.large_pendulum(math.pi / 2), 2, _pendulum_period())
    energy, momentum = _torque_free()
    found["torque_free_energy"] = Exact(1.0, 2, energy)
    found["torque_free_momentum"] = Exact(1.0, 2, momentum)
    found["sleeping_top"] = Exact(1.0, 2, _top())
    return found


def _swings(robot: "Robot") -> np.ndarray:
    """Squared angular frequencies about the hanging pose, ascending."""
    from scipy.linalg import eigh

    from ..model import build

    model = build(robot, chart="hinge")
    still = np.zeros(model.n_q)
    ports = (still, still, still, np.zeros(0), model.theta0)
    stiffness = np.array(model.inverse_dynamics_jacobian(*ports)[0])
    return eigh(stiffness, np.array(model.mass_matrix(still, model.theta0)), eigvals_only=True)


def _pendulum_period() -> float:
    """Period of a swing of 90 degrees over that of small ones."""
    from ..model import build
    from ..simulate import simulate

    length = 0.7
    model = build(hanging([2.0], length), chart="hinge")
    small = 2 * math.pi * math.sqrt(length / _G)
    quarter = references.large_pendulum(math.pi / 2) * small / 4
    run = simulate(model, [math.pi / 2, 0.0], t_end=quarter, **_TIGHT)  # type: ignore[arg-type]
    angle, rate = run.x[:, -1]
    return 4 * (quarter - angle / rate) / small  # it hangs now, or almost


def _torque_free() -> tuple[float, float]:
    """Energy and angular momentum of a tumbling disc after 5 s, of those at the start."""
    from ..model import build
    from ..parts import Disc, Thread
    from ..robot import Robot
    from ..simulate import simulate

    inertia = np.array([[1.0, 0.05, 0.1], [0.05, 1.6, -0.08], [0.1, -0.08, 2.2]])
    robot = Robot((Disc(1.0, np.eye(3)), Disc(3.0, inertia)), (Thread(0.5),))
    model = build(robot, chart="ball")
    run = simulate(model, [0.2, -0.1, 0.3, 0.4, 0.5, 6.0], t_end=5.0, **_TIGHT)  # type: ignore[arg-type]
    R = run.poses(np.array([0, -1]))[0][:, 1]
    table = [np.array(model.angular_jacobians(run.q[:, k], model.theta0)) for k in (0, -1)]
    spin = [J @ run.qd[:, k] for J, k in zip(table, (0, -1), strict=True)]
    energies = [w @ inertia @ w for w in spin]
    momenta = [turn @ inertia @ w for turn, w in zip(R, spin, strict=True)]
    drift = np.linalg.norm(momenta[1] - momenta[0]) / np.linalg.norm(momenta[0])
    return float(energies[1] / energies[0]), float(1 + drift)


def _top() -> float:
    """Squared spin at which a sleeping top falls over, of 4 A m g l / C^2, A about the pivot."""
    from scipy.optimize import bisect

    from ..model import build
    from ..parts import Disc, Thread
    from ..robot import Robot

    m, height, axial, across = 1.3, 0.4, 0.5, 0.45
    top = Disc(m, np.diag([across, across, axial]), np.array([0.0, 0.0, height]))
    up = np.array([0.0, 0.0, 1.0])
    robot = Robot((Disc(1.0, np.eye(3)), top), (Thread(0.2),), up=up, gravity=_G)
    model = build(robot, chart="ball")
    critical = 4 * (across + m * height**2) * m * _G * height / axial**2
    leaning = np.ix_([0, 1, 3, 4], [0, 1, 3, 4])  # the angle of the spin is free

    def falls(share: float) -> float:
        spinning = [0.0] * 5 + [math.sqrt(share * critical)]
        F_x = np.array(model.ode_jacobian(spinning, np.zeros(0), model.theta0)[1])
        # Where it neither falls nor rights itself, round-off of a double root.
        return 1.0 if np.linalg.eigvals(F_x[leaning]).real.max() > 1e-6 else -1.0

    return float(bisect(falls, 0.5, 1.5, xtol=1e-10))
