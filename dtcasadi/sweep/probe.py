"""What is looked at in a run: one Function of the state, evaluated at no more than 201 instants."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..checks import shown
from ..errors import SweepError
from ..graphs import Graphs
from ..model import Model

QUANTITIES = {
    "x": "state [q; qd; actuator states]",
    "q": "coordinates [rad]",
    "qd": "their rates [rad/s]",
    "tip": "centre of mass of the last disc [m]",
    "origins": "origin of every disc's frame [m]",
    "pressure": "gauge pressure in each chamber [Pa]",
    "volume": "of each chamber's air [m^3]",
    "thread_tension": "of each thread [N]",
    "kinetic_energy": "[J]",
    "potential_energy": "[J]",
}
REDUCED = ("final", "min", "max", "path")
_SAVE = re.compile(rf"({'|'.join(QUANTITIES)})(?:\.({'|'.join(REDUCED)}))?")
# Of these every instant counts; of the others the last one, unless `save` says otherwise.
FOLLOWED = ("kinetic", "potential", "stored", "cos_tilt", "strain")
_ALWAYS = ("kinetic", "potential", "stored", "tip", "tip_rotation", "cos_tilt", "strain")


def checked_save(save: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Quantities to save and how: (quantity, one of `REDUCED`).

    Raises:
        SweepError: an unknown name.
    """
    found: dict[tuple[str, str], None] = {}
    for name in [save] if isinstance(save, str) else save:
        match = _SAVE.fullmatch(name) if isinstance(name, str) else None
        if not match:
            expected = f"one of {', '.join(QUANTITIES)}, with .{', .'.join(REDUCED)} or nothing"
            raise SweepError(f"save: expected {expected}, got {shown(name)}")
        found[match[1], match[2] or "final"] = None
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Probe:
    """A Function x, u, theta -> values, the parts stacked; `parts` names their rows."""

    function: ca.Function
    parts: Mapping[str, slice]

    def split(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """Stacked values, rows first, by part."""
        return {name: values[rows] for name, rows in self.parts.items()}

    def followed(self, save: Sequence[tuple[str, str]]) -> "Followed":
        """The rows that matter at every instant, for quantities saved as `save` says."""
        names = [*FOLLOWED, *(f"save_{name}" for name, how in save if how != "final")]
        rows = {name: np.arange(*self.parts[name].indices(10**9)) for name in names}
        return Followed(np.concatenate(list(rows.values())), places_of(rows))


class Followed(NamedTuple):
    """Rows of a probe's values, and where each part is among them."""

    rows: np.ndarray
    parts: dict[str, slice]


def places_of(parts: Mapping[str, Any]) -> dict[str, slice]:
    """Where each part begins and ends when all are stacked."""
    ends = np.cumsum([0, *(np.size(part) for part in parts.values())]).tolist()
    return {name: slice(*ends[k : k + 2]) for k, name in enumerate(parts)}


def probe_of(model: Model, quantities: Sequence[str]) -> Probe:
    """The probe of a model: energies, the tip, tilt and strain, and the quantities asked for."""
    g = model.graphs[1]
    x, u = ca.MX.sym("x", model.n_x), ca.MX.sym("u", model.n_u)
    theta = ca.MX.sym("theta", len(model.theta0))
    q, qd, _ = ca.vertsplit(x, [0, model.n_q, 2 * model.n_q, model.n_x])
    R, r = model.plain("poses")(q, theta)
    last, tilt = R[:, -3:], [R[2, 3 * i + 2] for i in range(1, model.n_discs)]
    centre = ca.DM(model.robot.discs[-1].centre_of_mass)
    values = {
        "kinetic": model.plain("kinetic_energy")(q, qd, theta),
        "potential": model.plain("potential_energy")(q, theta),
        "stored": model.plain("power")(x, u, theta)[2],
        "tip": r[:, -1] + ca.mtimes(last, centre),
        "tip_rotation": ca.vec(last),
        "cos_tilt": _extreme(ca.fmin, tilt),
        "strain": strain_of(g)(q, theta),
    }
    more = {
        "x": lambda: x,
        "q": lambda: q,
        "qd": lambda: qd,
        "origins": lambda: ca.vec(r),
        "pressure": lambda: model.plain("air")(x, u, theta)[0],
        "volume": lambda: model.plain("volume")(q, values["air"], theta),
        "thread_tension": lambda: model.plain("thread_tension")(
            q, qd, values["air"], ca.MX(model.n_q, 1), theta
        ),
        "kinetic_energy": lambda: values["kinetic"],
        "potential_energy": lambda: values["potential"],
    }
    values["air"] = model.plain("air")(x, u, theta)[0]
    parts = {name: values[name] for name in _ALWAYS}
    parts |= {f"save_{name}": more[name]() for name in quantities if name != "tip"}
    places = places_of({name: np.zeros(part.numel()) for name, part in parts.items()})
    if "tip" in quantities:
        places["save_tip"] = places["tip"]
    stacked = ca.vertcat(*(ca.densify(ca.vec(part)) for part in parts.values()))
    function = ca.Function("probe", [x, u, theta], [stacked], ["x", "u", "theta"], ["values"])
    return Probe(function, places)


def strain_of(g: Graphs) -> ca.Function:
    """Largest relative lengthening of the springs, (|d| - L) / L; those with L = 0 left out."""
    R, r = g.chain.poses(g.chain.segments(g.q))
    strains = []
    for springs in g.chain.numbers.springs:
        i, j = (disc - 1 for disc in springs.discs)
        for m in range(springs.stiffness.shape[0]):
            rest = springs.rest_length[m]
            if rest.is_constant() and float(rest) == 0:
                continue
            ends = [
                r[k] + ca.mtimes(R[k], arm[:, m])
                for k, arm in ((i, springs.start), (j, springs.end))
            ]
            strains.append(ca.norm_2(ends[1] - ends[0]) / rest - 1)
    value = _extreme(ca.fmax, strains) if strains else 0.0 * g.q[0]
    return ca.Function("strain", [g.q, g.theta], [ca.densify(value)], ["q", "theta"], ["strain"])


def _extreme(pick, values):  # noqa: ANN001, ANN202
    result = values[0]
    for value in values[1:]:
        result = pick(result, value)
    return result
