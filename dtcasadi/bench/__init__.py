"""Benchmarks of this machine that need no other program: what `dtcasadi bench` runs.

Each module has `add_arguments(parser)` and `run(options, report)`, like a command; a dash in a name
is an underscore in its module's.
"""

BENCHES = {
    "accuracy": "error against beams, chains and pendulums over the number of discs, and its cost",
    "actuators": "time per call with air supply and hysteresis against direct pressure",
    "contact": "time of a step with rigid contact against the same step without it",
    "dynamics": "time per call and operations of the state equation over the number of discs",
    "identify": "time to identify six parameters from 10 s of recorded motion",
    "inflation": "time per call with inflation by volume against the last disc's",
    "stability": "largest stable step of every method on hard scenes, or why it fails",
    "sweep": "runs per second on lanes against a process pool over the single-robot code",
    "statics": "time of an equilibrium from a cold start and of a pressure sweep with stability",
    "work-precision": "pose error of every method against its time and evaluations on a scene",
}

__all__ = ["BENCHES"]
