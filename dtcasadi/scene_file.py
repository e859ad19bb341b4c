"""From the bytes of a scene file to the checked fields of a `Scene`."""

import re
import tomllib
from pathlib import Path
from typing import Any

from . import checks
from .errors import SceneError
from .scene_control import read_control
from .scene_obstacles import with_obstacles
from .scene_robot import RobotPart, read_robot
from .scene_sensors import read_estimation, read_sensors
from .scene_settings import read_command, read_initial, read_measure, read_model, read_run
from .scene_tables import LINE, Faults, Table, is_line, printable

SCHEMA = 1
MAX_BYTES = 1_000_000
NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
NAME_LENGTH = 60
_NAME_TEXT = f"lower-case words joined by _, at most {NAME_LENGTH} characters"
# tomllib's time grows with the square of the parts of a dotted key; no scene needs many.
_ENDLESS_KEY = re.compile(
    r"""(?<![\w"'\\-])(?:(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){17}"""
)


def is_name(text: str) -> bool:
    """Whether a text can name a scene."""
    return len(text) <= NAME_LENGTH and NAME.fullmatch(text) is not None


def read_scene(data: bytes, source: str, name: str) -> dict[str, Any]:
    """The fields of the scene in a file's bytes.

    Args:
        data: the file's content.
        source: what the errors call the file.
        name: the scene's name where the file gives none.

    Raises:
        SceneError: all errors of the file, a line for each.
    """
    faults = Faults(source)
    top = Table(faults, "", _toml(data, source))
    _check_schema(top)
    fields: dict[str, Any] = {
        "name": top.text("name", _NAME_TEXT, is_name, default=name),
        "title": top.text("title", LINE, is_line, default=name),
    }
    robot_table = top.table("robot")
    robot = read_robot(robot_table) if robot_table else RobotPart(None, None, None)
    n_segments = None if robot.n_discs is None else robot.n_discs - 1
    options, charts = read_model(_optional(top, "model"), n_segments, robot.n_chambers)
    fields |= read_initial(_optional(top, "initial"), n_segments, charts, robot.n_chambers)
    command = read_command(top, robot.n_chambers, options.get("actuator"))
    run_table = top.table("run")
    fields |= read_run(run_table) if run_table else {}
    fields["measure"] = read_measure(_optional(top, "measure"))
    fields["sensors"] = read_sensors(top, robot.n_discs, robot.n_chambers)
    fields["estimation"] = read_estimation(top.table("estimation", default=None))
    fields["control"] = read_control(top.table("control", default=None), robot.n_chambers)
    placed = with_obstacles(top, robot.robot)
    top.close()
    faults.check()
    fields |= {"robot": placed, "options": options, "pressure": command}
    return fields | {"beam": robot.beam}


def _check_schema(top: Table) -> None:
    """Refuse another schema at once: what its other keys mean is not known."""
    found = top.take("schema", str(SCHEMA))
    if found and (type(found[0]) is not int or found[0] != SCHEMA):
        top.fault("schema", str(SCHEMA), checks.shown(found[0]))
    top.faults.check()


def _optional(top: Table, key: str) -> Table:
    """A table of the file, empty where there is none."""
    return top.table(key, default=None) or Table(top.faults, key, {})


def _toml(data: bytes, source: str) -> dict[str, Any]:
    """The tables of a TOML file."""
    if len(data) > MAX_BYTES:
        raise _unreadable(source, f"a scene file of at most {MAX_BYTES:_} bytes", "more")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        got = f"the byte 0x{data[error.start]:02x} at position {error.start}"
        raise _unreadable(source, "a TOML file in UTF-8", got) from None
    if _ENDLESS_KEY.search(text):
        raise _unreadable(source, "keys of at most 16 parts", "a longer one")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _unreadable(source, "a TOML file", f"an error: {error}") from None
    except RecursionError:
        raise _unreadable(source, "a TOML file", "tables or lists nested too deeply") from None
    except ValueError:  # Python's own limit, which tomllib does not translate
        raise _unreadable(source, "a TOML file", "an integer of thousands of digits") from None


def _unreadable(source: str, expected: str, got: str) -> SceneError:
    return SceneError([printable(f"{source}: expected {expected}, got {got}")])


def bytes_of(path: str, source: str) -> bytes:
    """A file's content, no more than needed to see that it is too large.

    Raises:
        SceneError: the file cannot be read.
    """
    try:
        # A pipe or a device would wait, or never end.
        if Path(path).exists() and not Path(path).is_file():
            reason = "a folder or a device"
        else:
            with open(path, "rb") as file:
                return file.read(MAX_BYTES + 1)
    except OSError as error:
        reason = (error.strerror or "an error").lower()
    except ValueError:  # a zero byte or a lone surrogate
        reason = "a path that no file can have"
    raise SceneError([f"{source}: expected a readable scene file, got {printable(reason)}"])
