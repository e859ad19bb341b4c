"""What the contacts of a run by time stepping did: computed again from its steps."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ..bound import Bound
from ..compile import twin
from .record import Contacts
from .start import rims
from .stepping import Impulses, for_contact, impulses

if TYPE_CHECKING:
    from ..integrators.problem import Trajectory
    from ..model import Model


@dataclass(frozen=True, eq=False)
class Touched:
    """Contacts and work of every step.

    Attributes:
        t: ends of the steps, the start before them, shape (n,) [s].
        contacts: at the end of each step, forces as means over it.
        work: of the impulses up to each time, shape (n,) [J].
        loss: what they take from the free motion in each step, never positive, shape (n - 1,) [J].
        projected: potential energy that projections gave, up to each time, shape (n,) [J].
        defect: largest defect of the cone problems.
    """

    t: np.ndarray
    contacts: Contacts
    work: np.ndarray
    loss: np.ndarray
    projected: np.ndarray
    defect: float


def stepped(model: "Model") -> Bound:
    """x, u, du, h, theta -> the `Impulses` of a step, compiled once."""

    def build() -> ca.Function:
        from ..integrators.steppers import plant_in, symbols

        found = []
        for native in (True, False):
            plant = for_contact(plant_in(model, native=native))
            at = symbols(plant)
            outputs = [ca.densify(part) for part in impulses(plant, at)]
            names = list(at._fields), list(Impulses._fields)
            found.append(ca.Function("impulses", list(at), outputs, *names, {"cse": True}))
        return twin(found[1], source=found[0])

    function = model.once("impulses", build)
    return Bound(function, matrices=("frame", "place"))


def touched(model: "Model", trajectory: "Trajectory", command: np.ndarray) -> Touched | None:
    """The contacts of a trajectory; None for a model without rigid ones.

    Args:
        model: the model.
        trajectory: its steps by method `moreau`.
        command: at the end of each step, shape (n_u, n - 1).
    """
    known = rims(model)
    if known is None:
        return None
    step, t, n = stepped(model), trajectory.t, model.n_q
    who = known.candidates.who
    none = np.zeros(model.n_u)
    rows: list[tuple] = []
    loss = np.zeros(len(t) - 1)
    work, projected, defect = np.zeros(len(t)), np.zeros(len(t)), 0.0
    for k, h in enumerate(np.diff(t)):
        theta = trajectory.thetas[:, k]
        found = step(trajectory.x[:, k], command[:, k], none, [h], theta)
        x_next, residual, p, which, frame, place, gap, done, lost, shift = found
        work[k + 1], loss[k] = float(done[0]), float(lost[0])
        defect = max(defect, float(residual[0]))
        if np.any(shift != 0):
            ends = x_next[:n], x_next[:n] - shift
            energies = [float(model.potential_energy(q, theta)) for q in ends]
            projected[k + 1] = energies[0] - energies[1]
        for s in np.flatnonzero(p[::3] > 0):
            axes = frame[:, s].reshape(3, 3)
            force = p[3 * s : 3 * s + 3] @ axes / h
            rows.append((t[k + 1], *who[int(which[s]) - 1], place[:, s].copy(), force, gap[s]))
    columns = list(zip(*rows, strict=True)) or [()] * 8
    when, disc, obstacle, point, plate, places, forces, gaps = columns
    contacts = Contacts(
        t=np.array(when, dtype=float),
        disc=np.array(disc, dtype=int),
        obstacle=np.array(obstacle, dtype=int),
        point=np.array(point, dtype=int),
        plate=np.array(plate, dtype=int),
        place=np.array(places, dtype=float).reshape(-1, 3),
        force=np.array(forces, dtype=float).reshape(-1, 3),
        gap=np.array(gaps, dtype=float),
    )
    return Touched(t, contacts, np.cumsum(work), loss, np.cumsum(projected), defect)
