r"""Time stepping with rigid contact: method `moreau`.

One step of size h, linearly implicit in the smooth forces (Anitescu and Potra, "A time-stepping
method for stiff multibody dynamics with contact and friction", Int. J. Numer. Meth. Eng. 55, 2002),
with W = M + h D + h^2 K of the implicit form:

1. Free motion: W (v_f - v) = -h (residual + h K v).
2. The nearest rim points, their gaps g and Jacobians J; Delassus operator G = J W^-1 J^T.
3. Impulses p1 with J v + max(g, 0) / h >= 0 at the end of the step and Coulomb's cone
   (Stewart and Trinkle, Int. J. Numer. Meth. Eng. 39, 1996): v_1 = v_f + W^-1 J^T p1 and
   q_1 = q + h v_1.
4. Where something hits, its approach more than the forces' change in one step, Moreau's law with
   one coefficient e on the averaged velocity (u+ + e u_f) / (1 + e) for all that touches, normal
   and tangential, which never gives energy: v_+ = v_f + W^-1 J^T p2. Elsewhere v_+ = v_1.
5. Projection of q_1 back to g >= 0 along the normals of 2 in the metric of W; its work is booked
   apart.

The normal impulses of 3 see no penetration, so what the impulses do is never positive; what they
leave in g is of the order of h^2 and goes in 5.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np

from ..linear import Factored
from .detect import Candidates, candidates_of
from .kernels import detection, gaps, solution

if TYPE_CHECKING:
    from ..graphs import Graphs
    from ..integrators.step import At, Plant, Sensitivity, Step

TIME_STEPPING = "moreau"
# An impact is an approach faster than so many changes of velocity by the forces in one step.
_HITS = 2.0
_CLOSE = 1e20  # gaps beyond it belong to no contact
_CLOSED = 1e-8  # smaller ones are none, in radii
_PROJECTIONS = 1
_DIFFERENCE = 1e-6


@dataclass(frozen=True, eq=False)
class Rims:
    """What the steps need to know of a robot's rigid contacts.

    Attributes:
        candidates: what may touch.
        places: q, theta -> R (3, 3 N), r (3, N), S (6 N, n_q): poses, and angular over linear
            velocity of each disc along its own axes for unit rates.
        poses: the first two of them alone.
    """

    candidates: Candidates
    places: ca.Function
    poses: ca.Function


class Impulses(NamedTuple):
    """What happened in a step.

    x_next; defect of the cone problem; impulses p (3 m,) along (normal, two tangents) [N s]; who
    (m,), candidates from 1; frame (9, m), its axes in the root frame; place (3, m); gap (m,) at the
    start; work of the impulses, p . (u + u+) / 2; loss, p . (u_f + u+) / 2, what they take from the
    free motion, never positive; shift (n_q,) of q by the projection.
    """

    x_next: ca.MX
    defect: ca.MX
    p: ca.MX
    who: ca.MX
    frame: ca.MX
    place: ca.MX
    gap: ca.MX
    work: ca.MX
    loss: ca.MX
    shift: ca.MX


def rims_of(g: Graphs) -> Rims | None:
    """The rims of a robot with rigid contacts; None without any."""
    found = candidates_of(g.robot)
    if found is None:
        return None
    chain = g.chain
    segments = chain.segments(g.q)
    R, r = chain.poses(segments)
    columns = []
    for unit in np.eye(chain.n_q):
        motion = chain.motion(segments, chain.asm.expression(ca.DM(unit)))
        velocity = chain.velocities(motion)
        pairs = ((motion.w(i), velocity[i]) for i in range(chain.n_segments + 1))
        columns.append(ca.vertcat(*(part for pair in pairs for part in pair)))
    values = [ca.horzcat(*R), ca.horzcat(*r), ca.horzcat(*columns)]
    values = [ca.densify(chain.asm.expression(value)) for value in values]
    ports = [g.q, g.theta]
    places = ca.Function("places", ports, values, {"cse": True})
    return Rims(found, places, ca.Function("rim_poses", ports, values[:2], {"cse": True}))


@dataclass(frozen=True)
class Moreau:
    """The method as a value; see the module."""

    name: str = TIME_STEPPING
    order: int = 1
    error_order: int = 0
    evaluations: int = 1
    a_stable: bool = True

    def step(self, plant: Plant, at: At) -> Step:
        """The step from `at`."""
        from ..integrators.step import Step

        done = impulses(plant, at)
        zero = at.zeros(at.x.shape[0])
        return Step(done.x_next, zero, done.defect, at.zeros(1))

    def sensitivity(self, plant: Plant, at: At, *, exact: bool) -> tuple[Step, Sensitivity]:
        """The step and its derivatives: exact without contact, else by central differences.

        Differences tell nothing where contacts change within them.
        """
        from ..integrators.step import Sensitivity, differentiated

        step = self.step(plant, at)
        if plant.rims is None:
            return step, differentiated(self, plant, at)
        free = at._replace(**{n: ca.MX.sym(n, *p.shape) for n, p in at._asdict().items()})
        function = ca.Function("stepped", list(free), [self.step(plant, free).x_next])
        n_free = plant.form.jacobian.size2_out(4)
        n_frames = at.theta.shape[0] - n_free

        def by(k: int, skip: int = 0) -> ca.MX:
            columns = []
            for i in range(skip, at[k].shape[0]):
                shift = ca.DM(at[k].shape[0], 1)
                shift[i] = _DIFFERENCE
                ends = [
                    function(*at._replace(**{at._fields[k]: at[k] + s})) for s in (shift, -shift)
                ]
                columns.append((ends[0] - ends[1]) / (2 * _DIFFERENCE))
            return ca.horzcat(*columns) if columns else at.zeros(at.x.shape[0], 0)

        return step, Sensitivity(by(0), by(1), by(4, n_frames))

    def stability(self, z: np.ndarray) -> np.ndarray:
        """R(z) = 1 / (1 - z)."""
        return 1 / (1 - np.asarray(z))


def for_contact(plant: Plant) -> Plant:
    """The plant with steps as calls of Functions: C kernels cannot be in a flat graph."""
    return replace(plant, kind=ca.MX)


def impulses(plant: Plant, at: At) -> Impulses:
    """One step as expressions."""
    q, v, z = ca.vertsplit(at.x, plant.sizes)
    n, n_z, h = plant.form.n_q, plant.form.n_z, at.h
    u = at.u + h * at.du
    rest = q, v, z, at.zeros(n), at.zeros(n_z), u, at.theta
    M, D, K, _, _ = plant.form.jacobian(*rest)
    W = ca.densify(M + h * D + h**2 * K)
    factored = Factored(W, native=plant.native)
    push = plant.form.residual(*rest) + h * ca.mtimes(K[:, :n], v)
    change, change_z = ca.vertsplit(factored.solve(-h * push), [0, n, n + n_z])
    free, z = v + change, z + change_z
    rims = plant.rims
    if rims is None:
        nothing = dict.fromkeys(("p", "who", "frame", "place", "gap"), at.zeros(1, 0))
        x_next, zero = ca.vertcat(q + h * free, free, z), at.zeros(1)
        return Impulses(x_next, zero, work=zero, loss=zero, shift=at.zeros(n), **nothing)
    m = rims.candidates.size
    find = detection(rims.candidates, n, native=plant.native)
    solve = solution(m, n, factored)
    lift = solution(m, n, factored, rows=1)
    normal = ca.sparsify(ca.DM(np.kron(np.eye(m), [[1.0], [0.0], [0.0]])))
    gap, J, mu, who, frame, place = find(*rims.places(q, at.theta), free, h)
    u_f = ca.mtimes(J, free)
    # In the plane, a normal out of it makes a slip of what is left of a gap.
    closed = _CLOSED * float(np.max(rims.candidates.plates[:, 3]))
    room = ca.mtimes(normal, ca.fmin(gap, _CLOSE) * (gap > closed)) / h
    p, reply, defect = solve(J, u_f + room, mu, who, 1)
    q = q + h * (free + ca.vertsplit(reply, [0, n, n + n_z])[0])
    e = rims.candidates.restitution
    if e > 0:
        closing = -ca.mtimes(normal.T, u_f)
        forced = ca.fabs(ca.mtimes(normal.T, ca.mtimes(J, change)))
        pushed = ca.mtimes(normal.T, p) > 0
        hits = ca.mmax(pushed * (closing > _HITS * forced))
        bounce, back, other = solve(J, u_f, mu, who * pushed, 1 / (1 + e))
        p, reply = p + hits * (bounce - p), reply + hits * (back - reply)
        defect = ca.fmax(defect, hits * other)
    moved, moved_z = ca.vertsplit(reply, [0, n, n + n_z])
    v, z = free + moved, z + moved_z
    loss = ca.dot(p, u_f + ca.mtimes(J, v)) / 2
    work = loss - ca.dot(p, ca.mtimes(J, change)) / 2
    shift = at.zeros(n)
    gaps_at = gaps(rims.candidates, native=plant.native)
    for _ in range(_PROJECTIONS):
        R, r = rims.poses(q + shift, at.theta)
        left = gaps_at(R, r, who)
        room = ca.mtimes(normal, ca.fmin(left, _CLOSE))
        lifted = lift(J, room, at.zeros(m), who, 1)[1]
        shift = shift + ca.vertsplit(lifted, [0, n, n + n_z])[0]
    x_next = ca.vertcat(q + shift, v, z)
    return Impulses(x_next, defect, p, who, frame, place, gap, work, loss, shift)
