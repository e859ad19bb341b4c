"""A robot in maximal coordinates: free rigid bodies, threads as constraints on their ends.

Position of the centre of mass and a quaternion for each disc, and one constraint for each thread,
|r_{i+1} - r_i - R_i s_i| = l, held by multipliers; nothing is shared with the model but the Robot's
numbers. Newton and Euler for each disc in the root frame, forces and the damping's wrenches point
by point:

    [W  -A^T] [a     ]   [f]
    [A   0  ] [lambda] = [-Adot v - 2 w A v - w^2 g],

with g the constraints and w Baumgarte's rate (Featherstone, Rigid Body Dynamics Algorithms,
section 8.3). The state is, per moving disc, position (3), quaternion (4), velocity (3), angular
velocity (3), all in the root frame.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from dtcasadi.robot import Robot

# Baumgarte's rate [1/s]: constraint errors, which start at round-off, decay instead of growing.
RATE = 20.0


class Bodies(NamedTuple):
    """All discs, the root first: centres (N, 3), rotations (N, 3, 3), velocities (N, 3) each."""

    c: np.ndarray
    R: np.ndarray
    v: np.ndarray
    w: np.ndarray


@dataclass(frozen=True, eq=False)
class Maximal:
    """The equations of motion of a robot without chambers."""

    robot: Robot

    def state(self, R: np.ndarray, r: np.ndarray, v: np.ndarray, w: np.ndarray) -> np.ndarray:
        """From rotations (N, 3, 3), frame origins, their velocities and angular velocities."""
        parts = []
        for disc, *pose in list(zip(self.robot.discs, R, r, v, w, strict=True))[1:]:
            turn, origin, velocity, spin = pose
            arm = turn @ disc.centre_of_mass
            parts += [origin + arm, quaternion(turn), velocity + cross(spin, arm), spin]
        return np.concatenate(parts)

    def bodies(self, y: np.ndarray) -> Bodies:
        """The discs of a state."""
        rows = y.reshape(-1, 13)
        root = self.robot.discs[0].centre_of_mass
        still = np.zeros((1, 3))
        turns = np.array([np.eye(3), *(rotation(row[3:7]) for row in rows)])
        return Bodies(
            np.vstack([root, rows[:, :3]]),
            turns,
            np.vstack([still, rows[:, 7:10]]),
            np.vstack([still, rows[:, 10:]]),
        )

    def origins(self, y: np.ndarray) -> np.ndarray:
        """Origins of the discs' frames, shape (N, 3) [m]."""
        b = self.bodies(y)
        return np.array([self._at(b, i, np.zeros(3))[0] for i in range(len(b.c))])

    def energy(self, y: np.ndarray) -> float:
        """Kinetic and potential energy [J]."""
        b = self.bodies(y)
        total = 0.0
        for i, disc in enumerate(self.robot.discs[1:], 1):
            inertia = b.R[i] @ disc.inertia @ b.R[i].T
            total += float(disc.mass * b.v[i] @ b.v[i] + b.w[i] @ inertia @ b.w[i]) / 2
            total += float(disc.mass * self.robot.gravity * self.robot.up @ b.c[i])
        for spring in self.robot.springs:
            i, j = spring.discs[0] - 1, spring.discs[1] - 1
            gap = self._at(b, j, spring.end)[0] - self._at(b, i, spring.start)[0]
            assert spring.rest_length is not None
            total += float(spring.stiffness * (np.linalg.norm(gap) - spring.rest_length) ** 2) / 2
        return total

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """Derivative of the state."""
        b, n = self.bodies(y), self.robot.n_discs
        f, weight = self._applied(b), np.zeros((6 * n - 6, 6 * n - 6))
        for i, disc in enumerate(self.robot.discs[1:], 1):
            inertia = b.R[i] @ disc.inertia @ b.R[i].T
            f[i, 3:] -= cross(b.w[i], inertia @ b.w[i])
            at = 6 * i - 6
            weight[at : at + 3, at : at + 3] = disc.mass * np.eye(3)
            weight[at + 3 : at + 6, at + 3 : at + 6] = inertia
        A, bias = self._constraints(b)
        m = len(A)
        matrix = np.block([[weight, -A.T], [A, np.zeros((m, m))]])
        a = np.linalg.solve(matrix, np.concatenate([f[1:].ravel(), bias]))[: 6 * n - 6]
        rows = np.empty((n - 1, 13))
        rows[:, :3], rows[:, 7:] = b.v[1:], a.reshape(-1, 6)
        q = y.reshape(-1, 13)[:, 3:7]
        for i in range(n - 1):
            rows[i, 3:7] = 0.5 * product(np.array([0.0, *b.w[i + 1]]), q[i])
        return rows.ravel()

    def run(self, y: np.ndarray, times: np.ndarray, rtol: float = 1e-11) -> np.ndarray:
        """States at increasing times from the first on, shape (len(times), len(y)).

        Raises:
            RuntimeError: SciPy's DOP853 did not reach the end.
        """
        span = times[0], times[-1]
        found = solve_ivp(self.rate, span, y, method="DOP853", t_eval=times, rtol=rtol, atol=1e-12)
        if not found.success:
            raise RuntimeError(found.message)
        return found.y.T

    def _at(self, b: Bodies, i: int, local: np.ndarray) -> tuple[np.ndarray, ...]:
        """A point of disc i (from 0), its arm about the centre, its velocity; local: disc frame."""
        arm = b.R[i] @ (local - self.robot.discs[i].centre_of_mass)
        return b.c[i] + arm, arm, b.v[i] + cross(b.w[i], arm)

    def _applied(self, b: Bodies) -> np.ndarray:
        """Forces and moments about the centres of mass but the threads', shape (N, 6)."""
        f = np.zeros((self.robot.n_discs, 6))
        for i, disc in enumerate(self.robot.discs):
            f[i, :3] -= disc.mass * self.robot.gravity * self.robot.up

        def push(i: int, arm: np.ndarray, force: np.ndarray) -> None:
            f[i, :3] += force
            f[i, 3:] += cross(arm, force)

        for spring in self.robot.springs:
            i, j = spring.discs[0] - 1, spring.discs[1] - 1
            (start, arm_i, v_i), (end, arm_j, v_j) = (
                self._at(b, k, local) for k, local in ((i, spring.start), (j, spring.end))
            )
            gap = end - start
            length = np.linalg.norm(gap)
            along = gap / length
            assert spring.rest_length is not None
            pull = spring.stiffness * (length - spring.rest_length)
            pull = (pull + spring.damping * along @ (v_j - v_i)) * along
            push(i, arm_i, pull)
            push(j, arm_j, -pull)
        assert isinstance(self.robot.damping, tuple)
        for i, (thread, damping) in enumerate(
            zip(self.robot.threads, self.robot.damping, strict=True)
        ):
            j = i + 1
            start, arm_i, v_i = self._at(b, i, thread.exit_point)
            end, arm_j, v_j = self._at(b, j, np.zeros(3))
            gap = end - start
            length = np.linalg.norm(gap)
            t = gap / length
            turning = (v_j - v_i) / length
            turning = turning - (turning @ t) * t
            # Dissipation 1/2 c |t' - w_k x t|^2 seen from disc k: a couple on the thread's ends,
            # -c (t' - w_k x t) / l and its opposite, and the opposite moment on disc k.
            for k, c in ((i, damping.c_a), (j, damping.c_b)):
                seen = turning - cross(b.w[k], t)
                push(j, arm_j, -c * seen / length)
                push(i, arm_i, c * seen / length)
                f[k, 3:] += c * cross(t, seen)
            relative = b.w[j] - b.w[i]
            moment = damping.c_w * (relative @ t) * t + damping.c_r * relative
            f[j, 3:] -= moment
            f[i, 3:] += moment
        return f

    def _constraints(self, b: Bodies) -> tuple[np.ndarray, np.ndarray]:
        """A of g' = A (v, w) for the moving discs, and what A a must be."""
        n = self.robot.n_discs
        A, bias = np.zeros((n - 1, 6 * n)), np.zeros(n - 1)
        for i, thread in enumerate(self.robot.threads):
            j = i + 1
            start, arm_i, v_i = self._at(b, i, thread.exit_point)
            end, arm_j, v_j = self._at(b, j, np.zeros(3))
            gap, speed = end - start, v_j - v_i
            for k, arm, sign in ((j, arm_j, 1.0), (i, arm_i, -1.0)):
                A[i, 6 * k : 6 * k + 3] = sign * gap
                A[i, 6 * k + 3 : 6 * k + 6] = sign * cross(arm, gap)
            inward = [cross(b.w[k], cross(b.w[k], arm)) for k, arm in ((j, arm_j), (i, arm_i))]
            g, g_rate = 0.5 * (gap @ gap - thread.length**2), gap @ speed
            bias[i] = -(speed @ speed + gap @ (inward[0] - inward[1]))
            bias[i] -= 2 * RATE * g_rate + RATE**2 * g
        return A[:, 6:], bias


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two vectors of shape (3,), ten times as fast as NumPy's general one."""
    (a1, a2, a3), (b1, b2, b3) = a.tolist(), b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def quaternion(R: np.ndarray) -> np.ndarray:
    """Unit quaternion (w, x, y, z) of a rotation: the eigenvector of its 4x4 form for 1."""
    K = np.empty((4, 4))
    K[0, 0] = np.trace(R)
    K[0, 1:] = K[1:, 0] = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    K[1:, 1:] = R + R.T - np.trace(R) * np.eye(3)
    return np.linalg.eigh(K)[1][:, -1]


def rotation(q: np.ndarray) -> np.ndarray:
    """Rotation of a quaternion of any length, which integration lets drift by its tolerance."""
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Hamilton product."""
    return np.array(
        [p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + cross(p[1:], q[1:]))]
    )
