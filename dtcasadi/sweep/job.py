"""What a worker is sent: the scene, the paths and how to run, as plain values."""

import hashlib
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Protocol

import numpy as np

from ..scene import Scene
from .fixed import Fixed
from .single import Single
from .targets import Setup, setup_of


@dataclass(frozen=True, eq=False)
class Job:
    """A sweep without its inputs.

    Attributes:
        scene: the scene, its settings as they are to hold.
        names: the paths.
        save: quantities to save and how.
        step_s: fixed step [s]; None: each run is `dtcasadi.simulate` with the scene's method.
        options: of `dtcasadi.build`, in place of the scene's.
        fingerprint: digest of the above.
    """

    scene: Scene
    names: tuple[str, ...]
    save: tuple[tuple[str, str], ...]
    step_s: float | None
    options: dict[str, Any]
    fingerprint: str = field(init=False, default="")

    def __post_init__(self) -> None:
        """Make the fingerprint."""
        parts = (self.scene, self.names, self.save, self.step_s, self.options)
        object.__setattr__(self, "fingerprint", fingerprint(*parts))


class Engine(Protocol):
    """How the runs of a job are made, and the model they are made of."""

    setup: Setup

    def run(self, inputs: np.ndarray) -> dict[str, np.ndarray]:
        """Columns of the runs of some rows of inputs, among them `status` and `reason`."""


_engines: dict[str, Engine] = {}
_building = threading.Lock()


def engine_of(job: Job) -> Engine:
    """The engine of a job, built once in each process; the last few are kept.

    Raises:
        SweepError: a path names nothing.
        DtcasadiError: the model cannot be built.
    """
    with _building:
        if job.fingerprint not in _engines:
            setup = setup_of(job.scene, job.names, job.options)
            engine: Engine
            if job.step_s is None:
                engine = Single(setup, job.save)
            else:
                engine = Fixed(setup, job.save, job.step_s)
            while len(_engines) > 3:
                del _engines[next(iter(_engines))]
            _engines[job.fingerprint] = engine
        return _engines[job.fingerprint]


def compute(job: Job, inputs: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of some runs: what workers are asked for. The same inputs give the same columns."""
    return engine_of(job).run(inputs)


def fingerprint(*parts: Any) -> str:
    """A digest of values, the same in every process."""
    digest = hashlib.sha256()
    _digest(digest, parts)
    return digest.hexdigest()


def _digest(digest: Any, value: Any) -> None:
    """Feed a value: numbers by their digits, arrays by their bytes, dataclasses by their fields."""
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__qualname__.encode())
        for each in fields(value):
            digest.update(each.name.encode())
            _digest(digest, getattr(value, each.name))
    elif isinstance(value, Mapping):
        digest.update(f"{{{len(value)}".encode())
        for key in sorted(value):
            digest.update(str(key).encode())
            _digest(digest, value[key])
    elif isinstance(value, list | tuple):
        digest.update(f"[{len(value)}".encode())
        for item in value:
            _digest(digest, item)
    else:
        digest.update(f"{type(value).__qualname__}:{value!r};".encode())
