"""`dtcasadi bench stability`: cells recomputed independently, reasons, what the command writes."""

import json

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.bench.stability import ROWS, method_choices, scene_choices
from dtcasadi.bench.stability_reference import reference_of, shipped
from dtcasadi.bench.stability_runs import cell_of, step_grid
from dtcasadi.cli import main

CELLS = [
    ("fold_back", "rk4"),
    ("fold_back", "heun"),
    pytest.param("long_conservative", "rk4", marks=pytest.mark.slow),
]


def test_rows_and_columns_are_complete():
    names = {n.removeprefix("stability/") for n in dtc.scene_names() if n.startswith("stability/")}
    assert set(scene_choices()) == names == set(ROWS)
    assert method_choices()[0] == "auto" and {"rk4", "rodas4", "gauss4"} < set(method_choices())


def test_the_grid_of_steps():
    grid = step_grid(1.0, 1e-3)
    assert len(grid) == 13 and grid[0] == 1 and grid[-1] == pytest.approx(1e-3)
    assert np.allclose(np.array(grid[:-1]) / grid[1:], 10**0.25)
    assert step_grid(0.2, 0.1) == pytest.approx([10**-0.75, 0.1])
    assert step_grid(50.0, 0.5) == pytest.approx([1, 10**-0.25])  # none above a second


# Rows of stages, then the weights: the textbook's Heun and RK4, written out.
OWN = {
    "heun": ([[], [1.0]], [0.5, 0.5]),
    "rk4": ([[], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6]),
}


def own_run(name: str, method: str, step_s: float, most: float) -> bool:
    """Whether a method's own loop keeps the energy below a bound to the horizon."""
    scene = shipped(name)
    model = scene.build()
    ode, n = model.compiled("ode"), model.n_q
    kinetic, potential = (model.compiled(f"{kind}_energy") for kind in ("kinetic", "potential"))
    x, u, theta = scene.x0(model), scene.pressure(0.0), model.theta0
    steps = int(np.ceil(scene.t_end / step_s - 1e-9))
    h = scene.t_end / steps
    rows, weights = OWN[method]
    for _ in range(steps):
        rates: list[np.ndarray] = []
        for row in rows:
            ahead = sum((a * rate for a, rate in zip(row, rates, strict=True)), 0.0 * x)
            rates.append(ode(x + h * ahead, u, theta))
        x = x + h * sum(b * rate for b, rate in zip(weights, rates, strict=True))
        if not np.all(np.isfinite(x)):
            return False
        energy = kinetic(x[:n], x[n:], theta)[0] + potential(x[:n], theta)[0]
        if not energy <= most:
            return False
    return True


def own_bound(name: str) -> float:
    """Twice the height of the energy above the lowest potential one, by SciPy's DOP853."""
    run = dtc.simulate(shipped(name), method="DOP853", rtol=1e-9, atol=1e-9)
    model, (q, qd) = run.model, (run.q, run.qd)
    V = np.array(model.potential_energy(q, run.thetas)).ravel()
    T = np.array(model.kinetic_energy(q, qd, run.thetas)).ravel()
    return float(V.min() + 2 * (np.max(T + V) - V.min()))


@pytest.mark.parametrize(("name", "method"), CELLS)
def test_a_cell_by_an_independent_loop(name, method):
    """The largest step on the grid; the bound agrees to what samples of the run miss."""
    reference = reference_of(name)
    assert reference.most == pytest.approx(own_bound(name), rel=5e-3)
    cell = cell_of(name, method, reference)
    largest = cell["max_stable_step_s"]
    assert cell["status"] == "ok" and isinstance(largest, float)
    assert own_run(name, method, largest, reference.most)
    steps = step_grid(1.0, 1.01 * largest)
    assert not any(own_run(name, method, step, reference.most) for step in steps)


def test_the_command(tmp_path, capsys):
    files = [f"--{kind}={tmp_path / f'map.{kind}'}" for kind in ("json", "png")]
    words = ["bench", "stability", "--workers", "1", "--methods", "rk4", "auto", "euler"]
    assert main([*words, "--scenes", "stability/fold_back", *files]) == 0
    record = json.loads((tmp_path / "map.json").read_text())
    assert record["schema"] == 1 and list(record["scenes"]) == ["fold_back"]
    for row in record["scenes"].values():
        assert list(row) == ["auto", "euler", "rk4"]
        for cell in row.values():
            assert cell["status"] in ("ok", "refused", "failed") and cell["reason"]
            assert {"max_stable_step_s", "error"} <= set(cell)
        assert row["auto"]["status"] == "ok" and row["auto"]["max_stable_step_s"] is None
    assert (tmp_path / "map.png").stat().st_size > 10_000
    assert "fold_back" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--scenes", "--methods"])
def test_unknown_names_are_one_line(option, capsys):
    assert main(["bench", "stability", option, "nowhere"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"dtcasadi: {option}: expected names of ") and "'nowhere'" in error
    assert error.count("\n") == 1


@pytest.mark.slow
def test_a_failure_tells_when_and_with_which_step():
    """Explicit Euler feeds oscillations: energy grows by 1 + (h omega)^2 a step."""
    cell = cell_of("long_conservative", "euler", reference_of("long_conservative"))
    assert cell["status"] == "failed" and cell["max_stable_step_s"] is None
    reason = str(cell["reason"])
    assert reason.startswith("energy above twice the reference's at t = ")
    assert reason.endswith("with steps of 0.001 s")


@pytest.mark.slow
def test_a_refusal_tells_the_singularity():
    """In the paper's chart M is singular at beta = 0, where this scene starts."""
    reference = reference_of("beta_0_coordinate")
    assert reference.end is None and reference.most > reference.top  # of the scene beside it
    for method in ("auto", "rk4"):
        cell = cell_of("beta_0_coordinate", method, reference)
        assert cell["status"] == "refused" and cell["kind"] == "singular"
        assert str(cell["reason"]).startswith("segment 1: beta = 0 rad is at a singularity")
