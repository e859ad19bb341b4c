"""Results of a sweep, as they come in and as a file that is whole at any time."""

import time
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import SweepError
from ..files import written
from .columns import LOST, MISSING

SCHEMA = 1
# The file is written again when this much time has passed, and this many times what writing took.
EVERY_S, SHARE = 2.0, 20.0


class Store:
    """Columns with a row for each run; rows not there yet have status -1.

    Attributes:
        status: of each run.
        reason: why a run failed.
        columns: the others, made when the first runs come in.
    """

    def __init__(self, n: int, path: Path | None, head: Mapping[str, np.ndarray]):
        self.n, self.path, self.head = n, path, dict(head)
        self.status = np.full(n, MISSING, dtype=np.int8)
        self.reason = np.full(n, "", dtype=object)
        self.columns: dict[str, np.ndarray] = {}
        self._saved, self._took = time.monotonic(), 0.0

    def resume(self) -> bool:
        """Take what the file holds of the same sweep; whether there was one.

        Raises:
            SweepError: it holds something else.
        """
        if self.path is None or not self.path.exists():
            return False
        try:
            with open(self.path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
                found = {name: file[name] for name in file.files}
            same = str(found["fingerprint"]) == str(self.head["fingerprint"])
        except (ValueError, KeyError, zipfile.BadZipFile, EOFError):
            raise _foreign(self.path, "something else") from None
        if not same:
            raise _foreign(self.path, "another one")
        self.status, self.reason = found["status"], found["reason"].astype(object)
        taken = {*self.head, "status", "reason"}
        self.columns = {name: values for name, values in found.items() if name not in taken}
        return True

    @property
    def todo(self) -> np.ndarray:
        """Numbers of the runs that are missing or were lost."""
        return np.flatnonzero((self.status == MISSING) | (self.status == LOST))

    def receive(self, rows: np.ndarray, found: Mapping[str, np.ndarray] | str) -> None:
        """Put in the columns of some runs, or why they were lost; save from time to time."""
        if isinstance(found, str):
            self.status[rows], self.reason[rows] = LOST, found
        else:
            self.status[rows], self.reason[rows] = found["status"], found["reason"]
            for name, values in found.items():
                if name in ("status", "reason"):
                    continue
                if name not in self.columns:
                    self.columns[name] = np.full((self.n, *values.shape[1:]), np.nan)
                self.columns[name][rows] = values
        if time.monotonic() - self._saved > max(EVERY_S, SHARE * self._took):
            self.save()

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything, by the names of the file."""
        return {
            **self.head,
            "status": self.status,
            "reason": self.reason.astype(str),
            **self.columns,
        }

    def save(self) -> None:
        """Write the file, whole or not at all.

        Raises:
            OSError: it cannot be written; an older one is left as it was.
        """
        start = time.monotonic()
        if self.path is not None:
            with written(self.path) as file:
                np.savez(file, **self.arrays())  # type: ignore[arg-type]
        self._saved = time.monotonic()
        self._took = self._saved - start


def _foreign(path: Path, what: str) -> SweepError:
    return SweepError(
        f"{path}: expected the results of this sweep, got {what}; name another file, or "
        "overwrite=True (--force)"
    )
