"""Kernels of the forces between discs, over the span from the first they touch to the last.

Everything is along the axes of the span's first disc, the reference. Such forces act on the span's
own coordinates alone, so the local Jacobian of these kernels is all of their derivative.
"""

from typing import Any

import casadi as ca

from ..kernels.axes import cross
from ..kernels.kinematics import (
    Segment,
    Turning,
    Words,
    direction,
    from_thread,
    project,
    relative_pose,
    to_parent,
    turning,
)
from .protocol import DiscState, Force, Packed, ThreadState, Wrench

Loads = tuple[tuple[ca.SX, ca.SX], ...]
Seen = tuple[tuple[int, ...], ...]  # for each force its discs, the reference left out, from 0


def given_by(force: Force, discs: list[DiscState]) -> list[Wrench]:
    """The force's wrenches as a list."""
    result = force.wrenches(*discs)
    return [result] if isinstance(result, Wrench) else list(result)


def span_states(
    words: tuple[Words, ...], segments: tuple[Segment, ...], relative: tuple[Turning, ...]
) -> list[DiscState]:
    """Every disc of the span after the first; `relative` is each segment's `turning` at w = 0."""
    states: list[DiscState] = []
    for word, seg, turn in zip(words, segments, relative, strict=True):
        R, r = relative_pose(word, seg)
        t, w = direction(word, seg), ca.mtimes(R, turn.rate)
        w_thread = from_thread(word, seg, turn.thread_rate)  # its spin about t moves nothing
        thread = ThreadState(t, cross(w_thread, t), cross(w_thread - w, t), seg.length)
        v = seg.length * thread.near_rate
        if states:
            base = states[-1]
            r, v, w = (ca.mtimes(base.R, part) for part in (r, v, w))
            t, near, far = (ca.mtimes(base.R, part) for part in thread[:3])
            thread = ThreadState(t, near, far, seg.length)
            w, v = base.w + w, base.v + cross(base.w, r) + v
            R, r = ca.mtimes(base.R, R), base.r + r
        states.append(DiscState(R, r, (w, v), thread=thread))
    return states


def span_wrenches(
    words: tuple[Words, ...],
    segments: tuple[Segment, ...],
    relative: tuple[Turning, ...],
    seen: Seen,
    *forces: Packed,
) -> Loads:
    """Moment about its origin and force on every disc of the span, along the disc's own axes."""
    states = span_states(words, segments, relative)
    total = [Wrench(ca.SX.zeros(3), ca.SX.zeros(3)) for _ in states]
    own = [Wrench(ca.SX.zeros(3), ca.SX.zeros(3), own=True) for _ in states]
    for force, places in zip(forces, seen, strict=True):
        found = given_by(force.force(), [states[k] for k in places])
        for k, wrench in zip(places, found, strict=True):
            group = own if wrench.own else total
            group[k] = group[k] + wrench
    moment, push = ca.SX.zeros(3), ca.SX.zeros(3)
    loads = []
    for disc, outer, mine in zip(states, total, own, strict=True):
        loads.append(
            (
                ca.mtimes(disc.R.T, outer.moment) + mine.moment,
                ca.mtimes(disc.R.T, outer.force) + mine.force,
            )
        )
        force = outer.force + ca.mtimes(disc.R, mine.force)
        moment = moment + cross(force, disc.r) - outer.moment - ca.mtimes(disc.R, mine.moment)
        push = push - force
    return (moment, push), *loads


def span_energy(
    words: tuple[Words, ...], segments: tuple[Segment, ...], seen: Seen, *forces: Packed
) -> ca.SX:
    """Energy of the forces [J]."""
    states = _resting(words, segments)
    total = ca.SX(0)
    for force, places in zip(forces, seen, strict=True):
        energy = force.force().energy(*(states[k] for k in places))
        total = total + energy
    return total


def span_volume(words: tuple[Words, ...], segments: tuple[Segment, ...], part: Packed) -> ca.SX:
    """Volume of the air between two neighbouring discs [m^3]."""
    return part.force().volume(*_resting(words, segments))  # type: ignore[attr-defined]


def span_breath(
    words: tuple[Words, ...],
    segments: tuple[Segment, ...],
    relative: tuple[Turning, ...],
    part: Packed,
) -> tuple[ca.SX, ca.SX]:
    """That volume and its rate [m^3/s]: the power of a part with unit pressure."""
    (disc,) = span_states(words, segments, relative)
    force: Any = part.force()
    wrench = force.wrenches(disc)
    return force.volume(disc), ca.dot(wrench.moment, disc.w) + ca.dot(wrench.force, disc.v)


def _resting(words: tuple[Words, ...], segments: tuple[Segment, ...]) -> list[DiscState]:
    still = tuple(Turning(*(ca.SX.zeros(3),) * 4) for _ in segments)
    return span_states(words, segments, still)


def span_jacobian(
    words: tuple[Words, ...],
    q: tuple[ca.SX, ...],
    qd: tuple[ca.SX, ...],
    geometry: tuple[tuple, ...],
    seen: Seen,
    *forces: Packed,
) -> tuple[ca.SX, ca.SX]:
    """What the forces add to d tau / d q and d tau / d qd of the span's coordinates."""
    segments = tuple(
        Segment(ca.cos(qi), ca.sin(qi), *numbers) for qi, numbers in zip(q, geometry, strict=True)
    )
    relative = tuple(
        turning(word, seg, rate, ca.SX.zeros(3))
        for word, seg, rate in zip(words, segments, qd, strict=True)
    )
    _, *loads = span_wrenches(words, segments, relative, seen, *forces)
    entries: list[ca.SX] = []
    moment, push = ca.SX.zeros(3), ca.SX.zeros(3)
    for word, seg, load in reversed(list(zip(words, segments, loads, strict=True))):
        moment, push = moment + load[0], push + load[1]
        entries.insert(0, -project(word, seg, moment, push))
        moment, push = to_parent(word, seg, moment, push)
    tau = ca.vertcat(*entries)
    return ca.jacobian(tau, ca.vertcat(*q)), ca.jacobian(tau, ca.vertcat(*qd))
