"""Scene files for tests: a small valid one, and one that uses every key of the format."""

import pytest

from dtcasadi.errors import SceneError
from dtcasadi.scene import Scene, parse_scene

SMALL = """\
schema = 1
[robot]
[[robot.discs]]
count = 3
shape = "hoop"
mass = 2
radius = 1
[robot.threads]
count = 2
length = 1
[run]
t_end = 3
"""

FULL = """\
schema = 1
name = "full_scene"
title = "A scene with every key"

[robot]
up = [0, -1, 0.5]
gravity = 9.80665

[[robot.discs]]
count = 2
shape = "solid"
mass_g = 12.5
radius_mm = 30

[[robot.discs]]
shape = "polygon"
mass = 0.02
vertices_mm = [[-20, 0], [20, 0], [20, 40], [-20, 40]]

[[robot.discs]]
shape = "custom"
mass = 0.015
inertia_g_mm2 = [[4000, 100, 0], [100, 4000, 0], [0, 0, 7000]]
centre_of_mass_mm = [1, 29, 2]
area_mm2 = 2500
centroid_mm = [0, 28, 0]
outline = [[0, 0, 0], [0.03, 0.03, 0], [-0.03, 0.03, 0]]

[[robot.threads]]
count = 2
length_mm = 25

[[robot.threads]]
length = 0.02
exit_point_mm = [0, 1, 0]
bend_deg = [10, 0, 0]
twist = [0, 0.1, 0.2]

[[robot.springs]]
discs = "all"
radius_mm = 28
at_deg = [90, 180, 270]
stiffness_n_per_mm = 0.2
damping = 0.05

[[robot.springs]]
discs = [1, 2]
start_at_deg = [0, 90]
end_at_deg = [90, 0]
stiffness = 150

[[robot.springs]]
discs = [3, 4]
start_mm = [0, 40, 0]
end_mm = [0, 50, 0]
stiffness = 100
rest_length_mm = 22
damping_n_s_per_mm = 0.001

[[robot.chambers]]
discs = "all"

[[robot.chambers]]
discs = [2, 3]
areas_cm2 = [10, 11]
centroids_mm = [[0, 10, 0], [0, 12, 0]]
radial_compliance_per_kpa = 0.002

[[robot.damping]]
count = 2
c_a = 1e-3
c_b_n_mm_s = 1
c_w = 1e-3

[[robot.damping]]
c_r = 2e-3

[[robot.forces]]
kind = "point_load"
disc = 4
magnitude_mn = 500
direction = [0, -1, 0]
point_mm = [0, 30, 0]

[[robot.forces]]
kind = "couple"
disc = 3
magnitude_n_mm = 2
direction = [0, 0, 2]
follower = true

[[robot.forces]]
kind = "payload"
disc = 4
mass_g = 20
inertia_kg_mm2 = [[1, 0, 0], [0, 1, 0], [0, 0, 2]]

[[robot.forces]]
kind = "drag"
disc = "all"
linear = 0.01
quadratic = [0.1, 0.1, 0.02]
flow_mm_per_s = [0, 0, 50]

[[robot.forces]]
kind = "wall_spring"
discs = "all"
radius_mm = 28
at_deg = [90, 270]
stiffness = 100
stiffening_per_mm2 = 0.01

[[robot.forces]]
kind = "fabric_bunching"
discs = [1, 2]
start_mm = [0, 1, 0]
end_mm = [0, 2, 0]
stiffness_n_per_mm = 2
gap_mm = 10

[[robot.forces]]
kind = "follower_load"
disc = 2
magnitude = 0.25
direction = [0, 0, 1]

[[obstacle]]
kind = "box"
centre_mm = [0, -60, 20]
size_mm = [50, 20, 40]
orientation_deg = [10, 0, 0]
rounding_mm = 2
penetration_mm = 1
load = 2
friction = 0.4
slip_speed_mm_per_s = 5
dissipation = 0.1
rim_points = 4
discs = [3, 4]

[model]
chart = ["cardan", "paper", "cardan"]
velocity_terms = "full"
damping = "physical"
inflation = "last_disc"

[model.actuator]
kind = "regulator"
time_constant_ms = 100
minimum_kpa = -5
maximum_kpa = 40
rate_limit_kpa_per_s = 200

[initial]
chart = "planar"
beta_deg = [5, -3, 2]
psi = 0.1
qd_deg_per_s = [10, 0, 0, 0, 0, -10]
pressure_kpa = [10, 0]

[pressure]
times_ms = [0, 500, 1500]
values_kpa = [[10, 0], [20, 5], [0, 0]]
kind = "linear"

[run]
t_end = 4
rtol = 1e-7
atol = 1e-9
method = "rk4"
step_ms = 0.5

[measure]
text = "It stays in one piece"
smallest_step_ms = 0.01
bound_of = "seed_four_disc"
"""


# Two chambers, and the header that a pressure can be appended to.
PRESSED = (
    SMALL
    + """\
[[robot.chambers]]
discs = "all"
[[robot.chambers]]
discs = [1, 2]
[pressure]
"""
)


def parse(text: str) -> Scene:
    """The scene of a text."""
    return parse_scene(text.encode(), "f.toml", "scene")


def errors_of(text: str) -> list[str]:
    """The error lines of a text, without the file's name."""
    with pytest.raises(SceneError) as caught:
        parse(text)
    assert all(line.startswith("f.toml: ") for line in caught.value.errors)
    return [line.removeprefix("f.toml: ") for line in caught.value.errors]


def edited(text: str, old: str, new: str) -> str:
    """The text with one passage replaced, which must be there once."""
    assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
    return text.replace(old, new)
