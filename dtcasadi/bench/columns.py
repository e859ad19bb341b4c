"""A slender rod of discs and threads, asked for what beams are known to do.

Length, EI and mass are 1. In the plane: no anchor leaves it, and twist costs nothing there.
"""

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from . import references

if TYPE_CHECKING:
    from ..model import Model
    from ..statics import Equilibrium

# GA l^2 / EI of a segment l: so stiff that shear has a small share in the errors at any number of
# discs, most often below a fiftieth, and soft enough to leave the bending its digits.
SHEAR = 1e4
FORCES, WEIGHTS = (0.5, 1, 2, 5, 10), (1, 5, 10)
_SHAPE = ("drop", "shortening", "angle")
_UP, _ACROSS = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)


def beam_references() -> dict[str, float]:
    """Each beam anchor and its reference."""
    known: dict[str, float] = {}
    loads = [("tip_load", force, force, 0.0) for force in FORCES]
    loads += [("heavy_elastica", weight, 0.0, weight) for weight in WEIGHTS]
    for name, load, force, weight in loads:
        known |= _named(name, load, references.elastica(force, weight))
    known["euler"] = references.EULER
    known["greenhill"] = references.greenhill()
    known["end_moment_circle"] = 1 / (4 * math.pi)
    known["beck"] = references.beck()
    known["beck_damped"] = references.beck_damped()
    known["inflated_tube"] = 1.0
    known |= {f"cantilever_f{k}": f for k, f in enumerate(references.cantilever(3), 1)}
    return known


class Column:
    """The rod in n_discs - 1 segments.

    Attributes:
        n_discs: the root included.
        shear: GA in units of EI.
    """

    def __init__(self, n_discs: int, softer: float = 1.0):
        self.n_discs = n_discs
        self.shear = SHEAR * (n_discs - 1) ** 2 / softer

    @cached_property
    def model(self) -> "Model":
        """Its model; gravity, its direction and a load on the last disc are free."""
        from ..model import build
        from ..robot import Chamber, Robot
        from ..statics.search import virtual_search

        rod = Robot.from_rod(1.0, 1.0, self.shear, 0.1, 1.0, self.n_discs, gravity=0.0)
        # Pressure on an area of 1 is a follower force.
        chamber = Chamber((1, self.n_discs), areas=np.ones(self.n_discs))
        model = build(
            replace(rod, chambers=(chamber,)),
            chart="planar",
            parameters=("gravity", "up"),
            wrenches=(self.n_discs,),
        )
        virtual_search(model)
        return model

    def values(self) -> dict[str, float]:
        """What it says of every beam anchor."""
        found: dict[str, float] = {}
        for force in FORCES:
            found |= _named("tip_load", force, self._bent(force, 0.0))
        for weight in WEIGHTS:
            found |= _named("heavy_elastica", weight, self._bent(0.0, weight))
        found["euler"] = self._buckles({"wrench": [0, 0, -1, 0, 0, 0]}, 4.0)
        found["greenhill"] = self._buckles("gravity", 12.0)
        found["end_moment_circle"] = self._circle()
        found["beck"] = self._beck()
        found["beck_damped"] = self._beck_damped()
        found["inflated_tube"] = inflated_tube(self.n_discs)
        frequencies = self._straight().frequencies
        return found | {f"cantilever_f{k + 1}": float(frequencies[k]) for k in range(3)}

    def _theta(self, weight: float = 0.0, up: tuple = _ACROSS, load: tuple = ()) -> np.ndarray:
        theta, blocks = self.model.theta0.copy(), self.model.theta_blocks
        theta[blocks["gravity"]], theta[blocks["up"]] = weight, up
        theta[blocks["wrench"]][: len(load)] = load
        return theta

    def _straight(self, pressure: float = 0.0) -> "Equilibrium":
        """The straight rod under a follower force: an equilibrium whether stable or not."""
        from ..statics import equilibrium

        still = np.zeros(self.model.n_q)
        return equilibrium(self.model, pressure, guess=still, theta=self._theta())

    def _bent(self, force: float, weight: float) -> tuple[float, float, float]:
        """Drop, shortening and tip angle under a dead force and its own weight."""
        from ..statics import equilibrium

        found = equilibrium(self.model, theta=self._theta(weight, load=(0.0, -force)))
        rotations, origins = found.poses
        axis = rotations[-1][:, 2]
        return float(-origins[-1][1]), float(1 - origins[-1][2]), math.atan2(-axis[1], axis[2])

    def _buckles(self, load: object, most: float) -> float:
        """Where the straight column loses its stability."""
        from ..statics import branch

        path = branch(self.model, load, 0.0, most, theta=self._theta(up=_UP), points=2)  # type: ignore[arg-type]
        return path.events[0].s

    def _circle(self) -> float:
        """The area that the rod encloses under an end moment of 2 pi."""
        from ..statics import branch

        turn = {"wrench": [0, 0, 0, 1, 0, 0]}
        path = branch(self.model, turn, 0.0, 2 * math.pi, theta=self._theta(), points=8)
        x, y = path.points[-1].poses[1][:, 1:].T
        return float(abs(np.sum(x[:-1] * y[1:] - y[:-1] * x[1:])) / 2)

    def _beck(self) -> float:
        """Where two frequencies meet: their difference squared passes zero smoothly."""
        from scipy.optimize import brentq

        def apart(force: float) -> float:
            small = self._straight(-force).stability
            assert small is not None  # the straight rod balances any follower force
            squares = small.squared_frequencies[:2]
            return float(np.real((squares[0] - squares[1]) ** 2))

        return float(brentq(apart, 15.0, 35.0, rtol=1e-9))

    def _beck_damped(self) -> float:
        """Where small damping in proportion to the elastic stiffness feeds the first mode."""
        import scipy.linalg
        from scipy.optimize import brentq

        elastic = self._straight().stability.K  # type: ignore[union-attr]

        def taken(force: float) -> float:
            small = self._straight(-force).stability
            assert small is not None
            squares, left, right = scipy.linalg.eig(small.K, small.M, left=True)
            first = int(np.argmin(squares.real))
            v, w = right[:, first].real, left[:, first].real
            return float(w @ elastic @ v / (w @ small.M @ v))

        return float(brentq(taken, 5.0, 18.0, rtol=1e-9))


def inflated_tube(n_discs: int) -> float:
    """Angle [rad] that a tube with a strip takes under the pressure 3 E t / L: one, by p / (3 E t).

    Five diameters long, without weight; inflated by `volume`.
    """
    from ..model import build
    from ..robot import Robot
    from ..statics import equilibrium
    from ..statics.search import virtual_search

    wall = 0.01
    tube = Robot.from_tube(1.0, 0.1, wall, 1.0, 0.5, 1.0, n_discs, gravity=0.0)
    model = build(tube, chart="planar", inflation="volume")
    virtual_search(model)
    return float(equilibrium(model, 3 * wall).q.sum())


def _named(name: str, load: float, values: tuple[float, float, float]) -> dict[str, float]:
    text = f"{load:g}".replace(".", "_")
    return {f"{name}_{text}_{part}": v for part, v in zip(_SHAPE, values, strict=True)}
