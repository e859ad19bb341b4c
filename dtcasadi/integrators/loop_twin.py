"""`native/adaptive.c` in Python: what runs without a compiler, and the check of the C code."""

import numpy as np

from ..bound import Bound
from ..events import Guards
from .loop_state import LoopState, Stop, Watched


def twin_loop(
    step: Bound,
    s: LoopState,
    command: tuple[np.ndarray, np.ndarray],
    theta: np.ndarray,
    guard: np.ndarray,
    guards: Guards,
    x: np.ndarray,
    t_out: np.ndarray,
    x_out: np.ndarray,
) -> Stop:
    """The loop, statement by statement; see `Loop.run`."""
    s.stored, s.event, after_reject, why = 0, -1, False, Stop.TOO_SMALL
    u, du = command

    def take(h: float) -> tuple[np.ndarray, ...]:
        return step(x, u + du * (s.t - s.t_command), du, h, theta)

    g = guards.values(s.t, x)
    while s.t < s.t_end:
        h = min(s.h, s.h_max)
        if s.stored == s.capacity:
            return Stop.FULL
        last = s.t + 1.0000001 * h >= s.t_end
        h = s.t_end - s.t if last else h
        if not last and h < 1e-14 * (abs(s.t) + abs(s.t_end)):
            return why
        x_next, error, slack = take(h)
        scale = s.atol + s.rtol * np.maximum(np.abs(x), np.abs(x_next))
        with np.errstate(all="ignore"):
            size, total = float(np.sqrt(np.mean((error / scale) ** 2))), float(np.sum(x_next))
        if not np.isfinite(total) or not np.isfinite(size) or not slack[0] <= s.slack_max:
            finite = np.isfinite(total) and np.isfinite(size)
            why = Stop.NEWTON if finite else Stop.NOT_FINITE
            if not s.adaptive:
                return why
            s.h, s.rejected, s.broken, after_reject = 0.25 * h, s.rejected + 1, s.broken + 1, True
            continue
        if s.adaptive and size > 1:
            s.h, s.rejected = h * max(0.9 * size ** (-1 / s.order), 0.2), s.rejected + 1
            after_reject, why = True, Stop.TOO_SMALL
            continue
        if s.adaptive:
            factor = 0.9 * max(size, 1e-10) ** (-0.7 / s.order) * s.previous ** (0.4 / s.order)
            factor = min(max(factor, 0.2), 1.0 if after_reject else 5.0)
            if not last or h * factor < s.h:
                s.h = h * factor
            s.previous = max(size, 1e-4)
        after_reject = False
        if s.n_events:
            g_next = guards.values(s.t + h, x_next)
            for i in range(s.n_events):
                if not _passed(g[i], g_next[i], guards.directions[i]):
                    continue
                s.event, h = i, _located(take, guards, s.t, h, i, (g[i], g_next[i]))
                x_next = take(h)[0]
                g_next = guards.values(s.t + h, x_next)
            last = last and (s.event < 0 or s.t + h >= s.t_end)
            g = g_next
        s.t = s.t_end if last else s.t + h
        x[:] = x_out[s.stored] = x_next
        t_out[s.stored] = s.t
        s.stored, s.accepted = s.stored + 1, s.accepted + 1
        if s.event >= 0:
            return Stop.EVENT
        for index, kind in guard:
            if kind == Watched.LIMITED and abs(x[index]) > s.limit:
                return Stop.GUARD
            turned = np.sin(x[index]) if kind == Watched.SINE else np.cos(x[index])
            if kind != Watched.LIMITED and abs(turned) < s.near:
                return Stop.SINGULAR
    return Stop.AT_END


def _passed(before: float, after: float, direction: int) -> bool:
    rising = direction >= 0 and before < 0 <= after
    return bool(rising or (direction <= 0 and before > 0 >= after))


def _located(take, guards: Guards, t: float, h: float, i: int, ends: tuple[float, float]) -> float:
    """The step that ends just behind a sign change of guard i, by the Illinois method."""
    (low, high), (f_low, f_high), side = (0.0, h), ends, 0
    before = f_low
    for _ in range(100):
        if f_high == 0 or high - low <= 1e-15 * (abs(t) + h):
            break
        trial = low + (high - low) * f_low / (f_low - f_high)
        if not low < trial < high:
            trial = 0.5 * (low + high)
        value = guards.values(t + trial, take(trial)[0])[i]
        if _passed(before, value, guards.directions[i]):
            high, f_high = trial, value
            f_low, side = f_low * (0.5 if side > 0 else 1.0), 1
        else:
            low, f_low = trial, value
            f_high, side = f_high * (0.5 if side < 0 else 1.0), -1
    return high
