"""Sweeps and Monte Carlo: many runs of a scene, on lanes, processes or a cluster."""

from .axes import Draw, Given, normal, uniform
from .front import Sweep, sweep
from .probe import QUANTITIES

__all__ = ["QUANTITIES", "Draw", "Given", "Sweep", "normal", "sweep", "uniform"]
