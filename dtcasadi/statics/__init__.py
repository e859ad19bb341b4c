"""Statics: where a robot rests, whether it stays there, and how that changes with the loads."""

from .branch import Branch, BranchEvent, branch
from .equilibrium import Equilibrium, equilibrium
from .stability import Stability, stability

__all__ = [
    "Branch",
    "BranchEvent",
    "Equilibrium",
    "Stability",
    "branch",
    "equilibrium",
    "stability",
]
