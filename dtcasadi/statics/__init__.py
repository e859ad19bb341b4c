"""Statics: where a robot rests, whether it stays there, and how that changes with the loads."""

from .equilibrium import Equilibrium, equilibrium
from .stability import Stability, stability

__all__ = ["Equilibrium", "Stability", "equilibrium", "stability"]
