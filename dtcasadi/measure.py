"""What the stability map asks of a method on a scene."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Measure:
    """Beside the horizon, which is the scene's own duration.

    The motion has to reach it with its energy within twice that of the reference
    (`dtcasadi.bench.stability`).

    Attributes:
        text: the measure in a line for people.
        smallest_step_s: a method that needs smaller steps has failed [s]; a tenth of a millisecond
            is a tenth of a controller's period.
        bound_of: shipped scene whose reference gives the bound on energy where this one's ends
            before the horizon.
    """

    text: str = "reaches the horizon with its energy within twice that of the reference"
    smallest_step_s: float = 1e-4
    bound_of: str = ""
