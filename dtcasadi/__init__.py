"""Discs and threads: inflatable soft robots as recursive CasADi graphs."""

from .actuators import (
    Actuator,
    Delay,
    Direct,
    Gas,
    Hysteresis,
    Orifice,
    PressureValve,
    Regulator,
    Valve,
)
from .advise import Advice, advise
from .batch import Batch, batch
from .charts import convert
from .codegen import export_c
from .contact import Box, Capsule, HalfSpace, Obstacle, Sphere
from .discrete import DiscreteModel
from .events import Event
from .forces import (
    Couple,
    Drag,
    FabricBunching,
    FollowerLoad,
    Force,
    Payload,
    PointLoad,
    WallSpring,
)
from .identify import Identified, identify
from .model import Model, build
from .profile import Profile
from .ratings import PressureWarning
from .result import Run
from .robot import Chamber, Damping, Disc, Robot, Spring, Thread
from .rod import Cell
from .scene import Scene, load_scene, scene_names
from .simulate import simulate
from .statics import Branch, Equilibrium, branch, equilibrium
from .sweep import Sweep, sweep

__all__ = [
    "Actuator",
    "Advice",
    "Batch",
    "Box",
    "Branch",
    "Capsule",
    "Cell",
    "Chamber",
    "Couple",
    "Damping",
    "Delay",
    "Direct",
    "Disc",
    "DiscreteModel",
    "Drag",
    "Equilibrium",
    "Event",
    "FabricBunching",
    "FollowerLoad",
    "Force",
    "Gas",
    "HalfSpace",
    "Hysteresis",
    "Identified",
    "Model",
    "Obstacle",
    "Orifice",
    "Payload",
    "PointLoad",
    "PressureValve",
    "PressureWarning",
    "Profile",
    "Regulator",
    "Robot",
    "Run",
    "Scene",
    "Sphere",
    "Spring",
    "Sweep",
    "Thread",
    "Valve",
    "WallSpring",
    "advise",
    "batch",
    "branch",
    "build",
    "convert",
    "equilibrium",
    "export_c",
    "identify",
    "load_scene",
    "scene_names",
    "simulate",
    "sweep",
]
