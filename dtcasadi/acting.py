"""Forces on a chain: their wrenches, energies and derivatives, by one mechanism for all of them.

Forces between discs are evaluated span by span, those of the world disc by disc, each group in one
kernel call (`dtcasadi.forces.span`, `dtcasadi.forces.world`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca

from .contact.compliant import CompliantContact, rim_touches
from .forces.inflation import PressureOnVolume
from .forces.protocol import Force, packed
from .forces.slopes import span_slopes, world_slopes
from .forces.span import Seen, span_breath, span_energy, span_jacobian, span_volume, span_wrenches
from .forces.traits import Traits, traits
from .forces.world import world_energy, world_jacobian, world_wrench
from .kernels import kinematics as kin

if TYPE_CHECKING:
    from .chain import Chain, Loads
    from .kernels.kinematics import Segment, Turning, Words

ZERO, UNIT = ca.DM(3, 1), ca.DM.eye(3)


class Span(NamedTuple):
    """Forces whose first and last disc (from 1) are the same."""

    first: int
    last: int
    forces: list[Force]

    @property
    def segments(self) -> slice:
        """Its segments, from 0."""
        return slice(self.first - 1, self.last - 1)

    @property
    def seen(self) -> Seen:
        """For each force the discs it sees, counted from the one after the first."""
        return tuple(
            tuple(disc - self.first - 1 for disc in force.touched()[1:]) for force in self.forces
        )


def spans(forces: Iterable[Force]) -> list[Span]:
    """Forces between discs, those with the same ends together."""
    found: dict[tuple[int, int], Span] = {}
    for force in forces:
        discs = force.touched()
        if len(discs) > 1 and not traits(force).idle:
            ends = discs[0], discs[-1]
            found.setdefault(ends, Span(*ends, [])).forces.append(force)
    return list(found.values())


def by_disc(forces: Iterable[Force]) -> dict[int, list[Force]]:
    """Forces of the world on each disc (from 1); none on the root, which does not move."""
    found: dict[int, list[Force]] = {}
    for force in forces:
        discs = force.touched()
        if len(discs) == 1 and discs[0] > 1 and not traits(force).idle:
            found.setdefault(discs[0], []).append(force)
    return found


def joint_traits(forces: Iterable[Force]) -> Traits:
    """What any of the forces depends on."""
    each = [traits(force) for force in forces]
    return Traits(any(t.pose for t in each), any(t.rates for t in each), all(t.idle for t in each))


def act(
    chain: Chain,
    forces: Sequence[Force],
    segments: list[Segment],
    qd: ca.SX,
    slope: str | None = None,
) -> Loads:
    """The forces' wrenches on every disc, along the disc's axes; with `slope` their derivatives.

    Args:
        chain: the chain.
        forces: the forces; with `slope` they share the number.
        segments: the chain's segments at q.
        qd: rates.
        slope: name of a number that all the forces have the same value of.
    """
    between = (span_wrenches,) if slope is None else (span_slopes, slope)
    outer = (world_wrench,) if slope is None else (world_slopes, slope)
    loads = chain.none()
    rates = chain.split(qd)
    for span in spans(forces):
        at = span.segments
        geometry = chain.words[at], tuple(segments[at])
        relative = _relative(chain, *geometry, rates[at])
        parts = (packed(force) for force in span.forces)
        found = chain.asm.call(*between, *geometry, relative, span.seen, *parts)
        for held, wrench in zip(loads[span.first - 1 : span.last], found, strict=True):
            held.append(wrench)
    on_discs = by_disc(forces)
    needs = {disc: joint_traits(mine) for disc, mine in on_discs.items()}
    states = world_states(chain, needs, segments, qd)
    for disc, mine in on_discs.items():
        parts = (packed(force) for force in mine)
        loads[disc - 1].append(chain.asm.call(*outer, *states[disc], *parts))
    return loads


def _relative(
    chain: Chain, words: Sequence[Words], segments: Sequence[Segment], rates: Sequence[ca.SX]
) -> tuple[Turning, ...]:
    """How each segment turns relative to the disc before it."""
    parts = zip(words, segments, rates, strict=True)
    return tuple(chain.asm.call(kin.turning, *part, ZERO) for part in parts)


def world_states(
    chain: Chain, needs: dict[int, Traits], segments: list[Segment], qd: ca.SX
) -> dict[int, tuple[ca.SX, ca.SX, ca.SX, ca.SX]]:
    """R, r, w, v (the rates along the disc's axes) of each disc; constants where nobody looks."""
    if any(need.pose for need in needs.values()):
        R, r = chain.poses(segments)
    if any(need.rates for need in needs.values()):
        motion = chain.motion(segments, qd)
        velocity = chain.velocities(motion)
    return {
        disc: (
            *((R[disc - 1], r[disc - 1]) if need.pose else (UNIT, ZERO)),
            *((motion.w(disc - 1), velocity[disc - 1]) if need.rates else (ZERO, ZERO)),
        )
        for disc, need in needs.items()
    }


def stored(chain: Chain, forces: Sequence[Force], segments: list[Segment]) -> ca.SX:
    """Energy of the forces that have one [J]."""
    mine = [force for force in forces if force.stores()]
    energy = 0
    for span in spans(mine):
        parts = (packed(force) for force in span.forces)
        geometry = chain.words[span.segments], tuple(segments[span.segments])
        energy = energy + chain.asm.call(span_energy, *geometry, span.seen, *parts)
    on_discs = by_disc(mine)
    R, r = chain.poses(segments) if on_discs else ([], [])
    for disc, held in on_discs.items():
        parts = (packed(force) for force in held)
        energy = energy + chain.asm.call(world_energy, R[disc - 1], r[disc - 1], *parts)
    return energy


def touches(
    chain: Chain, contacts: Sequence[CompliantContact], segments: list[Segment], qd: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX] | None:
    """Gaps (n, 1), places (3, n) and forces (3, n) of rim points, contact by contact."""
    if not contacts:
        return None
    seen = Traits(pose=True, rates=True, idle=False)
    states = world_states(chain, {each.disc: seen for each in contacts}, segments, qd)
    calls = [chain.asm.call(rim_touches, *states[each.disc], packed(each)) for each in contacts]
    gaps, places, forces = zip(*calls, strict=True)
    return ca.vertcat(*gaps), ca.horzcat(*places), ca.horzcat(*forces)


def enclosed(chain: Chain, parts: Sequence[PressureOnVolume], segments: list[Segment]) -> ca.SX:
    """Volume of a chamber from its segments' parts [m^3]."""
    volume = 0
    for part in parts:
        i = part.discs[0] - 1
        volume = volume + chain.asm.call(
            span_volume, chain.words[i : i + 1], (segments[i],), packed(part)
        )
    return volume


def breathing(
    chain: Chain, parts: Sequence[PressureOnVolume], segments: list[Segment], qd: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """The same volume and its rate [m^3/s], of parts with unit pressure."""
    volume, rate, rates = 0, 0, chain.split(qd)
    for part in parts:
        at = slice(part.discs[0] - 1, part.discs[0])
        geometry = chain.words[at], tuple(segments[at])
        relative = _relative(chain, *geometry, rates[at])
        found = chain.asm.call(span_breath, *geometry, relative, packed(part))
        volume, rate = volume + found[0], rate + found[1]
    return volume, rate


def span_derivatives(
    chain: Chain, forces: Sequence[Force], q: ca.SX, qd: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """What forces between discs add to d tau / d q and d tau / d qd, shape (n_q, n_q) each."""
    sizes = [words.n_q for words in chain.words]
    numbers = chain.numbers
    geometry = list(
        zip(numbers.bend, numbers.twist, numbers.length, numbers.exit_point, strict=True)
    )
    angles, rates = chain.split(q), chain.split(qd)
    total = [chain.asm.expression(chain.n_q, chain.n_q) for _ in range(2)]
    local: dict[int, tuple] = {}
    for span in spans(forces):
        at = span.segments
        parts = (packed(force) for force in span.forces)
        blocks = chain.asm.call(
            span_jacobian,
            chain.words[at],
            *(tuple(values[at]) for values in (angles, rates, geometry)),
            span.seen,
            *parts,
        )
        if span.last == span.first + 1:
            local[span.first - 1] = blocks
            continue
        before, after = sum(sizes[: at.start]), sum(sizes[at.stop :])
        for k, block in enumerate(blocks):
            ends = (chain.asm.expression(n, n) for n in (before, after))
            first, last = ends
            total[k] = total[k] + ca.diagcat(first, block, last)
    for k in range(2):
        none = [chain.asm.expression(n, n) for n in sizes]
        each = [local[i][k] if i in local else none[i] for i in range(chain.n_segments)]
        total[k] = total[k] + ca.diagcat(*each)
    return total[0], total[1]


def world_derivatives(
    chain: Chain, forces: Sequence[Force], segments: list[Segment], qd: ca.SX
) -> dict[int, tuple[ca.SX, ca.SX]]:
    """Matrices `stiff` and `drag` of `world_jacobian` for each disc (from 1) that has them."""
    on_discs = by_disc(f for f in forces if traits(f).pose or traits(f).rates)
    # In the root's frame they depend on the pose, whatever the wrench along the disc's axes does.
    needs = {disc: joint_traits(mine)._replace(pose=True) for disc, mine in on_discs.items()}
    states = world_states(chain, needs, segments, qd)
    return {
        disc: chain.asm.call(world_jacobian, *states[disc], *(packed(f) for f in mine))
        for disc, mine in on_discs.items()
    }
