"""How much of the model a scene needs."""

from .front import Advice, advise, described
from .lab import QUANTITIES
from .planarity import Planarity, planarity

__all__ = ["QUANTITIES", "Advice", "Planarity", "advise", "described", "planarity"]
