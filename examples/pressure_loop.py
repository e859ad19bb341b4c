"""Plant, filter and pressure controller as C in one program: exports, compiles and runs it.

A robot of four discs hangs from its root; its last disc is to hang at 2.75 and 2.45 by turns. The
filter reads a marker at the tip, the controller sees what the filter knows.

    python examples/pressure_loop.py [FOLDER]
"""

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import dtcasadi as dtc
from dtcasadi.codegen import exposed
from dtcasadi.compiler import find_compiler
from dtcasadi.sensors import Marker
from estimators import EKF
from ocp import Effort, Limits, PressureMPC, Problem, Tracking

STEP_S = 0.05
STEPS = 200
SOURCE = Path(__file__).with_suffix(".c")


def parts() -> tuple[PressureMPC, EKF]:
    """Controller and filter of the robot."""
    robot = dtc.load_scene("seed_four_disc").robot
    springs = tuple(replace(spring, stiffness=50.0) for spring in robot.springs)
    robot = replace(robot, springs=springs, damping=dtc.Damping(20, 20, 20))
    model = dtc.build(robot, chart="planar", actuator=dtc.Regulator(time_constant=0.1))
    tip = Marker(name="tip", disc=4, noise=0.01)
    discrete = model.discrete(STEP_S, method="midpoint", sensors=(tip,))
    problem = Problem(
        20,
        Tracking("tip", 2.75, channels="y"),
        effort=Effort(change=1e-4),
        limits=Limits(0.0, 14.0, rate=40.0),
    )
    n = len(discrete.state_names)
    ekf = EKF(discrete, x0=np.zeros(n), P0=np.full(n, 1e-4), Q_w=np.full(n, 1e-6))
    return PressureMPC(discrete, problem, u0=5.0), ekf


def export(folder: Path, controller: PressureMPC, ekf: EKF) -> list[Path]:
    """Write the functions as C, the program beside them; its C files."""
    discrete = ekf.discrete
    functions = {
        "plant": exposed("plant", discrete.step, discrete.native("step"), "the robot's step"),
        "tip": exposed("tip", discrete.sensors["tip"].output, title="the marker at the tip"),
        **ekf.functions("tip"),
        **controller.functions(),
    }
    exported = dtc.export_c(functions, folder, name="loop", force=True)
    shutil.copy(SOURCE, folder / SOURCE.name)
    files = [path for path in exported.files if path.suffix == ".c" and path.stem != "main"]
    return [*files, folder / SOURCE.name]


def main(folder: Path) -> int:
    """Export, compile, run, and say how it went."""
    sources = export(folder / "c", *parts())
    compiler = find_compiler()
    if compiler is None:
        print(f"{folder / 'c'}: written; no C compiler found to build it")
        return 0
    program = folder / "pressure_loop"
    # Not -march=native: with AVX-512, gcc 12 has been seen to get inlined products wrong.
    flags = ["-std=c99", "-O3", "-o", str(program)]
    subprocess.run([*compiler.command, *flags, *map(str, sources), "-lm"], check=True)
    done = subprocess.run([program, str(STEPS)], check=True, capture_output=True, text=True)
    rows = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    late = rows[160:180]
    off = np.max(np.abs(late[:, 1] - late[:, 2]))
    print(f"{len(rows)} steps, {int(np.sum(rows[:, 3] > 0))} without a plan of their own")
    print(
        f"two seconds after its last step the reference is met to {off:.3f} as read, noise included"
    )
    print(f"estimate within {np.max(rows[100:, 5]):.2g} of the states after five seconds")
    print(f"controller: {np.median(rows[:, 6]):.0f} us a step, {np.max(rows[:, 6]):.0f} at most")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "pressure_loop")))
