"""Two discs in the plane with a marker and an inertial chip: the smallest scene to estimate."""

from scene_texts import SMALL

SPRINGS = """
[[robot.springs]]
discs = "all"
at_deg = [90, 180, 270]
stiffness = 10
[[robot.chambers]]
discs = "all"
"""
TABLES = """
[[sensors]]
name = "tip"
kind = "marker"
disc = 2
noise_mm = 5
[[sensors]]
name = "chip"
kind = "imu"
disc = 2
gyroscope_noise = 0.01
accelerometer_noise = 0.1
[estimation]
step = 0.02
angle_sigma = 0.05
offset = 0.02
contact_force = [0, 0.5, 0]
contact_from = 0.2
contact_to = 0.4
"""
AIR = """
[[sensors]]
name = "gauge"
kind = "pressure"
noise = 0.01
[pressure]
times = [0, 0.5]
values = [1, 2]
kind = "linear"
[robot.damping]
c_a = 5
c_b = 5
"""
_TEXT = SMALL.replace("t_end = 3", "t_end = 0.5").replace("count = 3", "count = 2")
WATCHED = _TEXT.replace("count = 2\nlength", "length") + '[model]\nchart = "planar"\n' + TABLES
# With springs, so that it rests somewhere, and a chamber and its gauge.
WATCHED_AIR = WATCHED.replace("[run]", SPRINGS + "[run]") + AIR
