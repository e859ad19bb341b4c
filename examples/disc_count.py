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
from dtcasadi.recentring import unwound

SHORT = bool(os.environ.get("DTCASADI_SHORT"))
# Segments of each robot; the two finest make the reference (Richardson, order 2).
SEGMENTS = {"paper's robot": (2, 3, 6, 12, 24), "tentacle": (3, 6, 12), "arm": (4, 8, 16)}
KINDS = {
    "static": "tip at rest, over its way there",
    "modal": "first frequency about rest",
    "dynamic": "tip in motion, over its range",
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
    bends = unwound(model, np.append(rest.q, np.zeros(model.n_x - model.n_q)), rest.theta, "cardan")
    return {
        "static": r_rest[-1] + R_rest[-1] @ centre,
        "modal": float(rest.frequencies[0]),
        "dynamic": r[:, -1] + R[:, -1] @ centre,
        "bend": float(np.abs(np.array(bends[0]).reshape(-1, 5)[:, [0, 2]].sum(axis=1)).max()),
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
            for key in ("bend", "operations", "evaluations"):
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
    """Error against number of discs and against the bend of a segment; cost."""
    figure = style.new_figure(style.WIDTH_IN, 0.4 * style.WIDTH_IN, layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    marks = {"static": "o", "modal": "s", "dynamic": "^"}
    for (name, rows), colour in zip(found.items(), style.LINES, strict=False):
        sizes = list(rows)
        for kind, mark in marks.items():
            errors = [rows[m][kind] for m in sizes]
            left.plot([m + 1 for m in sizes], errors, mark + "-", color=colour, markersize=4)
            middle.plot([rows[m]["bend"] for m in sizes], errors, mark, color=colour, markersize=5)
        cost = [rows[m]["operations"] * rows[m]["evaluations"] for m in sizes]
        right.plot(cost, [rows[m]["dynamic"] for m in sizes], "^-", color=colour, label=name)
    for kind, mark in marks.items():
        right.plot([], [], mark, color=style.BLACK, label=f"{kind}: {KINDS[kind]}")
    bend = np.geomspace(0.02, 1.5, 20)
    middle.plot(bend, RULE * bend**2, "--", color=style.BLACK, linewidth=0.8)
    middle.annotate(f"{RULE:g} bend²", (bend[9], RULE * bend[9] ** 2), xytext=(-4, 6),
                    textcoords="offset points", ha="right")  # fmt: skip
    labels = ("number of discs", "largest bend of a segment at rest [rad]", "instructions of a run")
    for axes, label in zip((left, middle, right), labels, strict=True):
        axes.set(xscale="log", yscale="log", xlabel=label)
        axes.xaxis.set_minor_formatter("")
        axes.grid(color="#dddddd", linewidth=0.5)
    left.set_ylabel("relative error")
    right.set_ylabel("dynamic error")
    ticks = (3, 4, 5, 7, 9, 13, 17, 25)
    left.set_xticks(ticks, [str(tick) for tick in ticks])
    left.tick_params(axis="x", which="minor", bottom=False)
    figure.legend(loc="outside lower center", ncols=3)
    style.finished(figure, path)


# Error of the tip over the square of the largest bend of a segment: what the picture shows.
RULE = 0.2


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
