"""Steps with rigid contact as exported C."""

import casadi as ca
import numpy as np
from c_compilers import needs_compiler
from exported import built

import dtcasadi as dtc
from dtcasadi.codegen.describe import described


@needs_compiler
def test_the_exported_step_with_rigid_contact_is_that_of_python(tmp_path):
    """A drop onto a floor, step by step from the same states: round-off only."""
    floor = dtc.Obstacle(
        dtc.HalfSpace((0, -0.6, 0), (0.1, 1, 0)), friction=0.4, restitution=0.5, rim_points=4
    )
    hoop = dtc.Disc.hoop(1.0, 0.3)
    robot = dtc.Robot((hoop,) * 2, (dtc.Thread(0.8),), obstacles=(floor,))
    model = dtc.build(robot, chart="planar")
    discrete = model.discrete(5e-3, method="moreau")
    export = described(model, name="robot", functions=("step",), method="moreau", step_s=5e-3)
    functions = {each.name: each for each in export.functions}
    exported = dtc.export_c(functions, tmp_path / "c", name="robot")
    library = str(built(exported, ["-O2"], tmp_path))
    twin = ca.external("robot_raw_step", ca.Importer(library, "dll"))
    x = np.zeros(model.n_x)
    u = np.zeros(discrete.step.size1_in(1))
    touched = 0
    for _ in range(200):
        arguments = (x, u, discrete.theta0)
        expected, got = (np.array(f(*arguments)[0]).ravel() for f in (discrete.step, twin))
        assert np.abs(got - expected).max() <= 1e-12 * max(1.0, np.abs(expected).max())
        touched += bool(np.abs(expected[model.n_q :] - x[model.n_q :]).max() > 0.2)
        x = expected
    assert touched  # gravity alone changes a rate by less than that in a step
