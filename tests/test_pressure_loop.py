"""The controller as exported C: the numbers of the one in Python, in a program of its own."""

import importlib.util
import subprocess
from pathlib import Path

import numpy as np
import pytest
from c_compilers import needs_compiler
from exported import gcc

from ocp import ControlStatus

pytestmark = needs_compiler
EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "pressure_loop.py"
STRICT = ["-std=c99", "-O1", "-Wall", "-Werror"]
STEPS = 1000


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("pressure_loop", EXAMPLE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def noise():
    """The program's own random numbers."""
    state = 1
    while True:
        state = (1664525 * state + 1013904223) % 2**32
        yield state / 2**32 - 0.5


def test_a_loop_in_c_gives_the_commands_of_the_one_in_python(example, tmp_path):
    controller, ekf = example.parts()
    sources = example.export(tmp_path / "c", controller, ekf)
    program = tmp_path / "loop"
    words = [*gcc().command, *STRICT, "-o", str(program), *map(str, sources), "-lm"]
    built = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False)
    assert built.returncode == 0, built.stderr[:2000]
    # Nothing is allocated.
    core = (tmp_path / "c" / "loop_core.c").read_text()
    assert "alloc(" not in core
    done = subprocess.run([program, str(STEPS)], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    rows = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert rows.shape == (STEPS, 7) and np.all(rows[:, 3] == ControlStatus.SOLVED)

    discrete, draw = ekf.discrete, noise()
    move, output = discrete.compiled("step"), discrete.sensors["tip"].output
    theta, x, est = discrete.theta0, np.zeros(13), ekf.start
    commands = []
    for k in range(STEPS):
        y = output(x, 5.0, theta).full()[:, 0] + 0.01 * np.array([next(draw) for _ in range(3)])
        if k % 50 == 49:
            y[2] = np.nan
        est = ekf.update(est, y, "tip", controller.command)
        u, _ = controller.step(est, reference=2.45 if k // 60 % 2 else 2.75)
        commands.append(u[0])
        x = move(x, u, theta).x_next
        est = ekf.predict(est, u)
    # Sums round differently at another optimization level; the loop does not let them grow.
    np.testing.assert_allclose(rows[:, 0], commands, rtol=0, atol=1e-9)
    assert np.ptp(commands) == 14.0
