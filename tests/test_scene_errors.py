"""The error lines of scene files: path, what was expected, what was given."""

import math
import pickle

import pytest
from scene_texts import FULL, PRESSED, SMALL, edited, errors_of, parse

from dtcasadi.errors import SceneError

DISC = 'shape = "hoop"\nmass = 2\nradius = 1'

# A passage of SMALL and what replaces it, then the first error line, indented. Lines that begin
# with + are appended to SMALL, those with ++ to PRESSED, which has two chambers and [pressure].
CASES = r"""
schema = 1 -> # none
    schema: expected 1, got nothing
schema = 1 -> schema = 1.0
    schema: expected 1, got 1.0
schema = 1 -> schema = 2\nrobots = 3
    schema: expected 1, got 2
schema = 1 -> schema = 1\nname = "Two words"
    name: expected lower-case words joined by _, at most 60 characters, got 'Two words'
schema = 1 -> schema = 1\ntitle = "a\tb"
    title: expected one line of text, got 'a\tb'
[run] -> [rum]
    run: expected a table, got nothing

mass = 2 -> mass = -2
    robot.discs[1].mass: expected a finite positive number, got -2
mass = 2 -> mass_g = 0
    robot.discs[1].mass_g: expected a finite positive number, got 0
mass = 2 -> mass = nan
    robot.discs[1].mass: expected a finite positive number, got nan
mass = 2 -> mass = 1e400
    robot.discs[1].mass: expected a finite positive number, got inf
mass = 2 -> mass = true
    robot.discs[1].mass: expected a finite positive number, got True
mass = 2 -> mass = "2"
    robot.discs[1].mass: expected a finite positive number, got '2'
mass = 2 -> mass = 1979-05-27
    robot.discs[1].mass: expected a finite positive number, got datetime.date(1979, 5, 27)
mass = 2 -> # none
    robot.discs[1].mass: expected a finite positive number [kg], got nothing
mass = 2 -> mass = 2\nmass_g = 3
    robot.discs[1].mass: expected only one of mass, mass_g, got mass and mass_g
mass = 2 -> mass = 2\nraduis = 3
    robot.discs[1].raduis: expected one of count, shape, mass, radius (did you mean radius?),
    got an unknown key
mass = 2 -> mass = 2\n"\u001b[2J" = 3
    robot.discs[1].'\x1b[2J': expected one of count, shape, mass, radius, got an unknown key
"hoop" -> "hop"
    robot.discs[1].shape: expected hoop, solid, polygon or custom, got 'hop'
count = 3 -> count = 0
    robot.discs[1].count: expected an integer from 1 to 4096, got 0
count = 3 -> count = 3.0
    robot.discs[1].count: expected an integer from 1 to 4096, got 3.0
count = 3 -> count = 4
    robot.threads: expected 3 for 4 discs, got 2
count = 3 -> count = 1
    robot.discs: expected at least 2 discs, the root included, got 1
shape = "hoop" -> shape = "polygon"\nvertices_mm = [[0, 0], [1, 1], [2, 2]]
    robot.discs[1].radius: expected one of count, shape, mass, vertices, got an unknown key
shape = "hoop" -> shape = "custom"\ninertia = [1, 1, 5]
    robot.discs[1].inertia: expected finite numbers of shape (3, 3), got shape (3,)
[robot] -> [robot]\nup = [0, 0, 0]
    robot.up: expected a direction (3 numbers, not all zero), got [0.0, 0.0, 0.0]
[robot] -> [robot]\nup = 3
    robot.up: expected finite numbers of shape (3), got shape ()
[robot] -> [robot]\ngravity = -1
    robot.gravity: expected a finite non-negative number, got -1
[robot] -> [robot]\nsprings = 3
    robot.springs: expected [[robot.springs]] tables, got 3
[robot] -> [robot]\nchambers = [3]
    robot.chambers: expected [[robot.chambers]] tables, got [3]
[robot] -> [robot]\ndamping = 3
    robot.damping: expected a table, got 3
[robot] -> [robot]\ndamping = {c_a = -1}
    robot.damping.c_a: expected a finite non-negative number, got -1
[robot] -> [robot]\ndamping = [{c_a = 1}]
    robot.damping: expected 2 for 3 discs, got 1
length = 1 -> length = 1\nbend_deg = [1, true, 0]
    robot.threads[1].bend_deg: expected finite numbers of shape (3), got [1, True, 0]

+ [[robot.springs]]\ndiscs = [1, 2]\nstiffness = 1
    robot.springs[1].at: expected at, or start_at with end_at, or start with end, got nothing
+ [[robot.springs]]\ndiscs = [1, 2]\nstiffness = 1\nat = [1]\nend = [1, 2, 3]
    robot.springs[1].at: expected at, or start_at with end_at, or start with end,
    got at and start
+ [[robot.springs]]\ndiscs = [1, 2]\nstiffness = 1\nstart_at = [1]\nend_at = [1, 2]
    robot.springs[1].end_at: expected 1 angles, as in start_at, got 2
+ [[robot.springs]]\ndiscs = [1, 2]\nstiffness = 1\nat = [1]\nrest_length = -1
    robot.springs[1].rest_length: expected a finite non-negative number, got -1
+ [[robot.springs]]\ndiscs = [3, 1]\nstiffness = 1\nat = [1]
    robot.springs[1].discs: expected the first and a later disc, got [3, 1]
+ [[robot.springs]]\ndiscs = [3, 4]\nstiffness = 1\nat = [1]
    robot.springs[1].discs: expected disc numbers from 1 to 3, got [3, 4]
+ [[robot.springs]]\ndiscs = "any"\nstiffness = 1\nat = [1]
    robot.springs[1].discs: expected "all" or the first and the last disc number, got 'any'
+ [[robot.chambers]]\ndiscs = [2, 2]
    robot.chambers[1].discs: expected first < last, got (2, 2)
+ [[robot.chambers]]\ndiscs = [1, true]
    robot.chambers[1].discs: expected "all" or the first and the last disc number, got [1, True]
+ [[robot.chambers]]\ndiscs = "all"\nareas = [1, 2]
    robot.chambers[1].areas: expected finite numbers of shape (3), got shape (2,)

+ [model]\nchart = 'plane'
    model.chart: expected cardan, paper, planar, hinge, ball or rigid, or a list of them,
    got 'plane'
+ [model]\nchart = ['planar']
    model.chart: expected 1 or 2 names, got 1
+ [model]\nvelocity_terms = 'half'
    model.velocity_terms: expected full, paper or none, got 'half'
+ [model]\nactuator = 'pump'
    model.actuator: expected direct or regulator, got 'pump'
+ [model.actuator]\nkind = 'pump'
    model.actuator.kind: expected direct, regulator or gas, got 'pump'
+ [model.actuator]\nkind = 'regulator'\nmaximum = -1
    model.actuator.maximum: expected a pressure above the minimum of 0 Pa, got -1.0
+ [model.actuator]\nkind = 'direct'\nmaximum = 1
    model.actuator.maximum: expected one of kind, hysteresis, delay, got an unknown key
+ [initial]\nq = [1, 2]
    initial.q: expected finite numbers of shape (10), got shape (2,)
+ [initial]\nq = 0\nthread_x = 1
    initial.q: expected either q or named coordinates, got both
+ [initial]\nbeta = 1
    initial.beta: expected a coordinate of every segment (chart cardan), got another one
+ [initial]\nthread_x = [1, 2, 3]
    initial.thread_x: expected finite numbers of shape (2), got shape (3,)
+ [initial]\npressure = 1
    initial.pressure: expected no pressure for a robot without chambers, got one
+ [pressure]\nvalue = 1
    pressure: expected no pressure for a robot without chambers, got one
+ [sensor]
    sensor: expected one of schema, name, title, robot, model, initial, pressure, opening,
    run, measure, sensors, estimation, control, obstacle (did you mean sensors?), got an unknown key

t_end = 3 -> t_end = 0
    run.t_end: expected a finite positive number, got 0
t_end = 3 -> # none
    run.t_end: expected a finite positive number [s], got nothing
t_end = 3 -> t_end = 3\nrtol = 1
    run.rtol: expected a number below 1, got 1.0
t_end = 3 -> t_end = 3\nmethod = "a b"
    run.method: expected the name of an integration method, got 'a b'

++
    pressure.value: expected finite numbers of shape (2) [Pa], got nothing
++ valeu = 1
    pressure.value: expected finite numbers of shape (2) [Pa], got nothing
++ value = [1]
    pressure.value: expected finite numbers of shape (2), got shape (1,)
++ value = 1\nkind = 'step'
    pressure.kind: expected one of value, times, values, got an unknown key
++ times = [0, 1]
    pressure.values: expected finite numbers of shape (n) [Pa], got nothing
++ times = [0, 1]\nvalues = [1]
    pressure.values: expected 2 rows, one for each time, got 1
++ times = [1, 1]\nvalues = [1, 2]
    pressure.times: expected strictly increasing times, got [1.0, 1.0]
++ times_ms = [0]\nvalues_kpa = [[1]]
    pressure.values_kpa: expected finite numbers of shape (n, 2), got shape (1, 1)
++ times = [0]\nvalues = [1]\nkind = 'spline'
    pressure.kind: expected step or linear, got 'spline'
"""


def cases() -> list[tuple[str, str]]:
    """(change, error line) of each case."""
    found: list[tuple[str, str]] = []
    for line in filter(None, CASES.splitlines()):
        if line.startswith(" "):
            change, so_far = found.pop()
            found.append((change, f"{so_far} {line.strip()}".strip()))
        else:
            found.append((line, ""))
    return found


@pytest.mark.parametrize(("change", "line"), cases())
def test_an_error_names_its_path_what_was_expected_and_what_was_given(change, line):
    change = change.replace(r"\n", "\n")
    if change.startswith("++"):
        text = PRESSED + change[2:]
    elif change.startswith("+"):
        text = SMALL + change[1:]
    else:
        text = edited(SMALL, *change.split(" -> "))
    assert errors_of(text)[0] == line


CORNERS = [[math.cos(k / 200), math.sin(k / 200)] for k in range(1025)]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            edited(SMALL, "mass = 2", "mass = 0x1" + 5000 * "0"),
            "robot.discs[1].mass: expected a finite positive number, "
            "got a value too large to show (int)",
        ),
        (
            edited(SMALL, DISC, DISC + "\n[[robot.discs]]\ncount = 4094\n" + DISC),
            "robot.discs[4].count: expected at most 4096 discs in all, got 4097",
        ),
        (
            edited(SMALL, DISC, f'shape = "polygon"\nmass = 1\nvertices = {CORNERS}'),
            "robot.discs[1].vertices: expected at most 1024 corners, got 1025",
        ),
        (
            SMALL + f'[[robot.springs]]\ndiscs = "all"\nstiffness = 1\nat = {[1] * 10_001}',
            "robot.springs[1].discs: expected at most 20000 springs in all, got 20002",
        ),
        (
            SMALL + 257 * '[[robot.chambers]]\ndiscs = "all"\n',
            "robot.chambers: expected at most 256, got 257",
        ),
    ],
)
def test_sizes_are_limited(text, line):
    assert errors_of(text) == [line]


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        (
            'shape = "polygon"\nmass = 1\nvertices_mm = [[0, 0], [1, 1], [2, 2]]',
            "robot.discs[1].vertices_mm: expected corners that enclose an area, "
            "got [[0.0, 0.0], [0.001, 0.001], [0.002, 0.002]]",
        ),
        (
            'shape = "custom"\nmass = 1\ninertia_kg_mm2 = [[1, 0, 0], [0, 1, 0], [0, 0, 5]]',
            "robot.discs[1].inertia_kg_mm2: expected positive principal moments, each at most the "
            "sum of the other two, got [",
        ),
    ],
)
def test_what_the_robot_refuses_is_named_as_in_the_file(fields, line):
    (error,) = errors_of(edited(SMALL, DISC, fields))
    assert error.startswith(line)


def test_a_rim_needs_a_radius():
    plate = 'shape = "polygon"\nmass = 1\nvertices = [[0, 0], [1, 0], [0, 1]]'
    springs = '[[robot.springs]]\ndiscs = "all"\nstiffness = 1\nat = [1]\n'
    text = edited(SMALL, DISC, plate) + springs
    line = "robot.springs[1].radius: expected a number, as disc 1 is not round, got nothing"
    assert errors_of(text)[0] == line
    assert len(parse(text + "radius = 0.5").robot.springs) == 2


def test_all_errors_of_a_file_are_reported_together_in_its_order():
    text = edited(FULL, "mass_g = 12.5", "mass_g = -12.5")
    text = edited(text, "length = 0.02", "lenght = 0.02")
    text = edited(text, "c_r = 2e-3", "c_r = inf")
    text = edited(text, '"cardan", "paper", "cardan"', '"cardan", "peper", "cardan"')
    text = edited(text, "rtol = 1e-7", "rtol = 0")
    assert [line.split(":")[0] for line in errors_of(text)] == [
        "robot.discs[1].mass_g",
        "robot.threads[3].length",
        "robot.threads[3].lenght",
        "robot.damping[3].c_r",
        "model.chart",
        "run.rtol",
    ]


def test_another_schema_is_the_only_error():
    assert errors_of("schema = 2\nrobots = 3") == ["schema: expected 1, got 2"]


def test_springs_on_a_wrong_disc_are_no_further_errors():
    text = SMALL + '[[robot.springs]]\ndiscs = "all"\nstiffness = 1\nat = [1]\n'
    (line,) = errors_of(edited(text, "radius = 1", "radius = -1"))
    assert line == "robot.discs[1].radius: expected a finite positive number, got -1"


def test_a_wrong_disc_does_not_hide_another():
    text = edited(FULL, "mass = 0.02", "mass = 0")
    text = edited(text, "0, 7000]]", "0, 90000]]")
    paths = [line.split(":")[0] for line in errors_of(text)]
    assert paths == ["robot.discs[3].mass", "robot.discs[4].inertia_g_mm2"]


def test_a_flood_of_errors_is_counted():
    lines = errors_of(SMALL + "\n".join(f"key_{k} = 1" for k in range(80)))
    assert len(lines) == 51 and lines[-1] == "and 30 more errors"
    assert len(errors_of(SMALL + 60 * "[[robot.springs]]\n")) == 51


def test_the_error_survives_the_way_back_from_a_worker_process():
    with pytest.raises(SceneError) as caught:
        parse("schema = 1")
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.errors == caught.value.errors and str(again) == str(caught.value)
