"""Compiled libraries kept between runs, in a folder that only the user can write.

An entry is `<key>.so` with `<key>.so.sha256`, the digest of its bytes. The key names everything
the library depends on, so an entry never changes its meaning and is never updated in place.
"""

import atexit
import contextlib
import errno
import functools
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from .compiler import LIBRARY_SUFFIX
from .errors import CompileError

if sys.platform != "win32":
    import fcntl

MAX_ENTRIES = 512
_ABANDONED_S = 86400.0


class CacheWarning(UserWarning):
    """Compiled libraries cannot be kept and will be built again in the next process."""


@dataclass(frozen=True)
class CacheFolder:
    """Where compiled libraries go.

    Attributes:
        path: a folder of mode 0700 owned by the user.
        problem: why it is a temporary one, removed at exit; empty for the lasting cache.
    """

    path: Path
    problem: str = ""


def cache_folder() -> CacheFolder:
    """`$DTCASADI_CACHE`, else `$XDG_CACHE_HOME/dtcasadi`, else `~/.cache/dtcasadi`.

    A folder that someone else could write to is not used, because a library is code: a private
    temporary folder takes its place, and `problem` says why.

    Raises:
        CompileError: there is no temporary folder either.
    """
    try:
        folder = _wanted_folder()
    except RuntimeError as error:  # no home directory
        return CacheFolder(_temporary_folder(), f"no cache folder: {error}")
    problem = _problem(folder)
    return CacheFolder(_temporary_folder(), problem) if problem else CacheFolder(folder)


def cached_library(key: str, build: Callable[[Path], None]) -> Path:
    """The library of a key, built at most once by all processes that ask for it.

    Args:
        key: hexadecimal digest of everything the library depends on.
        build: writes the library to the path it is given.

    Returns:
        Path of a library whose bytes were checked; unique to the key, as the loader requires.

    Raises:
        CompileError: from `build`, or there is no place to put the library.
    """
    place = cache_folder()
    if place.problem:
        _say_once(place.problem)
    try:
        return _entry(place.path, key, build)
    except OSError as error:
        problem = f"{place.path}: {_reason(error)}"
        temporary = _temporary_folder()
        if temporary == place.path:
            raise CompileError(f"no place for a compiled library: {problem}") from error
    _say_once(problem)
    try:
        return _entry(temporary, key, build)
    except OSError as error:
        raise CompileError(
            f"no place for a compiled library: {problem}; {temporary}: {_reason(error)}"
        ) from error


def _entry(folder: Path, key: str, build: Callable[[Path], None]) -> Path:
    library = folder / f"{key}{LIBRARY_SUFFIX}"
    if _intact(library):
        return library
    with _locked(folder / f"{key}.lock"):
        # Another process may have built it while this one waited.
        if not _intact(library):
            _prune(folder)
            with tempfile.TemporaryDirectory(prefix="build-", dir=folder) as scratch:
                # A short name, because the compiler's messages repeat it.
                fresh = Path(scratch) / f"twin{LIBRARY_SUFFIX}"
                build(fresh)
                digest = _digest_file(fresh)
                digest.write_text(_sha256(fresh), encoding="ascii")
                # Interrupted between the two, the digest does not fit and the entry is rebuilt.
                os.replace(fresh, library)
                os.replace(digest, _digest_file(library))
    return library


def _intact(library: Path) -> bool:
    """Whether an entry is complete and unchanged; marks it as used."""
    try:
        intact = _digest_file(library).read_text(encoding="ascii") == _sha256(library)
    except (OSError, UnicodeDecodeError):
        return False
    if intact:
        with contextlib.suppress(OSError):  # a read-only cache still serves
            os.utime(library)
    return intact


def _digest_file(library: Path) -> Path:
    return library.with_name(f"{library.name}.sha256")


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@contextlib.contextmanager
def _locked(file: Path) -> Iterator[None]:
    """Hold a lock between processes; where there is none, two may build the same entry."""
    if sys.platform == "win32":
        yield
        return
    with file.open("a") as stream:
        with contextlib.suppress(OSError):  # some network file systems have no locks
            fcntl.flock(stream, fcntl.LOCK_EX)
        try:
            yield
        finally:
            # Whoever waits on the removed file checks the entry again once it holds the lock.
            file.unlink(missing_ok=True)


def _prune(folder: Path) -> None:
    """Make room for one entry, the least recently used going first; drop abandoned builds."""
    with contextlib.suppress(OSError):  # another process may be pruning too
        libraries = folder.glob(f"*{LIBRARY_SUFFIX}")
        by_use = sorted(libraries, key=lambda file: file.stat().st_mtime, reverse=True)
        for library in by_use[MAX_ENTRIES - 1 :]:
            _digest_file(library).unlink(missing_ok=True)
            library.unlink(missing_ok=True)
        for scratch in folder.glob("build-*"):
            if time.time() - scratch.stat().st_mtime > _ABANDONED_S:
                shutil.rmtree(scratch, ignore_errors=True)


def _wanted_folder() -> Path:
    chosen = os.environ.get("DTCASADI_CACHE", "").strip()
    if chosen:
        return Path(chosen).expanduser().absolute()
    base = os.environ.get("XDG_CACHE_HOME", "")
    # The XDG specification: a relative path is to be ignored.
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "dtcasadi"


def _problem(folder: Path) -> str:
    """Create the folder where needed; why libraries in it cannot be trusted, or ""."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        return f"{folder}: cannot be created: {_reason(error)}"
    if sys.platform == "win32":
        return ""
    user = os.geteuid()
    # The link itself first: whoever owns it chooses where it points.
    if folder.lstat().st_uid != user or folder.stat().st_uid != user:
        return f"{folder}: expected a folder owned by user id {user}, got another owner"
    mode = stat.S_IMODE(folder.stat().st_mode)
    if mode & 0o077:
        return f"{folder}: expected mode 0700, got {mode:04o} (chmod 700 it)"
    return ""


@functools.cache
def _temporary_folder() -> Path:
    try:
        folder = Path(tempfile.mkdtemp(prefix="dtcasadi-"))
    except OSError as error:
        raise CompileError(f"no place for a compiled library: {_reason(error)}") from error
    owner = os.getpid()

    def remove() -> None:
        if os.getpid() == owner:  # a forked child leaves its parent's folder alone
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder


def _reason(error: OSError) -> str:
    return "the disk is full" if error.errno == errno.ENOSPC else error.strerror or str(error)


@functools.cache
def _say_once(problem: str) -> None:
    text = f"compiled libraries are not kept between runs: {problem}"
    warnings.warn(text, CacheWarning, stacklevel=3)
