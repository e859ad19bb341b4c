"""Names and texts of exports: what is refused, what is made harmless."""

import re
import subprocess
from dataclasses import replace

import casadi as ca
import pytest
from c_compilers import needs_compiler
from exported import SQUARE, small_scene, x

import dtcasadi as dtc
from dtcasadi import codegen
from dtcasadi.codegen import names, texts
from dtcasadi.codegen.description import Label
from dtcasadi.errors import ModelError


@pytest.mark.parametrize("name", ["arm", "arm_2", "a1_b2", "o" * 60])
def test_names_that_are_taken(name):
    assert names.checked_export(name) == name


@pytest.mark.parametrize(
    "name",
    [
        "",
        "A",
        "arm_",
        "_arm",
        "a__b",
        "1a",
        "a-b",
        "a b",
        "a\nb",
        "../a",
        "a/b",
        "o" * 61,
        "é",
        None,
        3,
    ],
)
def test_names_of_another_form(name):
    with pytest.raises(
        ModelError, match="^name: expected lower-case words joined by _, at most 60"
    ):
        names.checked_export(name)


@pytest.mark.parametrize(
    "name", ["int", "sin", "sinf", "y0", "null", "jac", "class", "main", "casadi"]
)
def test_words_of_the_languages(name):
    with pytest.raises(ModelError, match="^name: expected no word of C, C[+][+], math.h or CasADi"):
        names.checked_export(name)


@pytest.mark.parametrize("name", ["math", "string", "all", "clean", "aux"])
def test_names_of_other_files_and_targets(name, tmp_path):
    with pytest.raises(
        ModelError, match="^name: expected no name of a standard header or a target"
    ):
        dtc.export_c({"square": SQUARE}, tmp_path / "c", name=name)
    assert not (tmp_path / "c").exists()


def test_functions_whose_c_names_would_meet(tmp_path):
    for function in ("real", "status", "work", "theta0"):
        with pytest.raises(
            ModelError, match=f"^functions: expected different C names, got '{function}"
        ):
            dtc.export_c({function: SQUARE}, tmp_path, name="arm")
    with pytest.raises(
        ModelError, match="^functions: expected different C names, got 'a_work' twice"
    ):
        dtc.export_c({"a": SQUARE, "a_work": SQUARE}, tmp_path, name="arm")
    with pytest.raises(ModelError, match="begin with raw or internal"):
        dtc.export_c({"raw_a": SQUARE}, tmp_path, name="arm")
    with pytest.raises(ModelError, match="^functions: expected at least one, got none"):
        dtc.export_c({}, tmp_path, name="arm")


def test_ports_that_c_cannot_take(tmp_path):
    for port in ("int", "work", "I"):
        function = ca.Function("f", [x], [x], [port], ["y"])
        with pytest.raises(ModelError, match=f"^f: port name: expected .* got '{port}'"):
            dtc.export_c({"f": function}, tmp_path, name="arm")
    same = ca.Function("f", [x], [x], ["a"], ["a"], {"allow_duplicate_io_names": True})
    with pytest.raises(ModelError, match="^f: expected ports with different names, got a, a"):
        dtc.export_c({"f": same}, tmp_path, name="arm")


def test_options_that_do_not_go_together(tmp_path):
    model = small_scene().build()
    cases = [
        ({"format": "cobol"}, "^format: expected one of .*, got 'cobol'"),
        ({"format": "text", "single": True}, "^format: expected "),
        ({"functions": ("sinus",)}, "^functions: expected names of mass_matrix, .*, got 'sinus'"),
        ({"functions": ("step",), "method": "rk9"}, "^method: expected one of "),
        ({"functions": ("step",), "step_s": -1.0}, "^step_s: expected a .*positive"),
        ({"name": None}, "^name: expected lower-case words"),
    ]
    for options, message in cases:
        with pytest.raises(ModelError, match=message):
            dtc.export_c(model, tmp_path, **{"name": "arm", **options})
    with pytest.raises(ModelError, match="^functions, method, step_s: expected a model"):
        dtc.export_c({"a": SQUARE}, tmp_path, name="arm", functions=("a",))
    with pytest.raises(
        ModelError, match="^functions_or_model: expected a Model, a Scene or a mapp"
    ):
        dtc.export_c(3, tmp_path, name="arm")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "bad", ["*/ int evil; /*", 'a\n#error "no"', "\\", "??/", "<b>`x`</b>", "\x00\x1b[0m", "é"]
)
def test_texts_that_would_leave_their_comment(bad):
    line = texts.comment(bad)
    assert line.isascii() and line.isprintable() and "*/" not in line and "/*" not in line
    assert not re.search(r"[\\\n`<>]|\?\?", line)


@needs_compiler
def test_hostile_titles_and_labels_compile(tmp_path):
    """What a scene file can hold reaches comments only."""
    bad = '*/ int evil = 1; /* "\\'
    export = codegen.described({"square": codegen.exposed("square", SQUARE, None, bad)}, name="arm")
    export = replace(export, title=bad, facts=(bad,), labels={"x": (Label("a", bad),)})
    dtc.export_c(export, tmp_path)
    for name in ("arm_core.c", "main.c", "arm.c"):
        words = ["gcc", "-std=c99", "-Wall", "-Werror", "-c", "-o", "x.o", name]
        subprocess.run(words, cwd=tmp_path, check=True)
    assert b"evil" not in subprocess.run(["nm", "x.o"], cwd=tmp_path, capture_output=True).stdout
