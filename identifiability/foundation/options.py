"""Options of public functions, checked once against the signature of the function.

``@checked`` reads the annotations: choices are a `Literal`, and `Annotated[int, at_least(2)]` is a
range. An error is one sentence that names the valid values. Nothing is converted: the function
receives each argument as it was given. (pydantic's ``validate_call`` copies sequences, rebuilds
dataclasses, refuses NumPy's numbers and reports an error for each member of a union.)
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import cache, wraps
from inspect import Parameter, signature
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
)
from typing import get_type_hints as resolve

from .errors import IdentifiabilityError, near_match, with_article
from .values import Fields, frozen

if TYPE_CHECKING:  # errors at the border load no library
    import numpy as np

P = ParamSpec("P")
R = TypeVar("R")


class OptionError(IdentifiabilityError):
    """An argument has a value that the function does not allow."""


@frozen
class Expected:
    """The range of an annotation in words, and a condition beyond its type."""

    words: str
    holds: Callable[[Any], bool] = lambda value: True


def within(low: float, high: float, what: str = "a number") -> Expected:
    """Return the range of a number."""
    return Expected(f"{what} between {low:g} and {high:g}", lambda value: low <= value <= high)


def counted(low: int, high: int) -> Expected:
    """Return the range of a whole number that has two ends."""
    return within(low, high, "a whole number")


def at_least(least: int) -> Expected:
    """Return the range of a whole number."""
    return Expected(f"a whole number of at least {least}", lambda value: value >= least)


Seed = Annotated[int, at_least(0)]
Count = Annotated[int, at_least(1)]
#: Repetitions of a calibration.
Repeated = Annotated[int, at_least(2)]
Positive = Annotated[float, Expected("a number above 0", lambda value: value > 0)]
NotNegative = Annotated[float, Expected("a number of at least 0", lambda value: value >= 0)]
Share = Annotated[float, within(0, 1)]
#: Refits of a bootstrap; a single one has no spread.
Replicates = Annotated[
    int, Expected("0 (none) or a whole number of at least 2", lambda value: value == 0 or value > 1)
]
Names = Annotated[Sequence[str], Expected("a list of names")]
#: Of effects, which a command line takes as ``a,b``.
Effects = Names

#: Choices of a command line, without the rooms that use them.
Derivatives = Literal["auto", "given", "butterworth", "fourier", "spline"]
EstimatorKind = Literal["auto", "ls", "iv"]
ExportFormat = Literal["mjcf", "urdf", "isaaclab", "patch"]
TimeUnit = Literal["s", "ms", "us", "ns"]
AngleUnit = Literal["rad", "deg"]
Root = Literal["fixed", "floating"]
#: Where torque is measured: at the joint with all that drives it, behind the gear, before it, or
#: on both of its sides.
Side = Literal["joint", "link", "motor", "both"]

#: Samples of a motion at most; the simulator takes one at a time.
MOST_SAMPLES = 10_000_000

#: Of a motion: harmonics, the period [s] and samples.
Harmonics = Annotated[int, counted(1, 50)]
Duration = Annotated[float, within(1e-3, 1e6)]
Period = Annotated[int, counted(20, MOST_SAMPLES)]
FilePath = Annotated[str | Path, Expected("the path of a file")]
Rng = Annotated[
    "np.random.Generator", Expected("a random generator, such as numpy.random.default_rng(0)")
]

#: Arguments of `Robot.load` that are often given to a verb.
OF_LOADING = ("columns", "lock", "base", "time_unit", "angles", "torque_side")

_WORDS = {
    int: "a whole number",
    float: "a number",
    bool: "True or False",
    str: "a text",
    NoneType: "None",
    Path: "a path",
}


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function with its arguments checked against its annotations.

    Raises
    ------
    OptionError
        At a call; the sentence names the argument, the valid values, and the given one.
    """
    shape = signature(function)

    @cache
    def kinds() -> Fields:  # when it is first called: its module is complete then
        return resolve(function, include_extras=True)

    @wraps(function)
    def bordered(*args: P.args, **kwargs: P.kwargs) -> R:
        given = {}
        lost = [name for name in OF_LOADING if name in kwargs and name not in shape.parameters]
        if lost:
            raise TypeError(
                f"{function.__name__} has no argument '{lost[0]}': the robot keeps how logs are "
                f"read. Give Robot.load(…, {lost[0]}=…) as the robot."
            )
        with suppress(TypeError):  # the call itself raises it, and names the function
            given = shape.bind(*args, **kwargs).arguments
        for name, value in given.items():
            if name in kinds():
                several = shape.parameters[name].kind is Parameter.VAR_POSITIONAL
                for item in value if several else (value,):
                    check_option(name, item, kinds()[name])
        return function(*args, **kwargs)

    return bordered


def check_fields(options: Any, what: str = "") -> None:
    """Check the fields of a dataclass against their annotations, in its ``__post_init__``.

    `what` precedes their names in messages, such as ``noise level``.

    Raises
    ------
    OptionError
    """
    kinds = resolve(type(options), include_extras=True)
    for name in (field.name for field in fields(options)):
        check_option(f"{what} {name}".lstrip(), getattr(options, name), kinds[name])


def check_option(name: str, value: Any, kind: Any) -> None:
    """Refuse a value that an annotation does not allow.

    Raises
    ------
    OptionError
    """
    if not allows(kind, value):
        near = near_match(value, choices(kind)) if isinstance(value, str) else "."
        shown = _member(value, kind) or f"{_shown(value)}{near}"
        raise OptionError(f"{name} must be {expected(kind)}, not {shown}")


def _member(value: Any, kind: Any) -> str:
    """Return which members of a list an annotation refuses; empty if it refuses the list."""
    if not isinstance(value, (list, tuple)):
        return ""
    for k, item in enumerate(value, 1):
        others = [x for x in value if x is not item]
        if not allows(kind, [item]) and (allows(kind, others) or len(value) == 1):
            return f"a list whose member {k} is {with_article(type(item).__name__)}."
    return ""


def check_choice(name: str, value: Any, known: Sequence[str]) -> None:
    """Refuse a word that is not one of the known ones.

    Raises
    ------
    OptionError
    """
    check_option(name, value, Literal[tuple(known)])


def allows(kind: Any, value: Any) -> bool:
    """Return whether an annotation allows a value."""
    origin = get_origin(kind)
    inner = get_args(kind)
    if kind is Any or isinstance(kind, TypeVar):
        return True
    if origin is Annotated:
        allowed = allows(inner[0], value)
        return allowed and all(
            note.holds(value) for note in inner[1:] if isinstance(note, Expected)
        )
    if origin in (Union, UnionType):
        return any(allows(part, value) for part in inner)
    if origin is Literal:
        return any(isinstance(value, type(choice)) and value == choice for choice in inner)
    if kind in (int, float):
        number = isinstance(value, Integral if kind is int else Real)
        return number and not isinstance(value, bool) and math.isfinite(value)
    if kind is bool:
        return type(value).__name__ in ("bool", "bool_")  # NumPy's, too
    if origin is None or origin is Callable:
        if Callable in (kind, origin):
            return callable(value)
        return isinstance(value, kind)
    if issubclass(origin, Mapping):
        return isinstance(value, Mapping)
    # Values that can be read only once, such as a generator, are not checked.
    items = value if isinstance(value, Collection) else ()
    several = isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping))
    return several and all(allows(inner[0], item) for item in items)


def choices(kind: Any) -> list[str]:
    """Return the words among which an annotation lets one choose."""
    if get_origin(kind) is Literal:
        return [choice for choice in get_args(kind) if isinstance(choice, str)]
    if get_origin(kind) in (Union, UnionType):
        return [word for part in get_args(kind) for word in choices(part)]
    return []


def expected(kind: Any) -> str:
    """Return the values that an annotation allows, in words."""
    words = list(dict.fromkeys(_words(kind)))
    return " or ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def _words(kind: Any) -> list[str]:
    origin = get_origin(kind)
    inner = get_args(kind)
    if origin is Annotated:
        told = [note.words for note in inner[1:] if isinstance(note, Expected)]
        return told[:1] or _words(inner[0])
    if origin is Literal:
        return [repr(choice) for choice in inner]
    if origin in (Union, UnionType):
        return [word for part in inner for word in _words(part)]
    if origin is not None and origin is not Callable:
        return [f"a list, each {expected(inner[0])}"]
    return [_WORDS.get(kind) or with_article(getattr(kind, "__name__", "function"))]


def _shown(value: Any) -> str:
    """Return a value as the sentence quotes it: short ones as they are, others by their type."""
    plain = isinstance(value, (str, Real, NoneType, bool, list, tuple))
    text = repr(value.item() if hasattr(value, "item") else value) if plain else ""
    # A sentence quotes only short values.
    if 0 < len(text) <= 60:
        return text
    return with_article(type(value).__name__.removeprefix("nd"))


def resolve_count(given: int | None, usual: int, less: int, *, quick: bool) -> int:
    """Return the number of random repetitions: the given one, else `usual`, or `less` if quick."""
    if given is not None:
        return given
    if quick:
        return less
    return usual
