"""The cone solver of `native/contact_solve.c` in NumPy: the same steps, for where no C runs."""

import numpy as np

# Rounds of Gauss-Seidel sweeps followed by Newton steps: a bound, hardly ever reached.
ROUNDS, SWEEPS, NEWTON, HALVINGS = 20, 4, 12, 5
_RIDGE, _SOLVED, _ENOUGH = 1e-9, 1e-12, 1e-11


def solve_contacts(
    G: np.ndarray, b: np.ndarray, mu: np.ndarray, who: np.ndarray
) -> tuple[np.ndarray, float]:
    r"""Impulses of contacts with Coulomb friction and the exact second-order cone.

    .. math:: u = G p + b, \quad 0 \le u_n \perp p_n \ge 0, \quad |p_t| \le \mu p_n, \quad
              |u_t|\, p_t = -\mu p_n u_t

    Gauss-Seidel sweeps, then semismooth Newton steps on the natural map (Alart and Curnier, "A
    mixed formulation for frictional contact problems prone to Newton like solution methods",
    Comput. Methods Appl. Mech. Eng. 92, 1991). Where they fail, as with contacts that threads hold
    apart, whose G is singular, rounds of the same start from proximal points (Rockafellar 1976):
    solutions with G + eps I and b - eps p for the last such p, eps halved each time.

    Args:
        G: shape (3 m, 3 m), rows and columns (normal, two tangents) of each contact.
        b: shape (3 m,).
        mu: coefficients of friction, shape (m,).
        who: zero where there is no contact, shape (m,).

    Returns:
        p, shape (3 m,), and the largest defect of the natural map over the largest impulse.
    """
    m = len(mu)
    top = max(float(np.max(np.diag(G), initial=0.0)), 0.0)
    ridge = _RIDGE * top
    blocks = [G[3 * s : 3 * s + 3, 3 * s : 3 * s + 3] for s in range(m)]
    normal = np.array([1 / (g[0, 0] + ridge + 1e-300) for g in blocks])
    tangent = np.array(
        [1 / (max(g[1, 1], g[2, 2]) + abs(g[1, 2]) + ridge + 1e-300) for g in blocks]
    )
    rho = np.column_stack([normal, tangent, tangent])
    live = np.array([w > 0 and g[0, 0] > ridge for w, g in zip(who, blocks, strict=True)], bool)
    B = b.reshape(m, 3)
    closing = live & (B[:, 0] < 0)
    p = best = np.zeros(3 * m)
    if not np.any(closing):
        return p, 0.0
    scale = float(np.max(np.abs(B[closing]) * normal[closing, np.newaxis]))
    least = np.inf
    for k in range(ROUNDS):
        if k > 0:
            eps = top * 0.5**k
            soft, off, slower = G + eps * np.eye(3 * m), b - eps * p, 1 / (1 / rho + eps)
            swept = _swept(soft, off, mu, slower, live, p)
            p = _in_cone(_newton(soft, off, mu, slower, live, swept, ridge, scale)[0], mu)
        swept = _swept(G, b, mu, rho, live, p)
        found, defect = _newton(G, b, mu, rho, live, swept, ridge, scale)
        if defect < least:
            best, least = _in_cone(found, mu), defect
        scale = max(scale, float(best.max()))
        if least <= _ENOUGH * scale:
            break
    return best, least / scale


def _in_cone(p: np.ndarray, mu: np.ndarray) -> np.ndarray:
    parts = p.reshape(-1, 3).copy()
    parts[:, 0] = np.maximum(parts[:, 0], 0)
    length, limit = np.linalg.norm(parts[:, 1:], axis=1), mu * parts[:, 0]
    over = length > limit
    parts[over, 1:] *= (limit[over] / length[over])[:, np.newaxis]
    return parts.ravel()


def _swept(
    G: np.ndarray, b: np.ndarray, mu: np.ndarray, rho: np.ndarray, live: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """Projected Gauss-Seidel, contact by contact."""
    p, u = p.copy(), G @ p + b
    for _ in range(SWEEPS):
        for s in np.flatnonzero(live):
            at = slice(3 * s, 3 * s + 3)
            old = p[at].copy()
            pushed = max(old[0] - rho[s, 0] * u[3 * s], 0)
            across = u[3 * s + 1 : 3 * s + 3] + G[3 * s + 1 : 3 * s + 3, 3 * s] * (pushed - old[0])
            p[at] = [pushed, *(old[1:] - rho[s, 1] * across)]
            p[at] = _in_cone(p[at], mu[s : s + 1])
            u += G[:, at] @ (p[at] - old)
    return p


def _natural(
    p: np.ndarray, u: np.ndarray, mu: np.ndarray, rho: np.ndarray, live: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The natural map F = p - proj(p - rho u) and tau = p - rho u, shape (m, 3) each."""
    tau = p.reshape(-1, 3) - rho * u.reshape(-1, 3)
    pushed = np.maximum(tau[:, 0], 0)
    length, radius = np.linalg.norm(tau[:, 1:], axis=1), mu * pushed
    share = np.where(length > radius, radius / np.where(length > 0, length, 1), 1)
    F = p.reshape(-1, 3) - np.column_stack([pushed, share[:, np.newaxis] * tau[:, 1:]])
    F[~live] = 0
    return F.ravel(), tau


def _newton(
    G: np.ndarray,
    b: np.ndarray,
    mu: np.ndarray,
    rho: np.ndarray,
    live: np.ndarray,
    p: np.ndarray,
    ridge: float,
    scale: float,
) -> tuple[np.ndarray, float]:
    """Semismooth Newton steps with a line search, or a jump into the cone; the best of them."""
    F, tau = _natural(p, G @ p + b, mu, rho, live)
    defect = float(np.max(np.abs(F)))
    best, least = p, defect
    for _ in range(NEWTON - 1):
        if defect <= _SOLVED * scale:
            break
        step = _direction(G, F, tau, mu, rho, live, p, ridge)
        share = 1.0
        for halving in range(HALVINGS + 1):
            jump = halving == HALVINGS
            trial = _in_cone(p + step, mu) if jump else p + share * step
            F_trial, tau_trial = _natural(trial, G @ trial + b, mu, rho, live)
            now = float(np.max(np.abs(F_trial)))
            if jump or now < (1 - 0.1 * share) * defect:
                break
            share /= 2
        p, F, tau, defect = trial, F_trial, tau_trial, now
        if defect < least:
            best, least = p, defect
    return best, least


def _direction(
    G: np.ndarray,
    F: np.ndarray,
    tau: np.ndarray,
    mu: np.ndarray,
    rho: np.ndarray,
    live: np.ndarray,
    p: np.ndarray,
    ridge: float,
) -> np.ndarray:
    """-F over its generalized derivative, with a ridge on G where contacts repeat each other."""
    m = len(mu)
    on = live & (tau[:, 0] > 0)
    D = np.eye(3 * m)
    rhs = np.where(np.repeat(on, 3), -F, -p)
    for s in np.flatnonzero(on):
        at = slice(3 * s, 3 * s + 3)
        length, radius = np.linalg.norm(tau[s, 1:]), mu[s] * tau[s, 0]
        slope = np.zeros((3, 3))  # of the projection for tau
        slope[0, 0] = 1
        slope[1:, 1:] = np.eye(2)
        if length > radius:
            unit = tau[s, 1:] / length
            slope[1:, 1:] = radius / length * (np.eye(2) - np.outer(unit, unit))
            slope[1:, 0] = mu[s] * unit
        rows = -rho[s][:, np.newaxis] * G[at]
        rows[:, at] += np.eye(3) - ridge * np.diag(rho[s])
        D[at] -= slope @ rows
    return np.linalg.solve(D, rhs)
