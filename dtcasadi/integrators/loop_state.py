"""What the loop of steps is told and what it tells: the same memory in C and in its twin."""

import ctypes
from enum import IntEnum


class Stop(IntEnum):
    """Why a call of the loop returned."""

    AT_END = 0
    FULL = 1
    GUARD = 2
    TOO_SMALL = 3
    NOT_FINITE = 4
    NEWTON = 5
    SINGULAR = 6
    EVENT = 7


class Watched(IntEnum):
    """What is watched of a state: its size against `limit`, or a sine or cosine near zero."""

    LIMITED = 0
    SINE = 1
    COSINE = 2


_DOUBLES = (
    *("t", "h", "previous", "t_end", "rtol", "atol", "h_max", "order", "slack_max", "limit"),
    *("near", "t_command"),
)
_INTEGERS = (
    *("adaptive", "capacity", "n_guard", "n_events", "stored", "accepted", "rejected", "broken"),
    "event",
)


class LoopState(ctypes.Structure):
    """The loop's settings and counters, the same memory as `dtc_loop` in C."""

    _fields_ = [(name, ctypes.c_double) for name in _DOUBLES] + [
        (name, ctypes.c_longlong) for name in _INTEGERS
    ]
