"""Timing on one core."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def pinned() -> Iterator[None]:
    """Keep the process on one core, where the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def timed(run: Callable[[], None], feed: Callable[[int], None], n: int) -> np.ndarray:
    """Seconds of each of n runs, what it is fed with not counted, after 20 that do not count.

    The least of three in a row, which do the same: what the system puts between is no part of it.

    Args:
        run: what is timed.
        feed: prepares the run of a number.
        n: how many.
    """
    seconds = np.full(n + 20, np.inf)
    for k in range(n + 20):
        feed(k)
        for _ in range(3):
            start = time.perf_counter()
            run()
            seconds[k] = min(seconds[k], time.perf_counter() - start)
    return seconds[20:]
