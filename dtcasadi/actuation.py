"""Actuators at work in a model's graphs: what they see of the robot, and what they give it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from .acting import act, breathing, enclosed
from .actuators import Accounts, Actuator, Air, Direct, Signals
from .actuators.fields import filled
from .errors import ModelError
from .forces.inflation import INFLATION

if TYPE_CHECKING:
    from .graphs import Graphs
    from .model import Model

_UNIT, _NONE = ca.DM(1), ca.DM(0)


def volumes(g: Graphs, segments: list, *, swollen: bool = False) -> ca.SX:
    """Volume of each chamber [m^3]: without pressure, or with every outline twice as large."""
    parts = unit_forces(g, "volume", _UNIT if swollen else _NONE)
    return _column(g, [enclosed(g.chain, each, segments) for each in parts])


def unit_forces(g: Graphs, inflation: str, growth: ca.DM) -> list[list]:
    """The forces of a unit of pressure in each chamber, the outlines 1 + growth times as large."""
    make = INFLATION[inflation]
    return [
        make(chamber.discs, numbers._replace(radial_compliance=growth), _UNIT)
        for chamber, numbers in g.chambers
    ]


def unit_powers(g: Graphs, segments: list, qd: ca.SX) -> ca.SX:
    """Power that a unit of pressure at the last disc of each chamber gives the robot [m^3/s]."""
    chain = g.chain
    motion = chain.motion(segments, qd)
    speeds = chain.velocities(motion)
    values = []
    for forces in unit_forces(g, "last_disc", _NONE):
        loads = chain.total(act(chain, forces, segments, g.still))
        values.append(
            sum(
                chain.asm.call(_power, *loads[i], motion.w(i), speeds[i])
                for i in range(1, len(loads))
            )
        )
    return _column(g, values)


def _power(moment: ca.SX, force: ca.SX, w: ca.SX, v: ca.SX) -> ca.SX:
    return ca.dot(moment, w) + ca.dot(force, v)


def _column(g: Graphs, values: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*values) if values else g.chain.asm.expression(0, 1)


def air_of(g: Graphs, q: ca.SX, qd: ca.SX) -> Air:
    """What the actuator sees of the chambers; zero what it does not look at."""
    actuator, n = g.options.actuator, g.u.shape[0]
    nothing = g.chain.asm.expression(n, 1)
    segments = g.chain.segments(q)
    volume = bulge = volume_rate = nothing
    growth = _compliances(g)
    if actuator.sees_volume_rate and g.options.inflation == "volume":
        parts = unit_forces(g, "volume", _NONE)
        found = [breathing(g.chain, each, segments, qd) for each in parts]
        volume, volume_rate = (_column(g, [pair[k] for pair in found]) for k in range(2))
    else:
        if actuator.sees_volume:
            volume = volumes(g, segments)
        if actuator.sees_volume_rate:
            volume_rate = unit_powers(g, segments, qd)
    if actuator.sees_volume and growth.nnz():
        bulge = volumes(g, segments, swollen=True) / 4 - volume
    seen = actuator.sees_volume or actuator.sees_volume_rate
    rest = g.rest_volume if seen else ca.DM.ones(n)
    return Air(volume, volume_rate, rest, growth, bulge)


def _compliances(g: Graphs) -> ca.SX:
    parts = [numbers.radial_compliance for _, numbers in g.chambers]
    values = ca.vertcat(*parts) if parts else ca.DM(0, 1)
    return ca.sparsify(values) if isinstance(values, ca.DM) else values


def rest_volume(g: Graphs, theta: np.ndarray) -> ca.DM:
    """Volumes at q = 0 with the robot's own numbers [m^3].

    Raises:
        ModelError: a chamber has none there.
    """
    value = volumes(g, g.chain.segments(g.q))
    found = ca.Function("rest_volume", [g.q, g.theta], [ca.densify(value)])(0, theta)
    for k, each in enumerate(found.full().ravel(), 1):
        if not each > 0:
            raise ModelError(
                f"actuator: expected chambers with a positive volume at q = 0, got {each:g} m^3 "
                f"in chamber {k}"
            )
    return found


def actuated(g: Graphs, q: ca.SX, qd: ca.SX, state: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Pressures that push on the robot, and the rate of the actuator's states."""
    if type(g.options.actuator) is Direct:
        return u, g.chain.asm.expression(0, 1)
    return g.chain.asm.call(_actuated, *_parts(g), state, u, air_of(g, q, qd))


def _actuated(
    actuator: Actuator, paths: tuple, numbers: tuple, state: ca.SX, u: ca.SX, air: Air
) -> tuple[ca.SX, ca.SX]:
    working = filled(actuator, dict(zip(paths, numbers, strict=True)))
    return working.pressure(state, u, air), working.rate(state, u, air)


def observed(g: Graphs, q: ca.SX, qd: ca.SX, state: ca.SX, u: ca.SX) -> tuple[Signals, Accounts]:
    """What could be measured in the chambers, and the actuator's energies."""
    return g.chain.asm.call(_observed, *_parts(g), state, u, air_of(g, q, qd), closed(g))


def _observed(
    actuator: Actuator,
    paths: tuple,
    numbers: tuple,
    state: ca.SX,
    u: ca.SX,
    air: Air,
    shut: bool,
) -> tuple[Signals, Accounts]:
    working = filled(actuator, dict(zip(paths, numbers, strict=True)))
    return working.signals(state, u, air), working.accounts(state, u, air, closed=shut)


def closed(g: Graphs) -> bool:
    """Whether the work of the pressures is that of the air in the chambers, all of it."""
    follows = g.options.inflation == "volume" and not _compliances(g).nnz()
    return g.options.actuator.stores_air and follows


def _parts(g: Graphs) -> tuple[Actuator, tuple[str, ...], tuple[ca.SX, ...]]:
    free = {s.field: g.theta[at] for s, at in g.layout.slots if s.part == "actuator"}
    return g.options.actuator, tuple(free), tuple(free.values())


def settled(model: Model, q: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """States of the actuator where the chambers hold gauge pressures in a pose, shape (n_z,).

    Args:
        model: the model.
        q: pose, shape (n_q,).
        pressure: shape (n_u,) [Pa].
    """
    volume = rest = np.zeros(model.n_u)
    if model.actuator.sees_volume:
        volume = np.array(model.volume(q, pressure, model.theta0)).ravel()
        rest = model.graphs[1].rest_volume.full().ravel()
    return model.actuator.rest_state(pressure, volume, rest)


class Actuation(NamedTuple):
    """An actuator in numbers or symbols, Functions of (q, v, z, u, theta).

    Attributes:
        values: pressure and rate of the states.
        slopes: derivatives of both for q, v, z and u.
        by_theta: derivatives of both for theta behind its block `frames`, all else held.
    """

    values: ca.Function
    slopes: ca.Function
    by_theta: ca.Function

    @classmethod
    def of(cls, g: Graphs) -> Actuation:
        """Built from a model's graphs."""
        ports = _ports(g)
        parts = actuated(g, *ports)
        blocks = [ca.jacobian(part, port) for part in parts for port in ports]
        free = [ca.jacobian(part, g.theta)[:, g.n_frames :] for part in parts]
        ports.append(g.theta)
        return cls(
            ca.Function("actuation", ports, list(parts), {"cse": True}),
            ca.Function("actuation_slopes", ports, blocks, {"cse": True}),
            ca.Function("actuation_by_theta", ports, free, {"cse": True}),
        )


def measured_pressure(g: Graphs) -> ca.Function:
    """Gauge pressures in the chambers, Function of (q, v, z, u, theta).

    Returns:
        The pressures and their derivatives for q, v, z and theta behind its block `frames`.
    """
    ports = _ports(g)
    pressure = observed(g, *ports)[0].pressure
    blocks = [ca.jacobian(pressure, port) for port in ports[:3]]
    blocks.append(ca.jacobian(pressure, g.theta)[:, g.n_frames :])
    return ca.Function("measured", [*ports, g.theta], [pressure, *blocks], {"cse": True})


def _ports(g: Graphs) -> list[ca.SX]:
    """Symbols q, v, z, u."""
    return [g.q, g.qd, g.chain.asm.sym("z", g.x.shape[0] - 2 * g.chain.n_q), g.u]
