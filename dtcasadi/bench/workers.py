"""Work on several cores: results as they come, one line for what died, nothing left running."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from ..errors import BenchError

# Linear algebra of this size is slower on several threads, and the workers share the cores.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def results(
    function: Callable[..., Any], tasks: Sequence[tuple], *, workers: int, title: str
) -> Iterator[tuple[tuple, Any]]:
    """Each task's arguments with what the function returns for them, as they finish.

    Tasks start in the order given. With one worker they run in this process.

    Args:
        function: importable by name.
        tasks: arguments of each call.
        workers: number of processes.
        title: of the progress bar.

    Raises:
        BenchError: a process died, for want of memory for example.
    """
    from tqdm import tqdm

    bar = tqdm(total=len(tasks), desc=title, disable=not sys.stderr.isatty(), leave=False)
    with bar:
        if workers == 1:
            for task in tasks:
                yield task, function(*task)
                bar.update()
            return
        with _pool(workers) as pool:
            futures = {pool.submit(function, *task): task for task in tasks}
            try:
                for done in as_completed(futures):
                    yield futures[done], done.result()
                    bar.update()
            except BrokenProcessPool as error:
                raise BenchError("a worker process died: try fewer workers") from error


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Fresh processes, which end with the block whatever ends it."""
    others = set(multiprocessing.active_children())
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, initializer=_ignore_interrupts)
    try:
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _ignore_interrupts() -> None:
    """Ctrl-C reaches every process of a terminal; the first one ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
