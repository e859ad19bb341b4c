"""Whether a scene never leaves the y-z plane, and what would break that."""

from dataclasses import dataclass

import numpy as np

from ..actuation import settled
from ..charts import convert
from ..errors import ChartError
from ..model import Model
from ..scene import Scene

STATES, SEED = 8, 0
# Out-of-plane accelerations over the others: round-off times the condition of M.
VANISHES = 1e-9
# cardan: thread xy, disc xyz. Those about x stay in the plane.
_IN_PLANE = np.array([True, False, True, False, False])
# How long the actuator has been acting.
_LATER_S = 1e-3
_MIRROR = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Planarity:
    """Whether motion stays in the y-z plane of the root.

    Attributes:
        planar: whether it does.
        breaks: what is not symmetric about the plane, a phrase each.
        largest: largest out-of-plane acceleration relative to the others at random planar states.
    """

    planar: bool
    breaks: tuple[str, ...]
    largest: float

    def sentence(self) -> str:
        """For people."""
        if self.planar:
            return (
                "motion stays in the y-z plane: robot, loads and start are symmetric about it, and "
                f"out-of-plane accelerations vanish at {STATES} random planar states (largest "
                f"share {self.largest:.1e}). A payload or a load beside the plane, another "
                "pressure on one side, or a start out of it would break that. A model in space "
                "moves alike and costs more: none is run"
            )
        return f"motion leaves the y-z plane: {'; '.join(self.breaks)}"


def planarity(scene: Scene, model: Model) -> Planarity:
    """Look at a scene's symmetry about the plane x = 0, and test its equations.

    Mirror images move alike: where robot and loads are their own image, a planar state has no
    acceleration out of the plane. What the symmetry of the parts says is held against the
    equations: accelerations in chart cardan at random planar states, under the profile's pressures.

    Args:
        scene: the scene.
        model: its model in chart cardan for all segments.
    """
    breaks = [*_start(scene), *_parts(scene)]
    largest = _largest(scene, model)
    if largest > VANISHES and not breaks:
        breaks.append("a force or a chamber acts beside the plane")
    return Planarity(not breaks and largest <= VANISHES, tuple(breaks), largest)


def _start(scene: Scene) -> list[str]:
    charts = scene.initial_chart
    assert charts is not None
    try:
        target = ["planar"] * len(charts)
        convert(scene.robot, scene.q0, scene.qd0, charts, target)
    except ChartError as error:
        text = " ".join(str(error).split())
        return [f"the robot starts out of the plane, or is bent out of it at rest ({text})"]
    return []


def _parts(scene: Scene) -> list[str]:
    """Parts that are not their own mirror image."""
    robot, found = scene.robot, []
    if abs(robot.up[0]) > VANISHES and robot.gravity:
        found.append("gravity has a part along x")
    turned = [
        i
        for i, thread in enumerate(robot.threads, 1)
        if any(_off(rotation) for rotation in (thread.bend, thread.twist))
    ]
    if turned:
        found.append(f"threads {_some(turned)} are bent or twisted out of the plane at rest")
    beside = [
        i
        for i, disc in enumerate(robot.discs, 1)
        if _off(disc.inertia) or abs(disc.centre_of_mass[0]) > VANISHES * _size(disc.centre_of_mass)
    ]
    if beside:
        found.append(f"discs {_some(beside)} have mass beside the plane")
    return found


def _off(matrix: np.ndarray) -> bool:
    scale = float(np.abs(matrix).max()) or 1.0
    return bool(np.abs(_MIRROR @ matrix @ _MIRROR - matrix).max() > VANISHES * scale)


def _size(vector: np.ndarray) -> float:
    return float(np.linalg.norm(vector)) or 1.0


def _some(numbers: list[int]) -> str:
    words = [str(number) for number in numbers[:4]]
    return ", ".join(words) + (" ..." if len(numbers) > 4 else "")


def _largest(scene: Scene, model: Model) -> float:
    """Share of out-of-plane accelerations at random planar states."""
    rng = np.random.default_rng(SEED)
    n = model.n_q
    inside = np.tile(_IN_PLANE, n // len(_IN_PLANE))
    ode = model.plain("ode")
    shares = []
    rows = rng.integers(len(scene.pressure.values), size=STATES)
    rest = scene.x0(model)[2 * n :]
    follows = model.actuator.command == "pressure"
    for row in rows:
        q, qd = (inside * rng.uniform(-0.4, 0.4, n) for _ in range(2))
        u = scene.pressure.values[row]
        # What the command brings the chambers to, or on the way there.
        z = settled(model, q, u) if follows else rest
        xdot = np.array(ode(np.concatenate([q, qd, z]), u, model.theta0)).ravel()
        z = z + _LATER_S * xdot[2 * n :]
        qdd = np.array(ode(np.concatenate([q, qd, z]), u, model.theta0)).ravel()[n : 2 * n]
        scale = float(np.abs(qdd).max()) or 1.0
        shares.append(float(np.abs(qdd[~inside]).max(initial=0.0)) / scale)
    return max(shares)
