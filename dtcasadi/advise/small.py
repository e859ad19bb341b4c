"""A small model's scene file, made from the file of the scene that was given."""

import json
import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import written
from ..scene import Scene, load_scene, scene_names

if TYPE_CHECKING:
    from .front import Advice


def small_scene(advice: "Advice", source: str | os.PathLike[str], target: Path) -> Path:
    """See `front.written_scene`."""
    from .front import described

    scene = advice.scene  # first: there may be none
    assert advice.best is not None
    tables = tomllib.loads(_text_of(source))
    best, given = advice.best.candidate, advice.given
    if best.n_discs != given.robot.n_discs:
        _cut(tables, scene, given)
    if not isinstance(tables.get("initial", {}).get("chart"), str | list) and "initial" in tables:
        tables["initial"]["chart"] = _chart(scene.initial_chart)
    model = tables.setdefault("model", {})
    model["chart"] = _chart(best.chart)
    model["velocity_terms"] = best.velocity_terms
    if best.actuator == "direct":
        model["actuator"] = "direct"
    if not best.contact:
        tables.pop("obstacle", None)
    if best.dynamic:
        run = tables["run"]
        run["method"] = best.method
        run.pop("step_ms", None)
        run["step"], run["steps"] = best.step_s, "fixed"
        if best.step_s is None:
            del run["step"], run["steps"]
    lines = [
        f"# {described(advice.best)}:",
        f"# error of the {advice.quantity} {advice.best.error:.2g} of its range of motion"
        f" (tolerance {advice.tolerance:g}).",
        *_lines(tables),
    ]
    with written(target) as file:
        file.write(("\n".join(lines) + "\n").encode())
    load_scene(target if target.is_absolute() else Path.cwd() / target)
    return target


def _text_of(source: str | os.PathLike[str]) -> str:
    if isinstance(source, str) and source in scene_names():
        place = resources.files("dtcasadi").joinpath("scenes", *f"{source}.toml".split("/"))
        return place.read_text(encoding="utf-8")
    return Path(source).read_text(encoding="utf-8")


def _cut(tables: dict[str, Any], scene: Scene, given: Scene) -> None:
    """Another number of discs, and everything that names a disc in its place."""
    robot = tables["robot"]
    robot["tube" if "tube" in robot else "rod"]["n_discs"] = scene.robot.n_discs
    places = [
        np.cumsum([0.0, *(thread.length for thread in each.robot.threads)])
        for each in (given, scene)
    ]
    before, after = (place / place[-1] for place in places)

    def moved(disc: int, least: int) -> int:
        return max(int(np.argmin(np.abs(after - before[disc - 1]))) + 1, least)

    for name, parts, least in (("forces", robot, 2), ("sensors", tables, 1)):
        for part in parts.get(name, []):
            if isinstance(part.get("disc"), int):
                part["disc"] = moved(part["disc"], least)
    start = tables.get("initial")
    if start is not None and (np.any(scene.q0) or np.any(scene.qd0)):
        kept = {key: start[key] for key in start if key.startswith("pressure")}
        tables["initial"] = {
            **kept,
            "chart": _chart(scene.initial_chart),
            "q": scene.q0.tolist(),
            "qd": scene.qd0.tolist(),
        }


def _chart(chart: Any) -> str | list[str]:
    if isinstance(chart, str):
        return chart
    return chart[0] if len(set(chart)) == 1 else list(chart)


def _lines(table: Mapping[str, Any], name: str = "") -> list[str]:
    """A TOML table: values first, then tables, then arrays of tables."""
    lines, inner = [], []
    for key, value in table.items():
        path = f"{name}.{key}" if name else key
        if isinstance(value, Mapping):
            below = _lines(value, path)
            inner += ["", f"[{path}]", *below]
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for part in value:
                inner += ["", f"[[{path}]]", *_lines(part, path)]
        else:
            lines.append(f"{key} = {_value(value)}")
    return lines + inner


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_value(item) for item in value)}]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)
