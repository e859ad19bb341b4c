"""How every picture looks, and how it is written: no global matplotlib state."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from .errors import DtcasadiError
from .files import written

# Okabe and Ito's colours, which people with any colour vision tell apart.
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, BLACK, GREY = "#E69F00", "#56B4E9", "#222222", "#777777"
LINES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
# Chambers are areas: lighter than the lines in front of them.
CHAMBERS = (SKY, ORANGE, GREEN, PURPLE, VERMILION)

WIDTH_IN = 9.0  # about 900 pixels at the size a web page shows it
DPI = 160
SUFFIXES = (".png", ".svg", ".pdf")
_RC: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "savefig.dpi": DPI,
    "svg.hashsalt": "dtcasadi",  # the same run gives the same file
}
_P = ParamSpec("_P")
_T = TypeVar("_T")


class PictureError(DtcasadiError, ValueError):
    """A picture or an animation was asked for that cannot be made; the text says what can."""


def styled(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Run a function with this module's settings, whatever the user's own are."""

    @functools.wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(_RC)
            return function(*args, **kwargs)

    return call


def new_figure(width: float, height: float, **options: Any) -> Figure:
    """An empty figure of a size in inches that no pyplot knows of."""
    figure = Figure(figsize=(width, height), **options)
    FigureCanvasAgg(figure)
    return figure


def finished(figure: Figure, path: str | Path | None) -> Figure:
    """The figure, written to a file if a path is given.

    Raises:
        PictureError: the file's suffix is none of `SUFFIXES`.
        OSError: the file cannot be written; an older one is left as it was.
    """
    if path is None:
        return figure
    target = checked_suffix(path, SUFFIXES)
    kind = target.suffix.lower()[1:]
    # A date would make every file a new one.
    stamps: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    with written(target) as file:
        figure.savefig(file, format=kind, metadata=stamps.get(kind))
    return figure


def checked_suffix(path: str | Path, suffixes: Sequence[str]) -> Path:
    """The path, if it ends like one of the suffixes.

    Raises:
        PictureError: it does not.
    """
    target = Path(path)
    if target.suffix.lower() not in suffixes:
        raise PictureError(f"{target}: expected a name ending in {_or(suffixes)}")
    return target


def _or(words: Sequence[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last


def line_colours(n: int) -> list[Any]:
    """Colours for n lines: distinct ones while there are enough, then a sequence."""
    if n <= len(LINES):
        return list(LINES[:n])
    return list(mpl.colormaps["viridis"](np.linspace(0.0, 0.92, n)))


def faded(colour: str, opacity: float) -> tuple[float, float, float, float]:
    """A colour with an opacity."""
    return to_rgba(colour, opacity)


def pressure_unit(largest: float) -> tuple[float, str]:
    """Factor and name of the unit that suits pressures up to the largest absolute one [Pa]."""
    return (1e-3, "kPa") if largest >= 1e4 else (1.0, "Pa")
