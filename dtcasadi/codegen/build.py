"""Building an export outside of its folder: does it compile, how long does it take, its size."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..compiler import (
    DEFAULT_TIMEOUT_S,
    C,
    Compiler,
    Language,
    build_files,
    compiler_named,
    failure_text,
    find_compiler,
    run_command,
    target_of,
)
from ..errors import CompileError

CORTEX = "arm-none-eabi-gcc"
CORTEX_FLAGS = (
    "-std=c99",
    "-Os",
    "-mcpu=cortex-m7",
    "-mthumb",
    "-mfpu=fpv5-sp-d16",
    "-mfloat-abi=hard",
    "-ffunction-sections",
    "-fno-math-errno",
)
_SIZE = "arm-none-eabi-size"


@dataclass(frozen=True)
class Build:
    """A trial build: seconds it took, the compiler's version line."""

    seconds: float
    compiler: str


def trial_build(
    files: Sequence[Path], flags: Sequence[str], language: Language = C
) -> Build | None:
    """Compile the files of a language to something that is thrown away; C is linked as well.

    Returns:
        None where there is no compiler, or it is switched off.

    Raises:
        CompileError: the compiler fails; its first error lines and the command.
    """
    compiler = find_compiler(language)
    if compiler is None:
        return None
    kind = ("-std=c99",) if language is C else ("-std=c++17", "-c")
    target = target_of(compiler, (*kind, *flags))
    sources = [str(path.absolute()) for path in files if path.suffix == language.suffix]
    with tempfile.TemporaryDirectory(prefix="dtcasadi-") as folder:
        start = time.perf_counter()
        build_files(compiler, target.flags, sources, Path(folder) / "trial", DEFAULT_TIMEOUT_S)
        return Build(time.perf_counter() - start, compiler.version)


def cortex_sizes(sources: dict[str, str]) -> dict[str, dict[str, int]] | str:
    """Bytes of each C file on a Cortex-M7, or why they are not known.

    Args:
        sources: texts by file name; headers too.

    Returns:
        File name -> text (code and constants), data and bss; or a sentence.
    """
    compiler = compiler_named(CORTEX)
    if compiler is None:
        return f"not measured: {CORTEX} is not installed"
    with tempfile.TemporaryDirectory(prefix="dtcasadi-") as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        try:
            return {
                file: _cortex_size(compiler, folder, file)
                for file in sources
                if file.endswith(".c")
            }
        except CompileError as error:
            return f"not measured: {str(error).splitlines()[0]}"


def _cortex_size(compiler: Compiler, folder: Path, file: str) -> dict[str, int]:
    command = [*compiler.command, *CORTEX_FLAGS, "-c", "-o", "out.o", file]
    code, text = run_command(command, DEFAULT_TIMEOUT_S, folder=folder)
    if code != 0:
        raise CompileError(failure_text(command, code, text))
    command = [_SIZE, "out.o"]
    code, text = run_command(command, DEFAULT_TIMEOUT_S, folder=folder)
    words = text.split("\n")[1].split()[:3] if code == 0 and "\n" in text else []
    if len(words) != 3 or not all(word.isdigit() for word in words):
        raise CompileError(f"{_SIZE}: expected three sizes, got {' '.join(text.split())[:80]!r}")
    return dict(zip(("text", "data", "bss"), map(int, words), strict=True))
