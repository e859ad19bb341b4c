"""Draws the pictures of README.md: python docs/make_figures.py."""

from pathlib import Path

import air
import contact
import control
import estimation
import identification
import inflation
import presets

import dtcasadi as dtc
from dtcasadi import plots
from dtcasadi.statics import plots as static_plots

FOLDER = Path(__file__).resolve().parent / "figures"

if __name__ == "__main__":
    run = dtc.simulate(dtc.load_scene("seed_four_disc"))
    FOLDER.mkdir(exist_ok=True)
    plots.filmstrip(run, FOLDER / "filmstrip.png")
    model = dtc.load_scene("seed_four_disc").build()
    static_plots.diagram(dtc.branch(model, "pressure", 0.5, 20.0), FOLDER / "equilibria.png")
    inflation.draw(FOLDER / "inflation.png")
    presets.draw(FOLDER / "presets.png")
    identification.draw(FOLDER / "identification.png")
    air.draw(FOLDER / "air.png")
    estimation.draw(FOLDER / "estimation.png")
    contact.draw(FOLDER / "contact.png")
    control.draw(FOLDER / "control.png")
    print(f"drawn into {FOLDER}: {run.message}")
