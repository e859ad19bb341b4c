"""Chunks of runs on this machine's processes or on any executor, whatever dies on the way."""

import multiprocessing
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from typing import NamedTuple

import numpy as np

from ..errors import SweepError
from .job import Job, compute

# Chunks under way at a time on an executor of unknown size.
WINDOW = 256
Receive = Callable[[np.ndarray, "dict[str, np.ndarray] | str"], object]


class Chunk(NamedTuple):
    """Runs that are made together: their numbers, from 0, and whether they failed together once."""

    rows: np.ndarray
    again: bool = False


def scheduled(
    job: Job,
    inputs: np.ndarray,
    chunks: list[np.ndarray],
    receive: Receive,
    *,
    executor: Executor | None,
    workers: int,
) -> None:
    """Make the runs of all chunks; `receive` gets each row once.

    A chunk whose worker dies or raises is cut in two and tried again, down to the run to blame,
    which is received as a sentence.

    Args:
        job: what to compute.
        inputs: of all runs.
        chunks: numbers of the runs to make, together.
        receive: called here with rows and their columns, or why there are none.
        executor: where to compute; None: here, with as many processes as `workers`.
        workers: processes of this machine.

    Raises:
        SweepError: the executor that was given is shut down or broken.
    """
    if executor is None and (workers == 1 or len(chunks) == 1):
        for rows in chunks:
            receive(rows, compute(job, inputs[rows]))
        return
    queue = deque(Chunk(rows) for rows in chunks)
    if executor is not None:
        if _Rounds(job, inputs, receive, queue).over(executor, WINDOW):
            raise SweepError("executor: expected one that takes work, got a broken one")
        return
    suspects: deque[Chunk] = deque()
    while queue or suspects:
        # Where several were under way when the pool broke, one at a time tells whose fault it is.
        careful = bool(suspects)
        rounds = _Rounds(job, inputs, receive, suspects if careful else queue)
        before = set(multiprocessing.active_children())
        with local_pool(1 if careful else workers) as pool:
            broken = rounds.over(pool, 1 if careful else 2 * workers)
            if broken:
                # A process that was being started when the pool broke would be waited for forever.
                for child in set(multiprocessing.active_children()) - before:
                    child.kill()
        if careful and broken:
            rounds.blame(broken[0], "the process that computed it died")
        else:
            suspects.extend(broken)


def local_pool(workers: int) -> ProcessPoolExecutor:
    """Processes that start from nothing, so that no state of this one can harm them.

    Raises:
        SweepError: called while a script is imported by such a process.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SweepError(
            'sweep: expected a call under `if __name__ == "__main__":`, as its processes import '
            "the script; or workers=1"
        )
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


class _Rounds:
    """Work through a queue of chunks on an executor."""

    def __init__(self, job: Job, inputs: np.ndarray, receive: Receive, queue: deque[Chunk]):
        self.job, self.inputs, self.receive, self.queue = job, inputs, receive, queue

    def over(self, executor: Executor, window: int) -> list[Chunk]:
        """Until the queue is empty or the executor breaks; returns what was under way then."""
        pending: dict[Future, Chunk] = {}
        broken: list[Chunk] = []
        try:
            while (self.queue and not broken) or pending:
                while self.queue and not broken and len(pending) < window:
                    chunk = self.queue.popleft()
                    try:
                        future = executor.submit(compute, self.job, self.inputs[chunk.rows])
                    except (BrokenExecutor, RuntimeError):
                        broken.append(chunk)
                        break
                    pending[future] = chunk
                for future in wait(pending, return_when=FIRST_COMPLETED).done:
                    broken += self._finished(pending.pop(future), future)
        except BaseException:
            for future in pending:
                future.cancel()
            raise
        return broken

    def _finished(self, chunk: Chunk, future: Future) -> Iterator[Chunk]:
        try:
            columns = future.result()
        except BrokenExecutor:
            yield chunk
        except CancelledError:
            raise SweepError(
                "executor: expected one that runs to the end, got a cancelled run"
            ) from None
        except Exception as error:
            self.blame(chunk, f"{type(error).__name__}: {' '.join(str(error).split())}")
        else:
            self.receive(chunk.rows, columns)

    def blame(self, chunk: Chunk, why: str) -> None:
        """Try the halves of a chunk, a single run once more; then say why it is missing."""
        rows = chunk.rows
        if len(rows) > 1:
            half = len(rows) // 2
            self.queue.extend([Chunk(rows[:half]), Chunk(rows[half:])])
        elif not chunk.again:
            self.queue.append(Chunk(rows, again=True))
        else:
            self.receive(rows, why)


def progress_bar(total: int, done: int):  # noqa: ANN201
    """A bar on a terminal, over runs."""
    from tqdm import tqdm

    bar = tqdm(
        total=total,
        initial=done,
        unit="run",
        leave=False,
        delay=1.0,
        disable=not sys.stderr.isatty(),
    )
    return bar
