"""Bilateral constraints: points held or guided, straps and closed loops."""

from .examine import Examination, examine
from .values import Guided, Joined, Pinned, Strap

__all__ = ["Examination", "Guided", "Joined", "Pinned", "Strap", "examine"]
