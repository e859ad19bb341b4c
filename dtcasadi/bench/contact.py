"""Time of a step with rigid contact against the same step without it."""

import argparse
import time
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from ..bound import Bound
    from ..cli.common import Report
    from ..model import Model
    from ..robot import Robot

STEP_S, POINTS, CALLS = 1e-3, 4, 400
# Disc 3 on the floor, disc 4 let down on it: two of eight points carry.
_FLOOR, _LET_DOWN_S, _PRESSURE = 2.5, 4.0, 12.0
_ROW = "{scene:10} {possible:>8} {active:>6} {step_us:>8} {ratio:>6} {real_time:>9}"
_TITLES = {
    "scene": "scene",
    "possible": "possible",
    "active": "active",
    "step_us": "step us",
    "ratio": "ratio",
    "real_time": "real time",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the benchmark."""
    parser.add_argument("--repeats", type=int, default=25, metavar="N", help="timings of each")


def run(options: argparse.Namespace, report: "Report") -> None:
    """Measure."""
    import numpy as np

    from ..compiler import find_compiler
    from ..contact import HalfSpace, Obstacle
    from ..presets import seed_four_disc

    compiler = find_compiler()
    report.section("contact", "the paper's four-disc robot in the plane, thread on top")
    report.note(repeats=options.repeats, compiler=compiler.version if compiler else None)
    report.line(
        "step: one step of method moreau of {step_ms:g} ms in compiled code; ratio: to the step "
        "without obstacles; real time: simulated seconds per second; best of {repeats} timings",
        step_ms=1e3 * STEP_S,
        repeats=options.repeats,
    )
    print("  " + _ROW.format(**_TITLES))
    plain = replace(seed_four_disc(), up=np.array([0.0, -1.0, 0.0]))
    shape = HalfSpace(np.array([0.0, _FLOOR, 0.0]), plain.up)
    floor = Obstacle(shape, friction=0.4, rim_points=POINTS, discs=(3, 4))
    free = None
    for scene, robot in (("none", plain), ("floor", replace(plain, obstacles=(floor,)))):
        possible, active, step_us = _measured(robot, options.repeats)
        free = free or step_us
        report.row(
            "timings",
            _ROW,
            scene=scene,
            possible=possible,
            active=active,
            step_us=step_us,
            ratio=step_us / free,
            real_time=STEP_S / (1e-6 * step_us),
        )


def _measured(robot: "Robot", repeats: int) -> tuple[int, int, float]:
    """Possible and active contacts, and the time of a step [us]."""
    import numpy as np

    from ..contact.detect import candidates_of
    from ..model import build

    model = build(robot, chart="planar")
    step = model.discrete(STEP_S, method="moreau").compiled("step")
    x, u = np.zeros(model.n_x), np.array([_PRESSURE])
    known = candidates_of(robot)
    active = 0
    for _ in range(int(_LET_DOWN_S / STEP_S)):
        if active == 2:
            break
        x = np.array(step(x, u, model.theta0)[0])
        active = _active(model, x, u) if known else 0
    step(x, u, model.theta0)
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(CALLS):
            step.run()
        best = min(best, (time.perf_counter() - start) / CALLS)
    return (len(known.points) if known else 0), active, 1e6 * float(best)


def _active(model: "Model", x: "np.ndarray", u: "np.ndarray") -> int:
    from ..contact.report import stepped

    kept: Bound = model.once("bench", lambda: stepped(model))
    pushes = kept(x, u, 0 * u, [STEP_S], model.theta0)[2][::3]
    return int((pushes > 0).sum())
