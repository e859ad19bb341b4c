"""The table [control], sensors of bend and coordinates, and a scene as a control experiment."""

import re

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.errors import ControlError, ModelError, SceneError
from dtcasadi.scene import parse_scene
from dtcasadi.sensors import Bend, Coordinates
from ocp import HalfSpace, Sphere
from ocp.scenario import experiment, spans

TEXT = """
schema = 1
[robot.tube]
n_discs = 3
length_mm = 200
radius_mm = 20
wall_thickness_mm = 1.5
youngs_modulus_mpa = 0.593
poissons_ratio = 0.5
density = 1080
fabric = "strip"
retardation_time = 0.02
[model]
chart = "planar"
actuator = "regulator"
[run]
t_end = 1
[[sensors]]
name = "tip"
kind = "marker"
disc = 3
noise_mm = 0.3
[[sensors]]
name = "bend"
kind = "bend"
disc = 3
noise_deg = 0.2
[estimation]
truth_discs = 4
truth_payload_g = 5
contact_force = [0, 0.1, 0]
contact_from = 0.5
contact_to = 9
[control]
step_ms = 50
horizon = 4
outputs = ["bend"]
channels = [["x"]]
weight = 100
change_per_kpa2 = 0.02
maximum_kpa = 20
rate_kpa_per_s = 60
delay_ms = 10
terminal = "riccati"
[control.reference]
times = [0, 1, 2]
values_kpa = [2, 2, 4]
kind = "linear"
[[control.keep_out]]
output = "tip"
centre_mm = [0, 100, 100]
radius_mm = 30
linear = 5
[[control.keep_out]]
output = "tip"
normal = [0, 0, 1]
offset_mm = 20
"""


@pytest.mark.slow
def test_a_scene_becomes_a_problem_and_a_plant_that_differs():
    scene = parse_scene(TEXT.encode())
    found = experiment(scene)
    problem, s = found.stages.problem, found.stages
    assert s.horizon == 4 and problem.terminal == "riccati" and np.all(s.change == 0.02e-6)
    assert np.all(s.upper == 20e3) and np.allclose(s.rate, 3e3) and np.all(s.lower == 0)
    ball, plane = problem.soft
    assert isinstance(ball, Sphere) and ball.radius == 0.03 and ball.linear == 5
    assert isinstance(plane, HalfSpace) and plane.offset == 0.02
    true = found.robot.model
    assert true.n_discs == 4 and s.discrete.model.n_discs == 3
    assert sum(disc.mass for disc in true.robot.discs) < 5e-3 + sum(
        disc.mass for disc in scene.rediscretised(4).robot.discs
    )
    # The reference is where the true robot rests: by its statics, without this module.
    for t, pressure in ((0.5, 2e3), (2.0, 4e3)):
        rest = dtc.equilibrium(true, pressure)
        assert np.allclose(s.references(t)[0], np.sum(rest.q), atol=1e-8)
    assert found.plant.delay_s == 0.01 and np.all(found.plant.u0 == 2e3)
    assert not np.any(found.plant.changes(0.4)["wrench"])
    assert np.array_equal(found.plant.changes(0.6)["wrench"], [0, 0.1, 0, 0, 0, 0])
    rests, moves = spans(scene.control.reference, 2.0)
    assert rests == [(0.5, 0.75)] and moves == [(1.0, 2.0)]


WRONG = [
    ('outputs = ["bend"]\n', "", "control.outputs: expected a list of names, got"),
    ("horizon = 4", "horizon = 0", "control.horizon: expected an integer from 1 to 10000, got 0"),
    ('terminal = "riccati"', 'terminal = "lqr"', "control.terminal: expected riccati or none"),
    ("radius_mm = 30\n", "radius_mm = -1\n", "control.keep_out[1].radius_mm: expected a finite"),
    ("offset_mm = 20", "offset_mm = 20\nwide = 1", "control.keep_out[2].wide: expected one of"),
    ("weight = 100", "wieght = 100", "did you mean weight?"),
    ('[["x"]]', '["x"]', "control.channels: expected a list of lists of names"),
    ("values_kpa = [2, 2, 4]", "values_kpa = [2, 2]", "control.reference.times: expected 3 rows"),
]


@pytest.mark.parametrize(("before", "after", "text"), WRONG, ids=[t[:30] for *_, t in WRONG])
def test_wrong_tables_are_refused_by_name(before, after, text):
    assert before in TEXT
    with pytest.raises(SceneError) as error:
        parse_scene(TEXT.replace(before, after).encode())
    assert text.split("times")[0] in str(error.value)


def test_a_scene_without_the_table_is_no_control_experiment():
    with pytest.raises(ControlError, match=re.escape("expected a scene with [control]")):
        experiment(dtc.load_scene("seed_four_disc"))


def test_bend_and_coordinates_are_those_of_the_pose():
    """In space the bend is read off the rotation matrix; in the plane it is the sum of angles."""
    rng = np.random.default_rng(3)
    for chart, many in (("planar", 6), ("cardan", 15)):
        model = dtc.load_scene("seed_four_disc").build(chart=chart)
        sensors = (
            Bend(name="bend", disc=4, noise=0.1),
            Coordinates(name="own", noise=1, numbers=(2, many)),
        )
        discrete = model.discrete(0.01, method="euler", sensors=sensors)
        x = np.concatenate([rng.uniform(-0.3, 0.3, many), np.zeros(many)])
        read = {
            k: np.array(v.output(x, [0.0], discrete.theta0)) for k, v in discrete.sensors.items()
        }
        z = np.array(model.poses(x[:many], model.theta0)[0])[:, 11]
        expected = [np.arctan2(-z[1], z[2]), np.arctan2(z[0], z[2])]
        assert np.allclose(read["bend"].ravel(), expected, atol=1e-14)
        assert np.array_equal(read["own"].ravel(), [x[1], x[many - 1]])
        if chart == "planar":
            assert np.isclose(read["bend"][0, 0], np.sum(x[:many]), atol=1e-14)
    with pytest.raises(ModelError, match="numbers: expected an integer from 1 to 15, got 16"):
        model.discrete(
            0.01, method="euler", sensors=(Coordinates(name="own", noise=1, numbers=(16,)),)
        )
