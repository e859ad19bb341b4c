"""Contact: obstacles as values, and how the discs' rims push against them."""

from .obstacle import Obstacle
from .plates import Plates
from .record import Contacts
from .shapes import Box, Capsule, HalfSpace, Sphere

__all__ = ["Box", "Capsule", "Contacts", "HalfSpace", "Obstacle", "Plates", "Sphere"]
