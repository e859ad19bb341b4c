"""Forces as an open list: what acts on a robot besides its own springs, damping and chambers.

Each is a frozen value for `Robot(forces=(...))`; `Force` says how to write one's own.
"""

from .drag import Drag
from .loads import Couple, FollowerLoad, PointLoad
from .payload import Payload
from .protocol import Body, DiscState, Force, ThreadState, Wrench
from .walls import FabricBunching, WallSpring

__all__ = [
    "Body",
    "Couple",
    "DiscState",
    "Drag",
    "FabricBunching",
    "FollowerLoad",
    "Force",
    "Payload",
    "PointLoad",
    "ThreadState",
    "WallSpring",
    "Wrench",
]
