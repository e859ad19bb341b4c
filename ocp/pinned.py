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

    Args:
        run: what is timed.
        feed: prepares the run of a number.
        n: how many.
    """
    seconds = np.empty(n + 20)
    for k in range(n + 20):
        feed(k)
        start = time.perf_counter()
        run()
        seconds[k] = time.perf_counter() - start
    return seconds[20:]
