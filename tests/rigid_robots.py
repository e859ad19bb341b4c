"""A disc that swings down onto a floor: rigid contact with one point."""

# mypy: disable-error-code="arg-type"
# Lists stand for arrays.

from typing import Any

import dtcasadi as dtc

G, RADIUS = 9.81, 0.1


def swing(restitution: float, **options: Any) -> dtc.Model:
    """A disc on a hinge, its rim point nearest to the thread falling on a floor."""
    disc = dtc.Disc.solid(1.0, RADIUS)
    floor = dtc.Obstacle(
        dtc.HalfSpace((0, -0.3, 0), (0, 1, 0)),
        restitution=restitution,
        rim_points=1,
        **options,
    )
    robot = dtc.Robot((disc, disc), (dtc.Thread(1.0),), obstacles=(floor,))
    return dtc.build(robot, chart="hinge")
