"""The command line `dtcasadi COMMAND ...`: one file per command, one line for it below.

A command's module has `add_arguments(parser)` and `run(options, report)`, which returns the exit
code (None: 0). It imports what it needs inside `run`, so that `dtcasadi --help` stays quick.
"""

import sys
from collections.abc import Sequence
from importlib import import_module

from ..versions import version_of
from .common import Parser, Report, guarded

COMMANDS = {
    "demo": "simulate the paper's four-disc robot, draw it and say what happened",
    "simulate": "simulate a scene",
    "statics": "find where a robot rests, or follow that under changing loads",
    "codegen": "write the functions of a scene as C or text, for other programs",
    "mpc": "control a robot's pressures in closed loop, with an estimator",
    "estimate": "estimate a robot's state and a contact force from its sensors",
    "advise": "say how much of the model a scene needs",
    "sweep": "run a scene for many values of its numbers",
    "identify": "find a robot's parameters in recorded motions, with confidence intervals",
    "bench": "time the compiled functions on this machine",
    "doctor": "show what this installation has, what is missing, and what to do about it",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        argv: words after `dtcasadi`; default: those of the process.

    Returns:
        0 if all went well, 1 if a simulation failed, 2 for bad input or an unusable file, 130 if
        interrupted.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    parser = Parser(prog="dtcasadi", description="Soft robots made of discs and threads.")
    parser.add_argument(
        "--version", action="version", version=version_of("dtcasadi") or "not installed"
    )
    commands = parser.add_subparsers(metavar="COMMAND", dest="command", required=True)
    for name, line in COMMANDS.items():
        command = commands.add_parser(name, help=line, description=f"{line[0].upper()}{line[1:]}.")
        if name in words[:1]:
            module = import_module(f".{name}", __package__)
            module.add_arguments(command)
            command.add_argument("--json", metavar="F", help="write every figure to this file")
            command.set_defaults(run=module.run)
    try:
        options = parser.parse_args(words)
    except SystemExit as end:  # argparse has said everything
        return int(end.code or 0)
    return guarded(options.run, options, Report(options.command, options.json))


__all__ = ["COMMANDS", "main"]
