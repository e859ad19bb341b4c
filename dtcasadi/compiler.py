"""The compiler of C or C++: finding it, asking what it can do, running it.

A compiler is any command that understands GCC's options (gcc, clang, and their wrappers).
"""

import errno
import functools
import hashlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from .errors import CompileError

DEFAULT_FLAGS = (
    "-std=c99",
    "-O3",
    "-march=native",
    # -std=c99 alone would switch fused multiply-add off in GCC.
    "-ffp-contract=fast",
    # Neither changes a computed value: nobody reads errno or the floating-point exception flags.
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fPIC",
    "-shared",
)
FLAGS_OF_LIBRARIES = DEFAULT_FLAGS[-2:]
# A tenth of the time to compile, several times that of a call: for Functions that are run briefly.
QUICK_FLAGS = tuple("-O0" if flag == "-O3" else flag for flag in DEFAULT_FLAGS)
DEFAULT_TIMEOUT_S = 600.0
LIBRARY_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_NATIVE = "-march=native"
_TELLING = re.compile(r"\berror\b|undefined|cannot find", re.IGNORECASE)
_SHOWN_ERROR_LINES = 3
_PROBE_TIMEOUT_S = 30.0


class Language(NamedTuple):
    """What a compiler translates, and how one is found.

    title: for messages; code: as the option -x takes it; suffix: of files; variables: environment
    variables that name a compiler, the package's own first; programs: looked for on PATH.
    """

    title: str
    code: str
    suffix: str
    variables: tuple[str, str]
    programs: tuple[str, ...]


C = Language("C", "c", ".c", ("DTCASADI_CC", "CC"), ("gcc", "clang", "cc"))
CXX = Language("C++", "c++", ".cpp", ("DTCASADI_CXX", "CXX"), ("g++", "clang++", "c++"))


@dataclass(frozen=True)
class Compiler:
    """A compiler that answered when asked for its version.

    Attributes:
        path: absolute path of the executable.
        version: first line of its `--version`.
        arguments: what follows the executable in every call, e.g. ("gcc",) behind ccache.
        language: what it compiles.
    """

    path: str
    version: str
    arguments: tuple[str, ...] = ()
    language: Language = C

    @property
    def command(self) -> tuple[str, ...]:
        """The words that start every call of the compiler."""
        return (self.path, *self.arguments)


@dataclass(frozen=True)
class Target:
    """What a compiler builds for on this machine.

    Attributes:
        flags: the flags it accepts, `-march=native` left out where it is not known.
        features: digest of the macros it predefines: processor features and C library.
    """

    flags: tuple[str, ...]
    features: str


def find_compiler(language: Language = C) -> Compiler | None:
    """The compiler named by `DTCASADI_CC`, else by `CC`, else the first of gcc, clang and cc.

    For C++: `DTCASADI_CXX`, `CXX`, then g++, clang++ and c++. `DTCASADI_CC=none` switches all
    compilation off, `DTCASADI_CXX=none` that of C++.

    Returns:
        The compiler, or None when there is none or it is switched off.

    Raises:
        CompileError: the package's own variable names something that does not answer like a
            compiler.
    """
    search_path = os.environ.get("PATH", os.defpath)
    if _switched_off(language):
        return None
    own, usual = language.variables
    choice = os.environ.get(own, "").strip()
    if choice:
        compiler = _identify(choice, search_path, language)
        if compiler is None:
            expected = f"a {language.title} compiler on PATH that answers --version, or none"
            raise CompileError(f"{own}: expected {expected}, got {choice!r}")
        return compiler
    for name in (os.environ.get(usual, ""), *language.programs):
        compiler = _identify(name, search_path, language)
        if compiler is not None:
            return compiler
    return None


def _switched_off(language: Language) -> str:
    """The variable that switches compilation off, or ""."""
    for own in dict.fromkeys((C.variables[0], language.variables[0])):
        if os.environ.get(own, "").strip().lower() == "none":
            return own
    return ""


def compiler_named(words: str) -> Compiler | None:
    """The compiler a command line names, such as `arm-none-eabi-gcc`; None if it does not answer.

    The answer is remembered for each PATH.
    """
    return _identify(words, os.environ.get("PATH", os.defpath), C)


def require_compiler(language: Language = C) -> Compiler:
    """The compiler of `find_compiler`.

    Raises:
        CompileError: there is none, or it is switched off; the text says which.
    """
    compiler = find_compiler(language)
    if compiler is not None:
        return compiler
    off = _switched_off(language)
    if off:
        raise CompileError(f"compilation is switched off by {off}=none")
    programs, own = " or ".join(language.programs[:2]), language.variables[0]
    raise CompileError(
        f"no {language.title} compiler found: install {programs}, or name one in {own}"
    )


def build_library(
    compiler: Compiler, target: Target, source: str, library: Path, timeout_s: float
) -> None:
    """Compile a text into a shared library; scratch files go beside it.

    Args:
        compiler: the compiler to run.
        target: its flags, from `target_of`.
        source: C99, or C++17 for a compiler of C++.
        library: the file to write; its folder is used as scratch space.
        timeout_s: the compiler is stopped after this long [s].

    Raises:
        CompileError: the compiler reports an error, is stopped or cannot be run.
        OSError: the folder is full or not writable.
    """
    source_file = library.with_suffix(compiler.language.suffix)
    source_file.write_text(source, encoding="utf-8")
    build_files(compiler, target.flags, [source_file.name], library, timeout_s)


def build_files(
    compiler: Compiler,
    flags: Sequence[str],
    sources: Sequence[str],
    output: Path,
    timeout_s: float,
) -> None:
    """Compile and link files; scratch files go beside the output, from where the paths count.

    Raises:
        CompileError: the compiler reports an error, is stopped or cannot be run.
        OSError: the folder is full or not writable.
    """
    command = [*compiler.command, *flags, "-o", output.name, *sources, "-lm"]
    code, text = run_command(command, timeout_s, folder=output.parent)
    if "No space left on device" in text:
        raise OSError(errno.ENOSPC, "No space left on device", str(output.parent))
    if code != 0 or not output.is_file():
        raise CompileError(failure_text(command, code, text, compiler.language))


@functools.cache
def target_of(compiler: Compiler, flags: tuple[str, ...]) -> Target:
    """Ask the compiler which of the flags it takes and what they mean on this processor.

    Raises:
        CompileError: it refuses the flags, or has no C library headers.
    """
    command = [*compiler.command, *flags, "-E", "-dM", "-x", compiler.language.code, "-"]
    # math.h brings in the C library's version and shows that its headers are there.
    code, text = run_command(command, _PROBE_TIMEOUT_S, stdin="#include <math.h>\n")
    if code == 0:
        return Target(flags, hashlib.sha256(text.encode()).hexdigest())
    if _NATIVE in flags:
        return target_of(compiler, tuple(flag for flag in flags if flag != _NATIVE))
    raise CompileError(failure_text(command, code, text, compiler.language))


@functools.cache
def _identify(words: str, search_path: str, language: Language) -> Compiler | None:
    """The compiler behind a command line as found in `CC`; None where it does not answer."""
    try:
        name, *arguments = shlex.split(words)
    except ValueError:
        return None
    path = shutil.which(name, path=search_path)
    if path is None:
        return None
    try:
        code, text = run_command([path, *arguments, "--version"], _PROBE_TIMEOUT_S)
    except CompileError:
        return None
    if code != 0 or not text.strip():
        return None
    version = text.strip().splitlines()[0].strip()
    return Compiler(os.path.abspath(path), version, tuple(arguments), language)


def run_command(
    command: list[str], timeout_s: float, *, stdin: str = "", folder: Path | None = None
) -> tuple[int, str]:
    """Exit code and text of a command; never through a shell.

    Raises:
        CompileError: it cannot be run, or is stopped after the time given.
    """
    environment = dict(os.environ, LC_ALL="C")
    if folder is not None:
        environment["TMPDIR"] = str(folder)
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=environment,
            start_new_session=True,
            encoding="utf-8",
            errors="replace",
        )
    except OSError as error:
        raise CompileError(f"{command[0]}: cannot be run: {error.strerror}") from error
    with process:
        try:
            text, _ = process.communicate(stdin, timeout=timeout_s)
        except subprocess.TimeoutExpired:
            _stop(process)
            late = f"compiler stopped after {timeout_s:g} s\ncommand: {shlex.join(command)}"
            raise CompileError(late) from None
        except BaseException:  # an interrupt must not leave the compiler running
            _stop(process)
            raise
    return process.returncode, text


def _stop(process: subprocess.Popen[str]) -> None:
    """End a compiler driver together with the passes it started."""
    if sys.platform == "win32":
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGKILL)


def failure_text(command: list[str], code: int, text: str, language: Language = C) -> str:
    """The message of a failed call: first error lines, then the command."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if _TELLING.search(line)] or lines or ["no output"]
    shown = "\n".join(errors[:_SHOWN_ERROR_LINES])
    title = language.title
    return (
        f"{title} compiler failed with exit code {code}:\n{shown}\ncommand: {shlex.join(command)}"
    )
