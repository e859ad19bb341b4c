"""Random and mutated scene files give an error line or a valid scene, never a traceback."""

import random
import re
from importlib import resources
from typing import Any

import numpy as np
import pytest
from scene_texts import FULL, SMALL

from dtcasadi.errors import SceneError
from dtcasadi.forces.protocol import numbers_in
from dtcasadi.scene import Scene, parse_scene, scene_names

SCENES = resources.files("dtcasadi") / "scenes"
TEXTS = [SMALL, FULL, FULL] + [(SCENES / f"{name}.toml").read_text() for name in scene_names()]
LINES = sorted({line for text in TEXTS for line in text.splitlines() if line.strip()})
HEADERS = [line for line in LINES if line.startswith("[")]
PAIRS = [line for line in LINES if "=" in line and not line.startswith("#")]
VALUES = [
    *("0", "1", "2", "-1", "0.5", "-0.0", "3.0", "4096", "4097", "1e29", "1e31", "1e-31", "5e-324"),
    *("nan", "-nan", "inf", "-inf", "1e400", "1e999999", "9" * 40, "9" * 400, "9" * 5000, "true"),
    *("0x" + "f" * 300, "0x" + "f" * 6000, "0o777", "0b1", "1_000", "false", "1979-05-27"),
    *("1979-05-27T07:32:00Z", "07:32:00", '""', '"x"', '"all"', '"\\u0000"', '"\\ud800"', "'é☃'"),
    *("[]", "[[]]", "[[], []]", "[1]", "[1, 2]", "[1, 2, 3]", "[1, 2, 3, 4]", "[true]", "[nan]"),
    *("[[1, 2], [3]]", "[[1, 2], 3]", '[1, "x"]', "[1, [2]]", "[{}]", "{}", "{ a = 1 }", "[1e308]"),
    *("[[0, 0], [1, 0], [0, 1]]", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "[" * 60 + "]" * 60),
    *('"hoop"', '"custom"', '"planar"', '"paper"', '["planar", "paper", "rigid"]', '"linear"'),
    *("[1979-05-27]", f"[{'9' * 400}, 1.0]", "[0x" + "f" * 6000 + "]", f"[{'1, ' * 3000}]", ""),
]
SUFFIXES = ["_mm", "_kpa", "_deg", "_g", "_", "_x", "s", ".x", " "]


def mutated(rng: random.Random) -> bytes:
    """A scene file with one to three mutations of its lines or bytes."""
    lines = rng.choice(TEXTS).splitlines()
    for _ in range(rng.randint(1, 3)):
        mutate_a_line(lines, rng)
    data = "\n".join(lines).encode()
    return spoil_bytes(data, rng) if rng.random() < 0.15 else data


def mutate_a_line(lines: list[str], rng: random.Random) -> None:
    k = rng.randrange(len(lines)) if lines else 0
    line = lines[k] if lines else ""
    key, equals, _ = line.partition(" = ")
    kind = rng.randrange(12)
    if kind < 4 and equals:
        factor = rng.choice([0.5, 1.5, 2, -1, 1e3, 1e-6])
        lines[k] = re.sub(r"(?<= )\d[\d.]*\b", lambda m: str(float(m[0]) * factor), line)
    elif kind < 7 and equals:
        lines[k] = f"{key} = {rng.choice(VALUES)}"
    elif kind == 7 and equals:
        lines[k] = rename(key, rng) + line[len(key) :]
    elif kind == 8:
        lines[k : k + 1] = []
    elif kind == 9:
        lines.insert(k, rng.choice([line, *rng.sample(LINES, 4)]))
    elif kind == 10:
        lines[k : k + 1] = [rng.choice(HEADERS)] if line.startswith("[") else [line]
    else:
        other = rng.choice(TEXTS).splitlines()
        lines[k:] = other[rng.randrange(len(other)) :]


def rename(key: str, rng: random.Random) -> str:
    """The key misspelt, with another suffix, or exchanged."""
    if rng.random() < 0.3:
        return rng.choice(PAIRS).partition(" = ")[0]
    if rng.random() < 0.5:
        return key + rng.choice(SUFFIXES)
    k = rng.randrange(len(key))
    return key[:k] + rng.choice("abcxyz_0-") + key[k + rng.randrange(2) :]


def spoil_bytes(data: bytes, rng: random.Random) -> bytes:
    """Some bytes changed, added or taken away."""
    content = bytearray(data)
    for _ in range(rng.randint(1, 5)):
        k = rng.randrange(len(content) + 1)
        patch = rng.randbytes(rng.randrange(4))
        content[k : k + rng.randrange(4)] = patch
    return bytes(content)


def made_up(rng: random.Random) -> bytes:
    """A file of random tables and keys of the format, with random values."""
    lines = ["schema = 1"]
    for header in rng.sample(HEADERS, rng.randint(1, len(HEADERS))):
        lines.append(header)
        for pair in rng.sample(PAIRS, rng.randint(0, 4)):
            wild = rng.random() < 0.5
            lines.append(f"{pair.partition(' = ')[0]} = {rng.choice(VALUES)}" if wild else pair)
    return "\n".join(lines).encode()


def noise(rng: random.Random) -> bytes:
    """Bytes, or characters that mean something in TOML."""
    if rng.random() < 0.3:
        return rng.randbytes(rng.randrange(200))
    return "".join(rng.choices("[]{}=.,\"'#\n\\ \t1eE+-_xab", k=rng.randrange(200))).encode()


def is_scene(data: bytes) -> bool:
    """Whether the bytes are a scene; either a sound one or error lines must come out."""
    try:
        scene = parse_scene(data, "f.toml")
    except SceneError as error:
        assert error.errors
        for line in error.errors:
            assert line.startswith("f.toml: ") and line.isprintable() and len(line) < 600, line
            assert "expected" in line or "more errors" in line
        return False
    assert_sound(scene)
    return True


def assert_sound(scene: Scene) -> None:
    robot = scene.robot
    numbers: list[Any] = [scene.q0, scene.qd0, scene.pressure.values, robot.up, scene.t_end]
    numbers += [a for d in robot.discs for a in (d.mass, d.inertia, d.centre_of_mass, d.centroid)]
    numbers += [a for s in robot.springs for a in (s.start, s.end, s.stiffness, s.rest_length)]
    numbers += [a for t in robot.threads for a in (t.length, t.exit_point, t.bend, t.twist)]
    numbers += [a for c in robot.chambers for a in (c.areas, c.centroids)]
    numbers += [a for f in robot.forces for a in numbers_in(f).values()]
    assert all(np.all(np.isfinite(number)) for number in numbers)
    assert scene.pressure.n_u == len(robot.chambers)
    assert scene.initial_chart is not None and isinstance(robot.damping, tuple)
    assert len(scene.initial_chart) == len(robot.threads) == len(robot.damping)
    assert len(scene.q0) == len(scene.qd0)
    assert scene.t_end > 0 and scene.title.isprintable()


def run(seeds: range) -> None:
    outcomes = []
    for seed in seeds:
        rng = random.Random(seed)
        make = rng.choices([mutated, made_up, noise], [8, 1, 1])[0]
        data = make(rng)
        try:
            outcomes.append(is_scene(data))
        except BaseException:
            print(f"seed {seed}:\n{data.decode(errors='backslashreplace')}")
            raise
    # Neither outcome may be rare, or the mutations would test nothing.
    assert 0.05 < np.mean(outcomes) < 0.6


def test_the_files_to_be_mutated_are_scenes():
    assert all(is_scene(text.encode()) for text in TEXTS)


def test_mutated_files_give_an_error_line_or_a_scene():
    run(range(200))


@pytest.mark.slow
def test_ten_thousand_mutated_files_give_an_error_line_or_a_scene():
    run(range(1000, 11_000))
