"""How many discs does a robot need? Static, modal and dynamic error against their number, and cost.

python examples/disc_count.py writes disc_count.png and disc_count.json into the current folder.
The paper leaves this open: "the effects of the number of discs on simulation accuracy should be
assessed". Its own robot is taken for a beam here: 3 long, with the stiffness, mass and damping per
length of its springs, hoops and joints, so that four discs are exactly the paper's.
"""

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import dtcasadi as dtc
from dtcasadi import presets, style
from dtcasadi.bench.dynamics import operations

SHORT = bool(os.environ.get("DTCASADI_SHORT"))
# Segments of each robot; the two finest make the reference (Richardson, order 2).
SEGMENTS = {"paper's robot": (2, 3, 6, 12, 24), "tentacle": (3, 6, 12), "arm": (4, 8, 16)}
KINDS = {
    "static": "tip at rest",
    "modal": "first frequency",
    "dynamic": "tip in motion",
}


def paper(segments: int) -> dtc.Scene:
    """The paper's robot, cut into another number of segments."""
    scene, fine = dtc.load_scene("seed_four_disc"), segments / 3
    seed = presets.seed_four_disc()
    middle = dtc.Disc.hoop(2.0 / fine, 1.0)
    last = dtc.Disc.hoop(1.0 / fine + 3.0, 1.0)
    springs = [
        replace(spring, discs=(i, i + 1), stiffness=fine * spring.stiffness, rest_length=None)
        for i in range(1, segments + 1)
        for spring in seed.springs[:3]
    ]
    robot = replace(
        seed,
        discs=(*[middle] * segments, last),
        threads=(dtc.Thread(1.0 / fine),) * segments,
        springs=tuple(springs),
        chambers=(dtc.Chamber((1, segments + 1)),),
        damping=dtc.Damping(c_a=100.0 * fine, c_b=100.0 * fine, c_w=100.0 * fine),
    )
    n_q = 2 * segments
    fields = {"q0": np.zeros(n_q), "qd0": np.zeros(n_q), "initial_chart": "planar"}
    return replace(scene, robot=robot, **fields)


def shipped(name: str) -> Callable[[int], dtc.Scene]:
    """A scene of the package, cut into another number of segments."""
    return lambda segments: dtc.load_scene(name).rediscretised(segments + 1)


ROBOTS = {"paper's robot": paper, "tentacle": shipped("tentacle"), "arm": shipped("arm")}


def figures(scene: dtc.Scene) -> dict[str, np.ndarray | float]:
    """What is compared, and what it costs."""
    model = scene.build(assembly="graph")
    rest = dtc.equilibrium(model, scene.pressure(scene.t_end))
    run = dtc.simulate(model, scene.x0(model), pressure=scene.pressure, t_end=scene.t_end,
                       method="rodas4", rtol=1e-6, atol=1e-8)  # fmt: skip
    R, r = run.at(np.linspace(0.0, scene.t_end, 101)).poses()
    centre = scene.robot.discs[-1].centre_of_mass
    R_rest, r_rest = rest.poses
    return {
        "static": r_rest[-1] + R_rest[-1] @ centre,
        "modal": float(rest.frequencies[0]),
        "dynamic": r[:, -1] + R[:, -1] @ centre,
        "operations": float(operations(model.function("ode"))),
        "evaluations": run.evaluations,
    }


def study(segments: dict[str, tuple[int, ...]]) -> dict:
    """Errors by robot and number of segments, relative to the extrapolated reference."""
    found: dict = {}
    for name, sizes in segments.items():
        rows = {m: figures(ROBOTS[name](m)) for m in sizes}
        coarse, fine = (rows[m] for m in sizes[-2:])
        ratio = (sizes[-1] / sizes[-2]) ** 2
        found[name] = {}
        for kind in KINDS:
            a, b = np.asarray(coarse[kind]), np.asarray(fine[kind])
            exact = b + (b - a) / (ratio - 1)
            scale = _scale(kind, exact, np.asarray(fine["dynamic"]))
            for m, row in rows.items():
                off = np.linalg.norm(np.atleast_2d(np.asarray(row[kind]) - exact), axis=-1).max()
                found[name].setdefault(m, {})[kind] = float(off / scale)
        for m, row in rows.items():
            for key in ("operations", "evaluations"):
                found[name][m][key] = row[key]
            print(name, m + 1, "discs", {k: f"{v:.3g}" for k, v in found[name][m].items()})
    return found


def _scale(kind: str, exact: np.ndarray, motion: np.ndarray) -> float:
    if kind == "modal":
        return float(abs(exact))
    start = motion[0]
    return float(np.linalg.norm(np.atleast_2d(exact) - start, axis=-1).max())


@style.styled
def draw(found: dict, path: Path) -> None:
    """Errors against the number of segments, the rule of thumb, and the cost."""
    figure = style.new_figure(style.WIDTH_IN, 0.42 * style.WIDTH_IN, layout="constrained")
    panels = figure.subplots(1, 4)
    for (name, rows), colour in zip(found.items(), style.LINES, strict=False):
        sizes = list(rows)
        for kind, axes in zip(KINDS, panels, strict=False):
            axes.plot(sizes, [rows[m][kind] for m in sizes], "o-", color=colour, markersize=4)
        cost = [rows[m]["operations"] * rows[m]["evaluations"] for m in sizes]
        errors = [rows[m]["dynamic"] for m in sizes]
        panels[3].plot(cost, errors, "o-", color=colour, markersize=4, label=name)
    segments = np.array([2.5, 26.0])
    for kind, axes in zip(KINDS, panels, strict=False):
        axes.plot(segments, RULE / segments**2, "--", color=style.BLACK, linewidth=0.8)
        axes.set_title(f"{kind}: {KINDS[kind]}", fontsize=8.0)
        axes.set(xlabel="number of segments", xscale="log")
        axes.set_xticks((3, 6, 12, 24), ["3", "6", "12", "24"])
    panels[3].plot([], [], "--", color=style.BLACK, linewidth=0.8, label=f"{RULE:g} / segments²")
    panels[3].set(xlabel="instructions of a run", xscale="log")
    panels[3].set_title("dynamic error and cost", fontsize=8.0)
    for axes in panels:
        axes.set(yscale="log", ylim=(5e-4, 1.2))
        axes.xaxis.set_minor_formatter("")
        axes.grid(color="#dddddd", linewidth=0.5)
    panels[0].set_ylabel("relative error")
    figure.legend(loc="outside lower center", ncols=4)
    style.finished(figure, path)


# Error of the motion times the square of the number of segments: what the picture shows.
RULE = 4.0


def main() -> None:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description="Error against number of discs.")
    parser.add_argument("--png", type=Path, default=Path("disc_count.png"))
    parser.add_argument("--json", type=Path, default=Path("disc_count.json"))
    parser.add_argument("--robots", nargs="+", choices=list(SEGMENTS), default=list(SEGMENTS))
    options = parser.parse_args()
    segments = {name: SEGMENTS[name] for name in options.robots}
    found = study({"paper's robot": (2, 3, 6)} if SHORT else segments)
    options.json.write_text(json.dumps(found, indent=1) + "\n")
    draw(found, options.png)


if __name__ == "__main__":
    main()
