"""The picture of the two inflation models: where they part, and the work they do round a cycle."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import dtcasadi as dtc
from dtcasadi.bench.dynamics import seed_robot
from dtcasadi.style import BLUE, GREY, VERMILION, WIDTH_IN, finished, new_figure, styled

KINDS = {"last_disc": BLUE, "volume": VERMILION}
HIGHEST = 30.0  # pressure [Pa]
SIDE = 0.5  # of the rectangle in beta [rad]


@styled
def draw(path: Path) -> None:
    """Forces against bending, net work round cycles, and where the paper's robot rests."""
    figure = new_figure(WIDTH_IN, 3.0, layout="constrained")
    force, work, rest = figure.subplots(1, 3)
    bending(force)
    cycles(work)
    equilibria(rest)
    handles, labels = force.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    finished(figure, path)


def bending(axes: Axes) -> None:
    """Moment that bends four discs evenly, each by the angle against the one before."""
    seed = seed_robot(4)
    angles = np.linspace(-0.9, 1.5, 121)
    shares = np.tile([0.5, 0.5], 3)  # the thread takes half of each bend
    scale = 12.0 * seed.discs[0].area
    for kind, colour in KINDS.items():
        model = dtc.build(seed, chart="planar", inflation=kind)
        Q = np.array(model.inflation(np.outer(shares, angles), 12.0, model.theta0))
        axes.plot(angles, shares @ Q / scale, color=colour, label=f'inflation="{kind}"')
    axes.axvline(0.0, color=GREY, linewidth=0.6)
    axes.set_xlabel("bend of each segment [rad]")
    axes.set_ylabel("bending moment / (pressure · area) [m]")
    axes.set_title("equal when straight")


def cycles(axes: Axes) -> None:
    """Net work round the rectangle 0..SIDE in beta, 0..b in psi, of one segment."""
    seed = seed_robot(2)
    node, weight = np.polynomial.legendre.leggauss(12)
    node, weight = (node + 1) / 2, weight / 2
    sides = np.linspace(0.0, 1.5, 31)
    for kind, colour in KINDS.items():
        model = dtc.build(seed, chart="planar", inflation=kind)
        works = []
        for b in sides:
            corners = np.array([(0, 0), (SIDE, 0), (SIDE, b), (0, b), (0, 0)])
            total = 0.0
            for start, end in zip(corners, corners[1:], strict=False):
                points = start[:, None] + np.outer(end - start, node)
                Q = np.array(model.inflation(points, 1.0, model.theta0))
                total += float((end - start) @ Q @ weight)
            works.append(total / seed.discs[0].area)
        axes.plot(sides, works, color=colour)
    axes.set_xlabel(f"cycle: ψ to this angle [rad], β to {SIDE:g}")
    axes.set_ylabel("net work / (pressure · area) [m]")
    axes.set_title("a closed cycle of one segment")


def equilibria(axes: Axes) -> None:
    """Air in the paper's robot where it rests, hanging from its root, as the pressure rises."""
    scene = dtc.load_scene("seed_four_disc")
    full = scene.robot.discs[0].area * scene.robot.length
    for kind, colour in KINDS.items():
        model = scene.build(chart="planar", inflation=kind)
        pressures, shares = [], []
        for pressure in np.arange(0.0, HIGHEST + 0.1, 0.5):
            found = dtc.equilibrium(model, pressure)
            if not found.stable:
                break
            volume = model.volume(found.q, pressure, found.theta)
            pressures.append(pressure)
            shares.append(float(volume) / full)
        axes.plot(pressures, shares, color=colour)
        if pressures[-1] < HIGHEST:
            end = pressures[-1], shares[-1]
            axes.plot(*end, "x", color=colour)
            text = f"no stable rest\nabove {end[0]:g} Pa"
            axes.annotate(text, end, (6, -14), textcoords="offset points")
    axes.set_xlabel("pressure [Pa]")
    axes.set_ylabel("volume of air / (area · length)")
    axes.set_title("the paper's robot at rest")
