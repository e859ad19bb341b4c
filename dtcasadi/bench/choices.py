"""Names given on the command line, against those there are."""

from collections.abc import Sequence

from ..errors import BenchError


def chosen(option: str, given: Sequence[str] | None, known: tuple[str, ...]) -> tuple[str, ...]:
    """The known names among those given, in their own order; all of them where none is given.

    Raises:
        BenchError: a name is not known.
    """
    if given is None:
        return known
    for name in given:
        if name not in known:
            raise BenchError(f"{option}: expected names of {', '.join(known)}, got {name!r}")
    return tuple(name for name in known if name in given)
