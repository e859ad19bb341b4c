"""The wrapper of exported C: what it refuses, what it leaves alone, work space, threads."""

import ctypes
import re

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler
from exported import (
    MISALIGNED,
    NOT_CONVERGED,
    NOT_FINITE,
    NULL_POINTER,
    OK,
    OVERLAP,
    TOO_SMALL,
    Guarded,
    Library,
    built,
    evaluated,
    everything,
    random_arguments,
    work_bytes,
)

import dtcasadi as dtc

pytestmark = needs_compiler


def troubled() -> dict[str, ca.Function]:
    """Functions that fail: not finite, not converged, several results, none of the arguments."""
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 2)
    inputs = ["a", "b"]
    return {
        "inverse": ca.Function("f", [a, b], [1 / a, b], inputs, ["y", "z"]),
        "iterated": ca.Function("f", [a, b], [2 * a, a[0] > 0], inputs, ["y", "status"]),
        "constant": ca.Function("f", [], [ca.DM([1.0, 2.0])], [], ["y"]),
        "empty": ca.Function("f", [ca.SX.sym("e", 0), b], [3 * b], ["e", "b"], ["y"]),
    }


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Library:
    folder = tmp_path_factory.mktemp("small")
    exported = dtc.export_c(troubled(), folder / "c", name="small")
    return Library(exported, built(exported, ["-O1", "-ffast-math"], folder))


@pytest.fixture(scope="module")
def robot() -> Library:
    return Library(everything().exported, everything().library)


A, B = np.array([1.0, 2.0, 4.0]), np.array([5.0, 6.0])


class Call:
    """A call whose pointers a test may change before it is made."""

    def __init__(self, library: Library, name: str, arrays: list[np.ndarray]):
        self.library, self.name = library, name
        outputs = library.ports(name)[1]
        self.taken = [Guarded(a.nbytes, a.tobytes()) for a in arrays]
        self.given = [Guarded(8 * port["rows"] * port["columns"]) for port in outputs]
        self.work = Guarded(work_bytes(library.functions[name]))
        self.pointers: list[int | None] = [each.address for each in (*self.taken, *self.given)]
        self.work_address, self.n_bytes = self.work.address, len(self.work.bytes)

    def __call__(self) -> int:
        before = [each.bytes.tobytes() for each in self.given]
        status = self.library.raw(self.name, self.pointers, self.work_address, self.n_bytes)
        if status not in (OK, NOT_FINITE, NOT_CONVERGED):
            assert [each.bytes.tobytes() for each in self.given] == before
        assert all(each.intact() for each in (*self.taken, *self.given, self.work))
        return status

    def results(self) -> list[np.ndarray]:
        return [each.bytes.view(np.float64) for each in self.given]


def test_good_calls(small):
    call = Call(small, "inverse", [A, B])
    assert call() == OK
    np.testing.assert_array_equal(call.results()[0], 1 / A)
    np.testing.assert_array_equal(call.results()[1], B)
    call = Call(small, "constant", [])
    assert call() == OK
    np.testing.assert_array_equal(call.results()[0], [1.0, 2.0])


@pytest.mark.parametrize("port", range(2))
def test_an_argument_that_is_null_is_refused(small, port):
    call = Call(small, "inverse", [A, B])
    call.pointers[port] = None
    assert call() == NULL_POINTER


def test_an_empty_argument_may_be_null(small):
    call = Call(small, "empty", [np.zeros(0), B])
    call.pointers[0] = None
    assert call() == OK
    np.testing.assert_array_equal(call.results()[0], 3 * B)


def test_results_that_are_not_wanted(small):
    call = Call(small, "inverse", [A, B])
    call.pointers[2] = None
    assert call() == OK
    np.testing.assert_array_equal(call.results()[1], B)
    call.pointers[3] = None
    assert call() == NULL_POINTER


def test_work_space(small, robot):
    call = Call(small, "inverse", [A, B])
    call.n_bytes -= 1
    assert call() == TOO_SMALL
    call.n_bytes = 10**6
    assert call() == OK
    call.work_address += 4
    assert call() == MISALIGNED
    call.work_address = 0
    assert call() == NULL_POINTER


@pytest.mark.parametrize("shift, status", [(0, OVERLAP), (16, OVERLAP), (24, OK), (-24, OK)])
def test_a_result_on_top_of_an_argument_is_refused(small, shift, status):
    memory = Guarded(120)
    memory.bytes.view(np.float64)[:] = 1.0
    call = Call(small, "inverse", [A, B])
    call.pointers[0], call.pointers[2] = memory.address + 48, memory.address + 48 + shift
    assert call() == status
    assert memory.intact()


def test_a_result_on_top_of_another_is_refused(small):
    call = Call(small, "inverse", [A, B])
    call.pointers[3] = call.given[0].address + 8
    assert call() == OVERLAP


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_told_even_with_fast_math(small, bad):
    call = Call(small, "iterated", [np.array([-1.0, bad, 1.0]), B])
    assert call() == (OK if bad == 0 else NOT_FINITE)


def test_a_status_result_becomes_the_return_value(small):
    call = Call(small, "iterated", [A, B])
    assert call() == NOT_CONVERGED
    np.testing.assert_array_equal(call.results()[0], 2 * A)


def test_every_status_has_a_sentence(small):
    text = small.library.small_status_text
    text.restype = ctypes.c_char_p
    sentences = {text(status) for status in range(8)}
    assert len(sentences) == 8 and text(99) == b"unknown status"


def test_all_functions_of_a_robot(robot):
    """Canaries around every buffer, arguments untouched, results those of the graph."""
    model, export = everything().model, everything().export
    for each in export.functions:
        arguments = random_arguments(model, each.function, 5)
        expected = evaluated(each.function, arguments)
        names = [port.name for port in each.outputs]
        for k in range(5):
            status, results = robot.call(each.name, [a[:, k] for a in arguments])
            assert status == OK, each.name
            kept = [e[k] for e, name in zip(expected, names, strict=True) if name != "status"]
            for got, wanted in zip(results, kept, strict=True):
                # As in the parity tests: round-off times the condition of M.
                np.testing.assert_allclose(
                    got, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max(initial=1)
                )


def test_work_sizes_are_those_of_the_generated_code(robot):
    header = (robot.folder / "robot.h").read_text()
    for name, function in robot.functions.items():
        sizes = [ctypes.c_longlong() for _ in range(4)]
        getattr(robot.library, f"robot_raw_{name}_work")(*map(ctypes.byref, sizes))
        keys = ("sz_arg", "sz_res", "sz_iw", "sz_w")
        found = [size.value for size in sizes]
        assert found == [function["work"][key] for key in keys], name
        for key, size in zip(keys, found, strict=True):
            pattern = rf"^#define ROBOT_{name}_{key} {size}$".upper().replace("#DEFINE", "#define")
            assert re.search(pattern, header, re.MULTILINE), pattern


def test_theta0_and_names(robot):
    model = everything().model
    values = (ctypes.c_double * len(model.theta0)).in_dll(robot.library, "robot_theta0")
    np.testing.assert_array_equal(values, model.theta0)
    header = (robot.folder / "robot.h").read_text()
    for k, name in enumerate(model.state_names):
        unit = "rad" if k < model.n_q else "rad/s"
        assert re.search(rf"ROBOT_X_{name.upper()} = {k},? /\* {unit} \*/", header)
    assert f"#define ROBOT_N_X {model.n_x} " in header
    assert "#define ROBOT_THETA_FRAMES 0 " in header
