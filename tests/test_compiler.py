"""dtcasadi.compiler: which compiler is found, and what its failures look like."""

import pytest
from c_compilers import QUICK, needs_compiler, script

from dtcasadi import compiler
from dtcasadi.errors import CompileError


def test_environment_chooses_the_compiler(tmp_path, monkeypatch):
    mine = script(tmp_path, "mycc", 'echo "mycc 1.2 $1"; echo more')
    monkeypatch.setenv("CC", f"{mine} -m64")
    monkeypatch.delenv("DTCASADI_CC", raising=False)
    found = compiler.find_compiler()
    assert found == compiler.Compiler(mine, "mycc 1.2 -m64", ("-m64",))
    assert found.command == (mine, "-m64")
    monkeypatch.setenv("DTCASADI_CC", mine)
    assert compiler.find_compiler() == compiler.Compiler(mine, "mycc 1.2 --version")
    monkeypatch.setenv("DTCASADI_CC", "none")
    assert compiler.find_compiler() is None


def test_a_machine_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    for variable in ("CC", "DTCASADI_CC"):
        monkeypatch.delenv(variable, raising=False)
    assert compiler.find_compiler() is None
    with pytest.raises(CompileError) as caught:
        compiler.require_compiler()
    expected = "no C compiler found: install gcc or clang, or name one in DTCASADI_CC"
    assert str(caught.value) == expected


@pytest.mark.parametrize("cc", ["no-such-compiler", "'unfinished", "/dev/null"])
def test_an_unusable_cc_is_passed_over_but_not_an_unusable_dtcasadi_cc(cc, tmp_path, monkeypatch):
    gcc = script(tmp_path, "gcc", "echo gcc 9")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", cc)
    monkeypatch.delenv("DTCASADI_CC", raising=False)
    assert compiler.find_compiler() == compiler.Compiler(gcc, "gcc 9")
    monkeypatch.setenv("DTCASADI_CC", cc)
    with pytest.raises(CompileError) as caught:
        compiler.find_compiler()
    expected = "expected a C compiler on PATH that answers --version, or none"
    assert str(caught.value) == f"DTCASADI_CC: {expected}, got {cc!r}"


@needs_compiler
def test_a_compile_error_names_first_errors_and_command(tmp_path):
    found = compiler.find_compiler()
    target = compiler.target_of(found, QUICK)
    source = "int f(void) { return first; }\nint g(void) { return second; }\n"
    with pytest.raises(CompileError) as caught:
        compiler.build_library(found, target, source, tmp_path / "x.so", 60)
    text = str(caught.value)
    assert text.startswith("C compiler failed with exit code 1:\nx.c:1:")
    assert "first" in text and "second" in text
    assert text.splitlines()[-1].startswith(f"command: {found.path} -std=c99")


def test_march_native_is_left_out_where_it_is_not_known(tmp_path):
    text = 'for a in "$@"; do [ "$a" = -march=native ] && echo "error: bad value" && exit 1; done'
    old = compiler.Compiler(script(tmp_path, "oldcc", f"{text}; echo ok"), "oldcc 1")
    target = compiler.target_of(old, ("-O3", "-march=native", "-fPIC"))
    assert target.flags == ("-O3", "-fPIC")


def test_a_slow_compiler_is_stopped_with_its_children(tmp_path):
    slow = compiler.Compiler(script(tmp_path, "slowcc", "sleep 60 & wait"), "slowcc 1")
    target = compiler.Target(("-O3",), "")
    with pytest.raises(CompileError) as caught:
        compiler.build_library(slow, target, "", tmp_path / "x.so", 0.2)
    assert str(caught.value).startswith("compiler stopped after 0.2 s\ncommand: ")


def test_a_compiler_that_vanished(tmp_path):
    gone = compiler.Compiler(str(tmp_path / "gone"), "gone 1")
    with pytest.raises(CompileError, match="gone: cannot be run: No such file or directory"):
        compiler.build_library(gone, compiler.Target((), ""), "", tmp_path / "x.so", 1)


def test_a_compiler_on_a_full_disk_is_not_a_compile_error(tmp_path):
    text = 'echo "as: error: No space left on device"; exit 1'
    full = compiler.Compiler(script(tmp_path, "fullcc", text), "fullcc 1")
    with pytest.raises(OSError, match="No space left on device"):
        compiler.build_library(full, compiler.Target((), ""), "", tmp_path / "x.so", 10)
