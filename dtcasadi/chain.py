"""The recursions along the chain: every quantity of the model from the per-segment kernels.

Written once for both assemblers (`dtcasadi.assemble`). Lists over discs start with disc 1, lists
over segments with the one between discs 1 and 2.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import casadi as ca

from .assemble import Flat, Graph
from .forces.gravity import felt_at_root
from .forces.payload import together
from .forces.protocol import Body, Force, packed
from .kernels import articulated as art
from .kernels import kinematics as kin
from .kernels import momentum as mom
from .kernels.kinematics import Segment, Turning, Words
from .numbers import Numbers

Wrench = tuple[ca.SX, ca.SX]
Loads = list[list[Wrench]]  # for each disc its wrenches along its own axes
ZERO = ca.DM(3, 1)


class Motion(NamedTuple):
    """Segments and the angular velocities along them at one (q, qd)."""

    segments: list[Segment]
    qd: list[ca.SX]
    rates: list[Turning]

    def w(self, disc: int) -> ca.SX:
        """Angular velocity of a disc (from 0 = root) in its frame."""
        return self.rates[disc - 1].rate if disc else ZERO


def trigonometry(q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Cosines and sines of a segment's coordinates."""
    return ca.cos(q), ca.sin(q)


def loaded_body(
    numbers: Body, w: ca.SX, moment: ca.SX, force: ca.SX, outboard: art.Articulated | tuple
) -> art.Articulated:
    """A disc's articulated inertia: its own, its loads and what its outgoing thread passes on."""
    J, H = art.rigid_inertia(*numbers)
    n, f = art.body_bias(*numbers, w)
    own = art.Articulated(J, H, numbers.mass * ca.SX.eye(3), n - moment, f - force)
    if not outboard:
        return own
    return art.Articulated(*(a + b for a, b in zip(own, outboard, strict=True)))


def sum_wrench(*parts: Wrench) -> Wrench:
    """Sum of wrenches on one disc."""
    return sum((p[0] for p in parts), ca.SX.zeros(3)), sum((p[1] for p in parts), ca.SX.zeros(3))


def inward_wrench(
    words: Words, seg: Segment, moment: ca.SX, force: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Generalized forces of the wrench beyond a segment, and that wrench on disc i."""
    return kin.project(words, seg, moment, force), *kin.to_parent(words, seg, moment, force)


def tension_of(words: Words, seg: Segment, force: ca.SX) -> ca.SX:
    """Pull along the thread [N] from the force it exerts on disc i+1 (frame i+1)."""
    return -kin.from_disc(words, seg, force)[2]


class Chain:
    """The recursions for one robot, one list of charts and one assembler."""

    def __init__(
        self,
        numbers: Numbers,
        words: Sequence[Words],
        assembler: Flat | Graph,
    ):
        self.words, self.asm = tuple(words), assembler
        self.numbers = numbers._replace(discs=tuple(self._loaded(numbers)))
        self.n_segments = len(self.words)
        self.n_q = sum(w.n_q for w in self.words)
        self.planar = all(w == Words("x", "x") for w in self.words) and all(
            _about_x(m) for m in (*numbers.bend, *numbers.twist)
        )

    def _loaded(self, numbers: Numbers) -> Iterator[Body]:
        """Each disc with what forces make it carry, as one body."""
        carried = [force for force in numbers.forces if type(force).body is not Force.body]
        for disc, own in enumerate(numbers.discs, 1):
            mine = [packed(force) for force in carried if force.touched() == (disc,)]
            yield self.asm.call(together, own, *mine) if mine else own

    # ---- kinematics ----------------------------------------------------------------------------

    def split(self, v: ca.SX) -> list[ca.SX]:
        """A vector over all coordinates, by segment."""
        offsets = [0]
        for words in self.words:
            offsets.append(offsets[-1] + words.n_q)
        return ca.vertsplit(v, offsets)

    def segments(self, q: ca.SX) -> list[Segment]:
        """Trigonometry and geometry of each segment."""
        n = self.numbers
        parts = zip(self.split(q), n.bend, n.twist, n.length, n.exit_point, strict=True)
        return [Segment(*self.asm.call(trigonometry, qi), *geometry) for qi, *geometry in parts]

    def motion(self, segments: list[Segment], qd: ca.SX) -> Motion:
        """Angular velocities, eq (4), outward."""
        w, rates, parts = ZERO, [], self.split(qd)
        for words, seg, qdi in zip(self.words, segments, parts, strict=True):
            rates.append(self.asm.call(kin.turning, words, seg, qdi, w))
            w = rates[-1].rate
        return Motion(segments, parts, rates)

    def poses(self, segments: list[Segment]) -> tuple[list[ca.SX], list[ca.SX]]:
        """Rotation and position of every disc in the root frame."""
        R, r = [ca.DM.eye(3)], [ZERO]
        for words, seg in zip(self.words, segments, strict=True):
            R_next, r_next = self.asm.call(kin.carry_pose, words, seg, R[-1], r[-1])
            R.append(R_next)
            r.append(r_next)
        return R, r

    # ---- forces --------------------------------------------------------------------------------

    def none(self) -> Loads:
        """No wrench on any disc."""
        return [[] for _ in range(self.n_segments + 1)]

    def total(self, *groups: Loads) -> list[Wrench]:
        """One wrench per disc."""
        sums = []
        for i in range(self.n_segments + 1):
            parts = tuple(w for group in groups for w in group[i])
            sums.append(self.asm.call(sum_wrench, *parts) if parts else (ZERO, ZERO))
        return sums

    def project(
        self, segments: list[Segment], wrenches: Sequence[Wrench]
    ) -> tuple[ca.SX, list[ca.SX]]:
        """J^T w of wrenches on discs (inward): generalized forces, and the force in each thread."""
        entries: list[ca.SX] = []
        forces: list[ca.SX] = []
        moment, force = wrenches[-1]
        for i in reversed(range(self.n_segments)):
            forces.insert(0, force)
            part, moment, force = self.asm.call(
                inward_wrench, self.words[i], segments[i], moment, force
            )
            entries.insert(0, part)
            moment, force = self.asm.call(sum_wrench, (moment, force), wrenches[i])
        return ca.vertcat(*entries), forces

    # ---- dynamics ------------------------------------------------------------------------------

    def root_acceleration(self) -> ca.SX:
        """The fields' acceleration of free fall as an acceleration of the root the other way."""
        return self.asm.call(felt_at_root, *(packed(field) for field in self.numbers.fields))

    def inertial_wrenches(
        self, motion: Motion, qdd: ca.SX, root_acceleration: ca.SX
    ) -> list[Wrench]:
        """Newton-Euler, outward: the wrench that gives each disc its motion."""
        alpha, a = ZERO, root_acceleration
        wrenches: list[Wrench] = [(ZERO, ZERO)]
        for i, qddi in enumerate(self.split(qdd)):
            alpha, a = self.asm.call(
                art.accelerate,
                self.words[i],
                motion.segments[i],
                motion.rates[i],
                qddi,
                motion.w(i),
                alpha,
                a,
            )
            body = (*self.numbers.discs[i + 1], motion.w(i + 1), alpha, a)
            wrenches.append(self.asm.call(art.inertial_wrench, *body))
        return wrenches

    def accelerations(
        self, motion: Motion, tau: ca.SX, loads: Sequence[Wrench], root_acceleration: ca.SX
    ) -> ca.SX:
        """Forward dynamics by the articulated-body recursion: M^-1 (tau + J^T loads - bias)."""
        taus, outboard = self.split(tau), ()
        memory: list[art.Memory] = []
        for i in reversed(range(self.n_segments)):
            body = self.asm.call(
                loaded_body, self.numbers.discs[i + 1], motion.w(i + 1), *loads[i + 1], outboard
            )
            inward = art.inward_taut if self._taut(i) else art.inward_general
            outboard, kept = self.asm.call(
                inward, *self._joint(motion, i), taus[i], body, self.planar
            )
            memory.insert(0, kept)
        alpha, a, qdd = ZERO, root_acceleration, []
        for i in range(self.n_segments):
            outward = art.outward_taut if self._taut(i) else art.outward_general
            part, alpha, a = self.asm.call(
                outward, *self._joint(motion, i), taus[i], memory[i], alpha, a, self.planar
            )
            qdd.append(part)
        return ca.vertcat(*qdd)

    def _joint(self, motion: Motion, i: int) -> tuple:
        return self.words[i], motion.segments[i], motion.rates[i], motion.w(i)

    def _taut(self, i: int) -> bool:
        """Whether only the thread's tension passes inward through segment i."""
        return self.planar or (len(self.words[i].thread) == 2 and len(self.words[i].disc) == 3)

    # ---- momentum and energy -------------------------------------------------------------------

    def velocities(self, motion: Motion) -> list[ca.SX]:
        """Velocity of every disc's origin in its own frame, outward."""
        v = [ZERO]
        for i in range(self.n_segments):
            v.append(self.asm.call(mom.carry_velocity, *self._joint(motion, i), v[-1]))
        return v

    def momenta(self, motion: Motion) -> tuple[ca.SX, ca.SX, ca.SX]:
        """P = M qd, dT/dq and the kinetic energy T, inward."""
        velocity = self.velocities(motion)
        p: list[ca.SX] = []
        dT: list[ca.SX] = []
        sums, kinetic = (ZERO,) * 2, 0
        for i in reversed(range(self.n_segments)):
            body = self.numbers.discs[i + 1]
            energy, *sums = self.asm.call(
                _gathered, body, motion.w(i + 1), velocity[i + 1], tuple(sums)
            )
            kinetic = kinetic + energy
            part, gradient, *sums = self.asm.call(
                mom.momentum_step,
                self.words[i],
                motion.segments[i],
                motion.qd[i],
                motion.rates[i],
                velocity[i + 1],
                *sums,
            )
            p.insert(0, part)
            dT.insert(0, gradient)
        return ca.vertcat(*p), ca.vertcat(*dT), kinetic

    def field_energy(self, segments: list[Segment]) -> ca.SX:
        """Energy of the discs' masses in the fields [J]."""
        R, r = self.poses(segments)
        felt, energy = self.root_acceleration(), 0
        for body, turn, place in zip(self.numbers.discs[1:], R[1:], r[1:], strict=True):
            energy = energy + self.asm.call(_field_energy, body, turn, place, felt)
        return energy

    def tensions(self, segments: list[Segment], forces: Sequence[ca.SX]) -> ca.SX:
        """Thread tensions from the joint forces of `project`."""
        triples = zip(self.words, segments, forces, strict=True)
        return ca.vertcat(*(self.asm.call(tension_of, *triple) for triple in triples))


def _gathered(body: Body, w: ca.SX, v: ca.SX, sums: tuple) -> tuple:
    """A disc's kinetic energy, and its momentum with that of what hangs on it."""
    angular, linear, energy = mom.body_momentum(*body, w, v)
    return energy, angular + sums[0], linear + sums[1]


def _field_energy(body: Body, R: ca.SX, r: ca.SX, felt: ca.SX) -> ca.SX:
    """Mass times what the field takes for the way from the root's origin."""
    return body.mass * ca.dot(felt, r + ca.mtimes(R, body.com))


def _about_x(matrix: ca.DM) -> bool:
    """Whether a rest rotation keeps the x axis, so that the chain stays in the y-z plane."""
    return isinstance(matrix, ca.DM) and bool(abs(float(matrix[0, 0]) - 1) < 1e-12)
