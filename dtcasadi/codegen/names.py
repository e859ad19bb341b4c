"""Names that may become C symbols, files and macros: what is allowed, and that none meets another.

A name is lower-case words joined by single underscores, at most 60 characters, and no word of C,
C++, math.h or CasADi. Symbols are `<export>_<function>`, macros the same in capitals.
"""

import re
from collections.abc import Iterable

from ..checks import shown
from ..errors import ModelError

MAX_LENGTH = 60
_WORDS = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
_PORT = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")
_KEYWORDS = """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t
    char32_t class co_await co_return co_yield compl complex concept const const_cast consteval
    constexpr constinit continue decltype default delete do double dynamic_cast else enum explicit
    export extern false final float for friend goto if imaginary import inline int long main module
    mutable namespace new noexcept not not_eq nullptr operator or or_eq override private protected
    public register reinterpret_cast requires restrict return short signed sizeof static
    static_assert static_cast struct switch template this thread_local throw true try typedef typeid
    typename typeof union unsigned using virtual void volatile wchar_t while xor xor_eq linux unix
"""
_MATH = """
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs
    fdim floor fma fmax fmin fmod fpclassify frexp hypot ilogb isfinite isgreater isgreaterequal
    isinf isless islessequal islessgreater isnan isnormal isunordered j0 j1 jn ldexp lgamma llrint
    llround log log10 log1p log2 logb lrint lround modf nan nearbyint nextafter nexttoward pow
    remainder remquo rint round scalbln scalbn signbit signgam sin sincos sinh sqrt tan tanh tgamma
    trunc y0 y1 yn abs div exit labs memcpy memmove memset null errno infinity
"""
_CASADI = "casadi casadi_int casadi_real jac adj fwd hess grad mem arg res iw w"
# What files and build targets of that name would get in the way of.
_HEADERS = """
    algorithm array assert atomic bit bitset cassert cmath complex ctype deque errno fenv float
    functional inttypes iso646 limits list locale map math memory numeric optional queue random
    ratio set setjmp signal span stack stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib
    stdnoreturn string strings tgmath thread threads time tuple uchar utility valarray variant
    vector version wchar wctype
"""
_TARGETS = "all any aux clean con depend dist example help install nul package prn run test"
_RESERVED = frozenset(f"{_KEYWORDS} {_CASADI}".split())
_FILES = frozenset(f"{_HEADERS} {_TARGETS}".split())
_MATH_NAMES = frozenset(_MATH.split())
# Each name of math.h has twins for float and long double.
_MATH_TWINS = _MATH_NAMES | {name + end for name in _MATH_NAMES for end in "fl"}
# Parameters and types of the generated wrapper.
_PORTS_TAKEN = frozenset("work work_bytes at NULL EOF NAN INFINITY HUGE_VAL I".split())


def checked(name: object, what: str) -> str:
    """The name, if it can be part of a C symbol.

    Args:
        name: a name of lower-case words.
        what: what the error calls it.

    Raises:
        ModelError: another form, too long, or a word that C, math.h or CasADi takes.
    """
    if not isinstance(name, str) or not _WORDS.fullmatch(name) or len(name) > MAX_LENGTH:
        expected = f"lower-case words joined by _, at most {MAX_LENGTH} characters"
        raise ModelError(f"{what}: expected {expected}, got {shown(name)}")
    if name in _RESERVED or name in _MATH_TWINS:
        raise ModelError(f"{what}: expected no word of C, C++, math.h or CasADi, got {name!r}")
    return name


def checked_export(name: object) -> str:
    """The name of an export: as `checked`, and free as a file and a build target.

    Raises:
        ModelError: it is not.
    """
    found = checked(name, "name")
    if found in _FILES:
        expected = "no name of a standard header or a target of make"
        raise ModelError(f"name: expected {expected}, got {found!r}")
    return found


def checked_port(name: str, what: str) -> str:
    """The name of a port, capitals allowed, if it can be a C parameter.

    Raises:
        ModelError: it cannot.
    """
    fits = _PORT.fullmatch(name) and len(name) <= MAX_LENGTH
    if not fits or name in _RESERVED or name in _PORTS_TAKEN:
        expected = "words joined by _ that C has no use for"
        raise ModelError(f"{what}: expected {expected}, got {shown(name)}")
    return name


def macro(text: str) -> str:
    """A text in capitals with everything but letters and digits as single underscores."""
    return "_".join(re.findall(r"[A-Z0-9]+", text.upper()))


def different(symbols: Iterable[str], what: str) -> None:
    """Check that no symbol comes twice.

    Raises:
        ModelError: one does.
    """
    seen: set[str] = set()
    for symbol in symbols:
        if symbol in seen:
            raise ModelError(f"{what}: expected different C names, got {symbol!r} twice")
        seen.add(symbol)
