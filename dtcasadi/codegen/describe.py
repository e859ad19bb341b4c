"""From a model, a scene or a mapping of Functions to the `Export` that formats are written from."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ..actuation import settled
from ..builders import FUNCTIONS
from ..checks import shown
from ..errors import ModelError
from ..model import Model
from ..profile import Profile
from ..recentring import recentre_function
from ..scene import Scene
from .description import Export, Exposed, Label, Motion, exposed
from .names import checked_export, different

if TYPE_CHECKING:
    from ..discrete import DiscreteModel

DEFAULT = (
    "forward_dynamics",
    "multipliers",
    "ode",
    "mass_matrix",
    "coriolis",
    "gravity",
    "spring",
    "damping",
    "inflation",
    "forces",
    "contacts",
    "inverse_dynamics",
    "poses",
    "ode_jacobian",
    "step",
    "linearize",
    "recentre",
)
# L-stable and of order 2: no stiffness of the robot limits the step, as firmware needs it.
STEP_S = 0.01
# Newton's last correction stalls at round-off times the condition of the stage equations, about
# 1e-7 times 1e2 in the regular charts; the step's own result is better than that by as much.
SLACK_MAX_SINGLE = 1e-4
_PLAIN_T_END_S = 1.0
_TITLES = {
    "step": "One step of the state, the command held over it: {method}, {step_s:g} s.",
    "linearize": "The same step with its derivatives for state, command and parameters.",
    "recentre": "State and parameters about new centres where an angle has left 45 degrees; call "
    "it after each step. D, cross: 5 x 5 blocks that map a covariance of (q, qd).",
}


def described(
    given: Model | Scene | Mapping[str, ca.Function | Exposed],
    *,
    name: str | None = None,
    functions: Sequence[str] = (),
    method: str | None = None,
    step_s: float | None = None,
    single: bool = False,
    calls: bool = False,
) -> Export:
    """The description of what is to be exported.

    Args:
        given: model, scene or mapping, as in `export_c`.
        name: prefix of every symbol; default: the scene's name.
        functions: names out of the model's Functions, `step`, `linearize` and `recentre`; default:
            `DEFAULT`, without `recentre` where the model never re-centres and without `forces`
            and `contacts` where it has none.
        method: of `step` and `linearize`; default: the scene's where it is a one-step method with
            a fixed step, else the default of `Model.discrete`.
        step_s: their step [s]; default: the scene's, else `STEP_S`.
        single: what is described will run in single precision.
        calls: a model's Functions as calls of per-segment ones, whose structure texts show.

    Raises:
        ModelError: a name that C cannot take or that is used twice, an unknown function or method,
            a step that is not positive, or options that a mapping has no use for.
    """
    scene = given if isinstance(given, Scene) else None
    if scene is not None and name is None:
        name = scene.name
    name = checked_export(name)
    if isinstance(given, Mapping):
        if functions or method is not None or step_s is not None:
            raise ModelError("functions, method, step_s: expected a model or a scene with them")
        chosen = tuple(_of_mapping(key, value) for key, value in given.items())
        return Export(name, _different(chosen), "functions", _graph(chosen))
    model = scene.build() if scene is not None else given
    if not isinstance(model, Model):
        expected = "a Model, a Scene or a mapping of names to casadi Functions"
        raise ModelError(f"functions_or_model: expected {expected}, got {shown(given)}")
    if calls and model.options.assembly != "graph":
        model = Model(model.robot, replace(model.options, assembly="graph"))
    names = tuple(functions) or _default(model)
    # Building the step takes longer than everything else.
    stepped = not {"step", "linearize"}.isdisjoint(names)
    if not stepped and (method is not None or step_s is not None):
        raise ModelError("method, step_s: expected step or linearize among the functions, got none")
    discrete = _discrete(model, scene, method, step_s, single=single) if stepped else None
    return _of_model(model, scene, name, names, discrete)


def _default(model: Model) -> tuple[str, ...]:
    """`DEFAULT` without what this model has no use for."""
    unused = set() if model.recentres else {"recentre"}
    robot = model.robot
    if not (robot.forces or robot.obstacles or model.options.wrenches):
        unused.add("forces")
    if not robot.constraints:
        unused.add("multipliers")
    if not robot.obstacles:
        unused.add("contacts")
    return tuple(name for name in DEFAULT if name not in unused)


def _of_mapping(name: str, value: ca.Function | Exposed) -> Exposed:
    if isinstance(value, Exposed):
        return exposed(name, value.function, value.source, value.title)
    return exposed(name, value)


def _different(functions: tuple[Exposed, ...]) -> tuple[Exposed, ...]:
    if not functions:
        raise ModelError("functions: expected at least one, got none")
    different((each.name for each in functions), "functions")
    return functions


def _discrete(
    model: Model, scene: Scene | None, method: str | None, step_s: float | None, *, single: bool
) -> "DiscreteModel":
    from ..discrete import discretize
    from ..integrators.package import SLACK_MAX
    from ..integrators.steppers import ONE_STEP

    if scene is not None and scene.step_s is not None:
        step_s = scene.step_s if step_s is None else step_s
        if method is None and scene.method in ONE_STEP:
            method = scene.method
    return discretize(
        model,
        STEP_S if step_s is None else step_s,
        method,
        exact=True,
        slack_max=SLACK_MAX_SINGLE if single else SLACK_MAX,
    )


def _of_model(
    model: Model,
    scene: Scene | None,
    name: str,
    functions: Sequence[str],
    discrete: "DiscreteModel | None",
) -> Export:
    chosen = _different(tuple(_of_name(model, discrete, each) for each in functions))
    title = scene.title if scene is not None else f"{model.n_discs} discs"
    return Export(
        name,
        chosen,
        title,
        _graph(chosen),
        labels=_labels(model),
        theta0=model.theta0,
        theta_blocks=model.theta_blocks,
        facts=_facts(model, discrete),
        motion=_motion(model, scene, None if discrete is None else discrete.step_s),
        model=model,
    )


def _of_name(model: Model, discrete: "DiscreteModel | None", name: str) -> Exposed:
    if name in ("step", "linearize") and discrete is not None:
        title = _TITLES[name].format(method=discrete.method, step_s=discrete.step_s)
        return exposed(name, getattr(discrete, name), discrete.native(name), title)
    if name == "recentre":
        return exposed(name, recentre_function(model), None, _TITLES[name])
    if name not in FUNCTIONS:
        names = ", ".join((*FUNCTIONS, *_TITLES))
        raise ModelError(f"functions: expected names of {names}, got {shown(name)}")
    title = getattr(Model, name).__doc__ or ""
    return exposed(name, model.function(name), model.native(name), title)


def _labels(model: Model) -> dict[str, tuple[Label, ...]]:
    """Names and units of the rows of the state, the coordinates and the commands."""
    n = model.n_q
    units = ("rad",) * n + ("rad/s",) * n + model.actuator.state_units(model.n_u)
    state = tuple(Label(*pair) for pair in zip(model.state_names, units, strict=True))
    chambers = tuple(Label(f"pressure_{i + 1}", "Pa") for i in range(model.n_u))
    commands = chambers
    if model.actuator.command != "pressure":
        commands = tuple(Label(f"{model.actuator.command}_{i + 1}", "1") for i in range(model.n_u))
    return {"x": state, "q": state[:n], "u": commands, "pressure": chambers}


def _motion(model: Model, scene: Scene | None, step_s: float | None) -> Motion:
    centre = np.asarray(model.robot.discs[-1].centre_of_mass, dtype=float)
    if scene is not None:
        return Motion(scene.x0(model), scene.pressure, scene.t_end, step_s, centre)
    rest = Profile.constant(np.zeros(model.n_u))
    x0 = np.zeros(model.n_x)
    x0[2 * model.n_q :] = settled(model, x0[: model.n_q], np.zeros(model.n_u))
    return Motion(x0, rest, _PLAIN_T_END_S, step_s, centre)


def _facts(model: Model, discrete: "DiscreteModel | None") -> tuple[str, ...]:
    robot, options = model.robot, model.options
    charts = sorted({chart.name for chart in model.charts})
    masses = [float(disc.mass) for disc in robot.discs]
    facts = (
        f"discs: {model.n_discs}, the first one fixed; masses {_numbers(masses)} kg",
        f"threads: lengths {_numbers([float(t.length) for t in robot.threads])} m",
        f"springs: {len(robot.springs)}; chambers: {len(robot.chambers)}; "
        f"forces: {', '.join(type(force).__name__ for force in robot.forces) or 'none'}",
        f"up: {_numbers(robot.up)}; gravity: {robot.gravity:g} m/s^2",
        f"chart: {'/'.join(charts)}; velocity terms: {options.velocity_terms}; damping: "
        f"{options.damping}; inflation: {options.inflation}",
        f"actuator: {model.actuator!r}",
    )
    if discrete is None:
        return facts
    return (*facts, f"step: method {discrete.method}, {discrete.step_s:g} s")


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _graph(functions: Sequence[Exposed]) -> str:
    """SHA-256 of the functions' graphs."""
    digest = hashlib.sha256()
    for each in functions:
        digest.update(each.function.serialize().encode())
    return digest.hexdigest()
