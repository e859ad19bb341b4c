"""Shared by the tests of C twins: flags that compile quickly, and stand-in compilers."""

from pathlib import Path

import pytest

from dtcasadi.compile import CXX_FLAGS
from dtcasadi.compiler import CXX, DEFAULT_FLAGS, find_compiler

QUICK = tuple(flag for flag in DEFAULT_FLAGS if flag != "-O3")
QUICK_CXX = tuple("-O1" if flag == "-O3" else flag for flag in CXX_FLAGS)
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
needs_cxx = pytest.mark.skipif(find_compiler(CXX) is None, reason="no C++ compiler")


def script(folder: Path, name: str, text: str) -> str:
    file = folder / name
    file.write_text(f"#!/bin/sh\n{text}\n")
    file.chmod(0o755)
    return str(file)
