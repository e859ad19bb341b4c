"""One-step methods of this package by name, and their steps as CasADi Functions."""

import casadi as ca

from .. import functions
from ..constraints.system import projection
from ..contact.stepping import Moreau, for_contact, rims_of
from ..graphs import Graphs
from ..jacobians import implicit_form
from ..model import Model
from .collocation import MIDPOINT, RADAU3, RADAU5, SDIRK2
from .explicit import Explicit
from .rosenbrock import RODAS4, ROS1, ROS2, ROS3, Rosenbrock
from .step import At, OneStep, Plant, taken
from .symplectic import GAUSS2, GAUSS4
from .tableau import DOPRI5, EULER, HEUN, RK4, TSIT5

_ALL: tuple[OneStep, ...] = (
    *(Explicit(tableau) for tableau in (EULER, HEUN, RK4, DOPRI5, TSIT5)),
    *(ROS1, ROS2, ROS3, RODAS4),
    *(SDIRK2, MIDPOINT, RADAU3, RADAU5),
    *(GAUSS2, GAUSS4),
    Moreau(),
)
ONE_STEP = {method.name: method for method in _ALL}


def linearly_implicit(name: str) -> bool:
    """Whether a method is of Rosenbrock's kind.

    The derivative of its step without second ones is as stable as the step, and far cheaper.
    """
    return isinstance(ONE_STEP.get(name), Rosenbrock)


def plant_of(g: Graphs) -> Plant:
    """A model's graphs in the forms steps are built from."""
    return Plant(
        ode=functions.ode(g),
        form=implicit_form(g),
        momenta=functions.momenta(g),
        force=functions.canonical_force(g),
        rates=functions.canonical_rates(g),
        projection=projection(g) if g.robot.constraints else None,
        rims=rims_of(g),
        native=g.native,
        kind=ca.SX if g.inlined else ca.MX,
    )


def plant_in(model: Model, *, native: bool) -> Plant:
    """The plant of a model's graphs, with C kernels or without, built once for all methods."""
    native_graphs, plain = model.graphs
    g = native_graphs if native else plain
    return model.once(("plant", native), lambda: plant_of(g))


def step_in(model: Model, name: str, *, native: bool) -> ca.Function:
    """The step of a method in a model's graphs, likewise."""
    plant = plant_in(model, native=native)
    return model.once(("step", name, native), lambda: step_function(ONE_STEP[name], plant))


def suited(method: OneStep, plant: Plant) -> Plant:
    """The plant in the form that the method's steps take."""
    contact = isinstance(method, Moreau) and plant.rims is not None
    return for_contact(plant) if contact else plant


def symbols(plant: Plant) -> At:
    """Fresh symbols of a step's ports."""
    sym = plant.kind.sym
    sizes = [plant.ode.size1_in(i) for i in range(3)]
    return At(
        sym("x", sizes[0]),
        sym("u", sizes[1]),
        sym("du", sizes[1]),
        sym("h"),
        sym("theta", sizes[2]),
    )


def step_function(method: OneStep, plant: Plant) -> ca.Function:
    """The step with free size: x, u, du, h, theta -> x_next, error, slack."""
    plant = suited(method, plant)
    at = symbols(plant)
    step = taken(method, plant, at)
    ports = ["x_next", "error", "slack"]
    outputs = [ca.densify(getattr(step, port)) for port in ports]
    name = f"step_{method.name}"
    return ca.Function(name, list(at), outputs, list(At._fields), ports, {"cse": True})
