"""The exception tree: every error a user can cause derives from `DtcasadiError`."""

from collections.abc import Sequence


class DtcasadiError(Exception):
    """Base of all errors raised on purpose; its text is one readable line per fault."""


class RobotError(DtcasadiError, ValueError):
    """A robot field cannot describe a physical body."""

    def __init__(self, field: str, expected: str, got: object):
        self.field, self.expected, self.got = field, expected, got
        super().__init__(f"{field}: expected {expected}, got {got}")

    def __reduce__(self) -> tuple:
        # The default one calls the class with the message alone; worker processes need this.
        return type(self), (self.field, self.expected, self.got)


class ModelError(DtcasadiError, ValueError):
    """An option, a name or an array handed to a model is not usable."""


class ProfileError(ModelError):
    """A command profile's field is not usable."""

    def __init__(self, field: str, expected: str, got: object):
        self.field, self.expected, self.got = field, expected, got
        super().__init__(f"profile.{field}: expected {expected}, got {got}")

    def __reduce__(self) -> tuple:
        # The default one calls the class with the message alone; worker processes need this.
        return type(self), (self.field, self.expected, self.got)


class ActuatorError(ModelError):
    """An actuator's field is not usable; `owner` is the kind of actuator or part of one."""

    def __init__(self, owner: str, field: str, expected: str, got: object):
        self.owner, self.field, self.expected, self.got = owner, field, expected, got
        super().__init__(f"{owner}.{field}: expected {expected}, got {got}")

    def __reduce__(self) -> tuple:
        return type(self), (self.owner, self.field, self.expected, self.got)


class ChartError(DtcasadiError, ValueError):
    """A chart is unknown, or cannot represent the pose or rate asked for."""


class SceneError(DtcasadiError, ValueError):
    """A scene file is wrong; `errors` lists `file: table.key: expected ..., got ...`."""

    def __init__(self, errors: Sequence[str]):
        self.errors = tuple(errors)
        super().__init__("\n".join(self.errors))

    def __reduce__(self) -> tuple:
        return type(self), (self.errors,)


class CompileError(DtcasadiError, RuntimeError):
    """A C compiler failed; the text holds its first error lines and the command."""


class SimulationError(DtcasadiError, ValueError):
    """A simulation was asked for with arguments that cannot be run."""


class ConstraintError(DtcasadiError, ValueError):
    """Constraints that cannot be met together, or a use for which they are not made."""


class StaticsError(DtcasadiError, ValueError):
    """Statics was asked for what cannot be computed, or a result for what it does not have."""


class SweepError(DtcasadiError, ValueError):
    """A sweep was asked for what cannot be run, or its file holds something else."""


class AdviseError(DtcasadiError, ValueError):
    """Advice was asked for on what cannot be measured."""


class EstimationError(DtcasadiError, ValueError):
    """A filter was asked for what it cannot estimate, or given what it cannot use."""


class IdentificationError(DtcasadiError, ValueError):
    """Parameters were asked for that cannot be identified this way, or with unusable settings."""


class LogError(DtcasadiError, ValueError):
    """A recorded log is wrong; the text names file, line and channel."""


class ControlError(DtcasadiError, ValueError):
    """A control problem was posed with terms that do not fit together, or cannot be used."""


class BenchError(DtcasadiError, RuntimeError):
    """A benchmark does not have what it was asked for, or one of its processes died."""
