"""What a sweep goes over: values on a grid, and values drawn at random."""

import math
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .. import checks
from ..errors import SweepError

MOST_RUNS = 10**8
_CALL = re.compile(r"([a-z_]+)\((.*)\)")
_FORMS = "lin(a,b,n), log(a,b,n), normal(mean,sd,n), uniform(a,b,n) or numbers v1,v2,..."


@dataclass(frozen=True)
class Draw:
    """Numbers drawn at random; all draws of a sweep are made together, sample by sample.

    Attributes:
        kind: `normal` (mean a, standard deviation b) or `uniform` (from a to b).
        a: see `kind`.
        b: see `kind`.
        n: how many.

    Raises:
        SweepError: naming the field.
    """

    kind: str
    a: float
    b: float
    n: int

    def __post_init__(self) -> None:
        """Check every field."""
        if self.kind not in ("normal", "uniform"):
            raise _error("kind", "normal or uniform", checks.shown(self.kind))
        for name in ("a", "b"):
            checks.number(name, getattr(self, name), error=_error)
        checks.index("n", self.n, 1, MOST_RUNS, error=_error)
        if self.kind == "normal" and self.b < 0:
            raise _error("sd", "a non-negative number", self.b)

    def values(self, rng: np.random.Generator) -> np.ndarray:
        """The numbers, shape (n,)."""
        if self.kind == "normal":
            return rng.normal(self.a, self.b, self.n)
        return rng.uniform(self.a, self.b, self.n)


def normal(mean: float, sd: float, n: int) -> Draw:
    """Some draws from a normal distribution."""
    return Draw("normal", mean, sd, n)


def uniform(low: float, high: float, n: int) -> Draw:
    """Some draws from a uniform distribution."""
    return Draw("uniform", low, high, n)


@dataclass(frozen=True, eq=False)
class Given:
    """Samples made elsewhere (a design of experiments), used like draws: row by row."""

    samples: np.ndarray

    def __post_init__(self) -> None:
        """Check the samples."""
        checked = checks.array("samples", self.samples, (None,), error=_error)
        object.__setattr__(self, "samples", checked)

    @property
    def n(self) -> int:
        """How many."""
        return len(self.samples)

    def values(self, rng: np.random.Generator) -> np.ndarray:
        """The samples; nothing is drawn."""
        return self.samples


Axis = Draw | Given | str | Sequence[float] | np.ndarray


def table(over: Mapping[str, Axis], seed: int = 0) -> tuple[tuple[str, ...], np.ndarray]:
    """Every run's inputs.

    Fixed values make a grid, the last axis fastest. Draws are made together, n for each point of
    the grid, the same at every point (common random numbers); each path has a random stream of its
    own, so that another axis does not change them.

    Args:
        over: path -> values, text such as `lin(0,1,5)`, or draws.
        seed: of the draws.

    Returns:
        The paths, and inputs, shape (runs, paths).

    Raises:
        SweepError: no axis, values that are not finite numbers, draws of different lengths.
    """
    if not isinstance(over, Mapping) or not over:
        raise _error("over", "at least one path with values", checks.shown(over))
    seed = checks.index("seed", seed, 0, 2**63 - 1, error=_error)
    axes = {path: _axis(path, spec) for path, spec in over.items()}
    random = {path: axis for path, axis in axes.items() if not isinstance(axis, np.ndarray)}
    counts = {path: axis.n for path, axis in random.items()}
    if len(set(counts.values())) > 1:
        raise _error("over", "as many draws for each path, as they are made together", counts)
    n_draws = next(iter(counts.values()), 1)
    grid = {path: axis for path, axis in axes.items() if isinstance(axis, np.ndarray)}
    total = math.prod(len(values) for values in grid.values()) * n_draws
    if total > MOST_RUNS:
        raise _error("over", f"at most {MOST_RUNS} runs", total)
    columns = {}
    points = total // n_draws
    inner = points
    for path, values in grid.items():
        inner //= len(values)
        outer = points // (inner * len(values))
        columns[path] = np.repeat(np.tile(np.repeat(values, inner), outer), n_draws)
    for path, axis in random.items():
        rng = np.random.default_rng([seed, zlib.crc32(path.encode())])
        columns[path] = np.tile(axis.values(rng), points)
    return tuple(axes), np.column_stack([columns[path] for path in axes])


def _axis(path: str, spec: Axis) -> np.ndarray | Draw | Given:
    if isinstance(spec, Draw | Given):
        return spec
    if isinstance(spec, str):
        return parsed(path, spec)
    values = checks.array(f"over {path}", spec, (None,), error=_error)
    if not len(values):
        raise _error(f"over {path}", "at least one value", "none")
    return values


def parsed(path: str, text: str) -> np.ndarray | Draw:
    """Values from text.

    Raises:
        SweepError: it is none of the forms.
    """
    field = f"over {path}"
    match = _CALL.fullmatch("".join(text.split()))
    if not match:
        return _axis(path, [_number(field, word, text) for word in text.split(",")])  # type: ignore[return-value]
    name, words = match[1], match[2].split(",")
    if name not in ("lin", "log", "normal", "uniform") or len(words) != 3:
        raise _error(field, _FORMS, checks.shown(text))
    a, b = (_number(field, word, text) for word in words[:2])
    if not words[2].isascii() or not words[2].isdigit() or not 0 < int(words[2]) <= MOST_RUNS:
        raise _error(field, f"a number of values in {name}(a,b,n)", checks.shown(words[2]))
    n = int(words[2])
    if name in ("normal", "uniform"):
        return Draw(name, a, b, n)
    if name == "lin":
        return np.linspace(a, b, n)
    if a * b <= 0:
        raise _error(field, "two numbers of the same sign in log(a,b,n)", checks.shown(text))
    return np.copysign(np.geomspace(abs(a), abs(b), n), a)


def _number(field: str, word: str, text: str) -> float:
    try:
        return checks.number(field, float(word), error=_error)
    except ValueError:
        raise _error(field, _FORMS, checks.shown(text)) from None


def _error(field: str, expected: str, got: object) -> SweepError:
    return SweepError(f"{field}: expected {expected}, got {got}")
