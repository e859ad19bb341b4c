"""Prediction and update of a scheduled observer as CasADi Functions over tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from dtcasadi.waist import Discrete

from .augmented import Layout
from .covariance import finite_ones
from .operating import OperatingPoints
from .subsystems import Subsystem


@dataclass(frozen=True, eq=False)
class Tables:
    """The subsystems of every branch, and how they are chosen.

    Attributes:
        discrete: the model.
        layout: what is estimated.
        points: the operating points.
        subsystems: of each branch at each point.
        width: change of place from the middle between the branches to one of them.
        gauge: the sensor that schedules; None: the command.
    """

    discrete: Discrete
    layout: Layout
    points: OperatingPoints
    subsystems: list[list[Subsystem]]
    width: float
    gauge: str | None

    def ports(self) -> dict[str, ca.MX]:
        """Symbols x, theta, schedule, u."""
        n_u = self.points.commands.shape[1]
        n_theta = len(self.discrete.theta0)
        sizes = {"x": self.layout.n_x, "theta": n_theta, "schedule": 2, "u": n_u}
        return {name: ca.MX.sym(name, size) for name, size in sizes.items()}

    def z(self, ports: dict[str, ca.MX]) -> ca.MX:
        """What is estimated."""
        return ca.vertcat(ports["x"], ports["theta"][list(self.layout.free)])

    def moved(self, schedule: ca.MX, pressures: ca.MX) -> ca.MX:
        """The schedule when the pressures are known anew."""
        first = ca.DM(self.points.commands[0])
        place = ca.dot(ca.DM(self.points.direction), pressures - first)
        branch = schedule[1] + (place - schedule[0]) / self.width
        return ca.vertcat(place, ca.fmin(ca.fmax(branch, -1), 1))

    def felt(self, schedule: ca.MX, u: ca.MX) -> ca.MX:
        """The command less what hysteresis takes on the branches in force."""
        shifts = self.points.felt[:, 0] - self.points.commands[0]
        return u + sum(
            (
                share * ca.DM(shift)
                for share, shift in zip(self._shares(schedule), shifts, strict=True)
            ),
            ca.MX(0),
        )

    def _shares(self, schedule: ca.MX) -> list[ca.MX]:
        """Weight of each branch."""
        if len(self.subsystems) == 1:
            return [ca.MX(1)]
        return [(1 + schedule[1]) / 2, (1 - schedule[1]) / 2]

    def weighted(
        self, schedule: ca.MX, term: Callable[[Subsystem], np.ndarray], by: ca.MX | None = None
    ) -> ca.MX:
        """Sum of w_j T_j over the subsystems in force, or of w_j T_j by; shape (n, m) or (n, 1)."""
        places, total = self.points.places, None
        rows, columns = term(self.subsystems[0][0]).shape
        for share, branch in zip(self._shares(schedule), self.subsystems, strict=True):
            table = ca.MX(ca.DM(np.column_stack([term(s).ravel("F") for s in branch])))
            for column, weight in _between(places, schedule[0]):
                part = ca.reshape(table[:, column], rows, columns)
                part = part if by is None else ca.mtimes(part, by)
                total = share * weight * part if total is None else total + share * weight * part
        assert total is not None
        return total


def _between(places: np.ndarray, place: ca.MX) -> list[tuple[ca.MX, ca.MX]]:
    """The columns of the two points around a place, evenly spaced or not, and their weights."""
    n = len(places)
    if n == 1:
        return [(ca.MX(0), ca.MX(1))]
    passed = [place >= p for p in places[1:-1]]
    left = sum(passed, ca.MX(0))
    starts, gaps = ca.MX(ca.DM(places[:-1])), ca.MX(ca.DM(np.diff(places)))
    share = ca.fmin(ca.fmax((place - starts[left]) / gaps[left], 0), 1)
    return [(left, 1 - share), (left + 1, share)]


def prediction(t: Tables) -> ca.Function:
    """Function predict: x, theta, schedule, u -> x_next, schedule_next."""
    ports = t.ports()
    schedule = ports["schedule"]
    if t.gauge is None:
        schedule = t.moved(schedule, ports["u"])
    known = ca.vertcat(t.z(ports), ports["u"], 1)
    x_next = t.weighted(schedule, lambda s: np.column_stack([s.A, s.c]), known)
    return _function("predict", ports, x_next=x_next, schedule_next=schedule)


def correction(t: Tables, sensor: str, limits: np.ndarray) -> ca.Function:
    """Function update_<sensor>: x, theta, schedule, u, y -> what `EKF`'s gives, and the schedule.

    Args:
        t: the subsystems.
        sensor: what is measured.
        limits: largest e^T S^-1 e believed by number of finite readings, shape (n_y + 1,).
    """
    ports = t.ports()
    y = ca.MX.sym("y", len(limits) - 1)
    finite = finite_ones(y)
    schedule, n_x = ports["schedule"], t.layout.n_x
    if sensor == t.gauge:
        all_read = ca.sum1(finite) == y.shape[0]
        schedule = ca.if_else(all_read, t.moved(schedule, ca.if_else(finite, y, 0)), schedule)
    z = t.z(ports)
    # The gauge reads what the supply gives, the robot moves by what hysteresis leaves of it.
    u = ports["u"] if sensor == t.gauge else t.felt(schedule, ports["u"])
    output = t.discrete.sensors[sensor].output
    e = ca.if_else(finite, y - output.call([ports["x"], u, ports["theta"]], True, False)[0], 0)
    change = t.weighted(schedule, lambda s: s.readings[sensor].K, e)
    nis = ca.dot(e, t.weighted(schedule, lambda s: s.readings[sensor].S_inverse, e))
    used = ca.sum1(finite)
    believed = nis <= ca.dot(ca.DM(limits), ca.DM(np.arange(len(limits))) == used)
    z = z + believed * change
    theta = ca.MX(ports["theta"])
    if t.layout.free:
        theta[list(t.layout.free)] = z[n_x:]
    schedule = ca.if_else(believed, schedule, ports["schedule"])
    outputs = {"x_next": z[:n_x], "theta_next": theta, "schedule_next": schedule}
    outputs |= {"nis": nis, "used": used, "believed": believed}
    return _function(f"update_{sensor}", ports | {"y": y}, **outputs)


def covariance(t: Tables, sensor: str | None) -> ca.Function:
    """Function: schedule -> P (n_z, n_z), before the sensors or behind one of them."""
    schedule = ca.MX.sym("schedule", 2)
    P = t.weighted(schedule, lambda s: s.readings[sensor].P if sensor else s.P)
    name = f"covariance_{sensor}" if sensor else "covariance"
    return ca.Function(name, [schedule], [ca.densify(P)], ["schedule"], ["P"])


def _function(name: str, ports: dict[str, ca.MX], **outputs: ca.MX) -> ca.Function:
    values = [ca.densify(value) for value in outputs.values()]
    names = (list(ports), list(outputs))
    return ca.Function(name, [*ports.values()], values, *names, {"cse": True})
