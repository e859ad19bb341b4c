"""Identification: parameters of a robot from recorded motions, with what the data leave open."""

from .data import Data, Experiment
from .front import identify
from .parameters import Parameter
from .problem import Problem, build
from .result import Identified, Validation
from .settings import Settings
from .solve import solve
from .whiteness import ResidualTests

__all__ = [
    "Data",
    "Experiment",
    "Identified",
    "Parameter",
    "Problem",
    "ResidualTests",
    "Settings",
    "Validation",
    "build",
    "identify",
    "solve",
]
