r"""Scenes: a robot, how to model it, where it starts, its pressure and how long to run, as TOML.

Format, schema 1
----------------
Numbers are in SI units; a suffix of the key names another unit (never both of `radius` and
`radius_mm`): _mm _cm, _g, _deg, _ms, _mm2 _cm2, _g_mm2 _kg_mm2, _kpa _bar, _kpa_per_s _bar_per_s,
_per_kpa _per_bar, _deg_per_s, _mm_per_s _cm_per_s, _n_per_mm, _n_s_per_mm, _n_mm_s, _mn _kn, _n_mm,
_per_mm2, _ml _l, _l_per_s_bar. Keys marked * may be left out. `n` is the number of discs, disc 1
the fixed root; vectors are x, y, z in the frame of the disc they belong to.

    schema = 1
    name *, title *             default: the file's name

    [robot]
    up * = [0, 1, 0]            direction against gravity in the root's frame
    gravity * = 9.81            [m/s^2]

    [[robot.discs]]             in order; count * = 3 repeats a disc
    shape = "hoop"|"solid"      mass, radius; joined at the rim, centre at radius * y
    shape = "polygon"           mass, vertices = [[x, y], ...] of a uniform plate
    shape = "custom"            mass, inertia (3 x 3, about the centre of mass), centre_of_mass *,
                                area *, centroid * (of the pressure), outline * = [[x, y, z], ...]

    [[robot.threads]]           n - 1, in order; count * as above
    length, exit_point *
    bend *, twist *             rest rotations Rx(a) Ry(b) Rz(c) from the angles [a, b, c]

    [[robot.springs]] *
    discs = [first, last] | "all"   the same springs between every two neighbours of them
    at_deg = [90, 180, 270]     a spring at each of these angles, on both rims; or
    start_at_deg, end_at_deg    lists of the angles on disc i and disc i + 1 (diagonal springs); or
    start, end                  two points
    radius *                    of the circle the angles run along; default: the disc's
    stiffness [N/m], rest_length * (default: no force at rest), damping * [N s/m]

    [[robot.chambers]] *        one entry of the pressure for each
    discs = [first, last] | "all"
    areas *, centroids *        on each disc from first to last; default: the discs' own
    radial_compliance *         relative growth of its section's lengths [1/Pa]
    rated_pressure *            above which a simulation warns [Pa]

    [robot.damping] *           c_a *, c_b *, c_w *, c_r * [N m s/rad] of every segment, or
    [[robot.damping]]           n - 1 tables, count * as above

    [robot.tube] or [robot.rod] in place of the parts above: cut into any number n_discs
    length, radius, wall_thickness, youngs_modulus (also _mpa), poissons_ratio, density, fabric *,
    chambers *, strip_turns *, posts *, and of each chamber rated_pressure *, radial_compliance *
    length, bending_stiffness, twisting_stiffness [N m^2], shear_stiffness [N], mass_per_length,
    radius *, [[robot.rod.cells]] * with area, centroid = [x, y], rated_pressure *
    payload *, bend *, twist *, retardation_time *       of both: `Robot.from_tube`, `from_rod`

    [[robot.forces]] *          kind = one of these; see `dtcasadi.forces` for each
    "point_load"                disc, magnitude [N], direction in the root's frame, point *
    "follower_load"             disc, magnitude [N], direction in the disc's frame, point *
    "couple"                    disc, magnitude [N m], direction, follower * = false
    "payload"                   disc, mass, point *, inertia * (3 x 3, about its centre)
    "drag"                      disc, linear * [N s/m], quadratic * [N s^2/m^2], angular *, point *
                                flow * [m/s]; the first three one number or [x, y, z]
    "wall_spring"               discs, at_deg ... radius * as for springs, stiffness, rest_length *,
                                stiffening * [1/m^2], smoothing *
    "fabric_bunching"           the same with gap for rest_length
    disc = 4 | "all"            "all": such a force on every disc from 2 on; point: default the
                                centre of mass

    [[robot.constraints]] *     what holds or guides discs: `dtcasadi.scene_constraints`
    [robot.plates] *, [[obstacle]] *    what discs may touch: `dtcasadi.scene_obstacles`

    [model] *                   options of `dtcasadi.build`
    chart * = "cardan"          or a list of n - 1
    velocity_terms *, damping *, inflation *        "last_disc" or "volume"
    actuator * = "direct" | "regulator", or

    [model.actuator] *          see `dtcasadi.actuators`; a number for all chambers or a list
    kind = "direct"
    kind = "regulator"          time_constant *, minimum *, maximum * [Pa], rate_limit * [Pa/s],
                                vent_time_constant *, vent_rate_limit *, blend *
    kind = "gas"                supply_pressure, exhaust_pressure *, atmosphere * [Pa], exponent *,
                                dead_volume * [m^3], and these tables:
    [model.actuator.supply]     conductance [m^3/(s Pa)], critical_ratio *, or
                                diameter, discharge_coefficient *
    [model.actuator.exhaust]    the same; [model.actuator.leak] * too
    [model.actuator.valve] *    command = "opening", overlap *; or
                                command = "pressure", band [Pa], underlap *; response_time *
    [model.actuator.hysteresis] *   of any kind: amplitude [Pa], travel *, sharpness *,
                                creep_time *, break_in * [Pa], break_in_travel *
    [model.actuator.delay] *    of any kind: time, lags * (0: exact in a simulation)

    [initial] *                 default: all zero
    chart *                     of the pose given here; default: the model's
    q *, qd *                   lists, or
    beta = [0.1, 0.01, 0.01]    coordinates by their names in the chart, a number for each segment
    pressure *                  that the chambers hold; default: the command at t = 0, or zero with
                                valves commanded by their opening

    [pressure] *                default: zero; [opening] for such valves, -1 (exhaust) to 1 (supply)
    value                       a number for each chamber; or
    times, values, kind * = "step" | "linear"      values: a list of numbers, or of such lists

    [run]
    t_end, rtol * = 1e-6, atol * = 1e-8, method * = "auto", step * [s]
    steps * = "adaptive" | "fixed"      fixed: of `step` throughout, without error control

    [measure] *                 what `dtcasadi bench stability` asks of a method (`Measure`)
    text                        the measure in a line for people
    smallest_step * = 1e-4 [s], bound_of * (a shipped scene)

    [[sensors]] *, [estimation] *, [control] *      `dtcasadi.scene_sensors`, `.scene_control`

Where a list with a number for each segment or chamber is asked for, one number stands for all. The
angle of a rim point runs from the thread counterclockwise as seen from +z (`presets.rim`).

An error names a part by its number: `robot.discs[4].mass` is disc 4, whichever table it comes from.
"""

import difflib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import checks
from .actuation import settled
from .charts import charts_of, convert
from .control import Control
from .errors import SceneError
from .estimation import Estimation
from .measure import Measure
from .profile import Profile
from .rediscretise import rediscretised
from .robot import Robot
from .rod import Rod
from .sampled import Sensors
from .scene_file import bytes_of, is_name, read_scene
from .scene_settings import DEFAULT_CHART
from .scene_tables import printable
from .tube import Tube

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from .model import Model


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything one simulation needs.

    Attributes:
        name: lower-case words joined by underscores.
        robot: the robot.
        q0: initial coordinates in `initial_chart`, shape (n_q,) [rad].
        qd0: their rates, shape (n_q,) [rad/s].
        pressure: command against time, one entry for each chamber: a pressure [Pa], or the opening
            of its valve.
        t_end: duration [s].
        title: one line for people; default: the name.
        options: keyword arguments of `dtcasadi.build`.
        initial_chart: chart of q0, or one for each segment; default: the options'.
        initial_pressure: that the chambers hold at the start, shape (n_u,) [Pa]; default: the
            command at t = 0 where it is a pressure, else zero.
        rtol: relative tolerance of the integration.
        atol: absolute tolerance of the integration.
        method: integration method.
        step_s: step of a fixed-step method, first one of the others [s]; default: the method's
            choice.
        fixed: take steps of step_s throughout, with a method that has error control too.
        measure: what the stability map asks of a method.
        beam: the tube or the rod that the robot was cut from; None: its discs were given.
        sensors: what is measured, values of `dtcasadi.sensors`.
        estimation: what a filter knows, and the truth it is to find.
        control: what a controller is to do.

    Raises:
        SceneError: naming the field, what was expected and what was given.
        ChartError: an unknown chart, or charts for another number of segments.
    """

    name: str
    robot: Robot
    q0: np.ndarray
    qd0: np.ndarray
    pressure: Profile
    t_end: float
    title: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    initial_chart: str | Sequence[str] | None = None
    initial_pressure: np.ndarray | None = None
    rtol: float = 1e-6
    atol: float = 1e-8
    method: str = "auto"
    step_s: float | None = None
    fixed: bool = False
    measure: Measure = Measure()
    beam: Tube | Rod | None = None
    sensors: Sensors = ()
    estimation: Estimation | None = None
    control: Control | None = None

    def __repr__(self) -> str:
        """Name and title on one line."""
        return f"Scene({self.name}: {self.title})"

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.name, str) or not is_name(self.name):
            raise _error("name", "lower-case words joined by _", checks.shown(self.name))
        kinds = (("robot", Robot), ("pressure", Profile), ("options", dict), ("measure", Measure))
        for key, kind in kinds:
            if not isinstance(getattr(self, key), kind):
                raise _error(key, f"a {kind.__name__}", checks.shown(getattr(self, key)))
        n_u = len(self.robot.chambers)
        if self.pressure.n_u != n_u:
            raise _error("pressure", f"{n_u} commands, one for each chamber", self.pressure.n_u)
        chart = self.options.get("chart", DEFAULT_CHART)
        chart = chart if self.initial_chart is None else self.initial_chart
        charts = charts_of(chart, self.robot.n_discs - 1)
        n_q = sum(chart.words.n_q for chart in charts)
        values: dict[str, Any] = {
            "title": self.title or self.name,
            "options": dict(self.options),
            "initial_chart": tuple(chart.name for chart in charts),
            "q0": checks.array("q0", self.q0, (n_q,), error=_error),
            "qd0": checks.array("qd0", self.qd0, (n_q,), error=_error),
        }
        for key in ("t_end", "rtol", "atol"):
            values[key] = checks.number(key, getattr(self, key), positive=True, error=_error)
        if self.step_s is not None:
            values["step_s"] = checks.number("step_s", self.step_s, positive=True, error=_error)
        if self.initial_pressure is not None:
            given = checks.array("initial_pressure", self.initial_pressure, (n_u,), error=_error)
            values["initial_pressure"] = given
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def build(self, **overrides: Any) -> "Model":
        """The scene's model: `dtcasadi.build` with the scene's options, some of them replaced."""
        from .model import build

        return build(self.robot, **{**self.options, **overrides})

    def rediscretised(self, n_discs: int) -> "Scene":
        """The scene with its tube or rod cut into another number of discs.

        Chambers, forces on single discs, sensors and the initial pose stay where they are along the
        beam; coordinates and rates per length are interpolated.

        Raises:
            SceneError: the robot was given disc by disc, has forces between discs, or another
                chart for each segment.
            RobotError: the beam cannot be cut into so many discs.
        """
        return rediscretised(self, n_discs)

    def x0(self, model: "Model") -> np.ndarray:
        """Initial state x = [q; qd; actuator states] of a model of the scene's robot, shape (n_x,).

        The pose is converted where the model's chart is another one than the scene's.

        Raises:
            ChartError: the model's chart cannot represent the pose or its rates.
        """
        q, qd = self.q0, self.qd0
        charts = tuple(chart.name for chart in model.charts)
        if charts != self.initial_chart:
            q, qd = convert(self.robot, q, qd, self.initial_chart or charts, charts)
        held = self.initial_pressure
        if held is None:
            follows = model.actuator.command == "pressure"
            held = self.pressure(0.0) if follows else np.zeros(model.n_u)
        return np.concatenate([q, qd, settled(model, q, held)])


def scene_names() -> tuple[str, ...]:
    """Names of the scenes that come with the package, sorted, those of folders as `folder/name`."""
    return tuple(sorted(_names_in(resources.files(__package__).joinpath("scenes"), "")))


def _names_in(folder: "Traversable", prefix: str) -> Iterator[str]:
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _names_in(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".toml"):
            yield prefix + entry.name.removesuffix(".toml")


def load_scene(path_or_name: str | os.PathLike[str]) -> Scene:
    """A scene from a TOML file, or one that comes with the package.

    Args:
        path_or_name: a path, or a name of `scene_names()`. A string of lower-case words joined by
            underscores is always a name: write `./scene` for a file called `scene`.

    Raises:
        SceneError: the file cannot be read or is wrong; a line for each error,
            `file: table.key: expected ..., got ...`.
    """
    if isinstance(path_or_name, str) and (is_name(path_or_name) or path_or_name in scene_names()):
        return _shipped(path_or_name)
    path = os.fspath(path_or_name) if isinstance(path_or_name, str | os.PathLike) else None
    if not isinstance(path, str):
        expected = "a path to a scene file or the name of a scene"
        raise SceneError([f"scene: expected {expected}, got {checks.shown(path_or_name)}"])
    source = printable(path) or "''"
    data = bytes_of(path, source)
    words = "".join(c if c.isascii() and c.isalnum() else " " for c in Path(path).stem)
    name = "_".join(words.lower().split())
    return parse_scene(data, source, name if is_name(name) else "scene")


def parse_scene(data: bytes, source: str = "scene", name: str = "scene") -> Scene:
    """A scene from the bytes of a TOML file.

    Args:
        data: the file's content.
        source: what errors call the file.
        name: the scene's name where the file gives none.

    Raises:
        SceneError: a line for each error.
    """
    return Scene(**read_scene(data, source, name))


def _shipped(name: str) -> Scene:
    known = scene_names()
    if name not in known:
        near = difflib.get_close_matches(name, known, 1)
        hint = f" (did you mean {near[0]}?)" if near else ""
        names = ", ".join(other for other in known if "/" not in other)
        expected = f"a path such as ./{name}.toml, or one of {names}{hint}"
        raise SceneError([f"scene: expected {expected}, got {name!r}"])
    file = resources.files(__package__).joinpath("scenes", *f"{name}.toml".split("/"))
    return parse_scene(file.read_bytes(), f"{name}.toml", name.rpartition("/")[2])


def _error(name: str, expected: str, got: object) -> SceneError:
    return SceneError([f"scene.{name}: expected {expected}, got {got}"])
