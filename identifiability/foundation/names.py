"""The names, units and sign constraints of parameters: one grammar, ``<owner>.<kind>``.

`Renames` maps names of one source to names of another.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .values import Fields, frozen

# The names, units and sign constraints of parameters: one grammar, ``<owner>.<kind>``.


#: Suffix of the name of a part of a log.
PART = ", part "

#: Arrays of numbers or flags; docstrings state which. NumPy's types of results are too loose for
#: more.
Array = NDArray[Any]

#: Names or sentences in order; and numbers by name, such as values by parameter.
Strings: TypeAlias = tuple[str, ...]
NumberByName: TypeAlias = Mapping[str, float]
ArrayByName: TypeAlias = Mapping[str, Array]

#: Inertial parameters of a body in Pinocchio's order: mass, first moments, and the *tensor*
#: entries of inertia (Ixy = -∫xy dm) about the origin of the body's joint frame.
INERTIAL_KINDS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")

#: The same ten in the order of a pseudo-inertia, in which the grouping tries their columns. Mass is
#: last, so that masses are regrouped into the moments through which they act.
GROUPED_KINDS = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m")

#: Units in which times are written, in s.
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}

#: Owner of the parameters of no joint or body: the tilt of the base.
BASE = "base"


_INERTIAL_UNITS = {"m": "kg", "mx": "kg·m", "my": "kg·m", "mz": "kg·m"}


def name_each(names: Iterable[str], values: Iterable[Any]) -> Fields:
    """Return values by name; those of an array as plain numbers."""
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    return dict(zip(names, plain, strict=True))


@frozen
class Parameter:
    """One parameter of a model: the factor of one column of the regressor.

    Attributes
    ----------
    owner : str
        Body or joint that the parameter belongs to.
    kind : str
        Its kind: ``m``, ``mx``, ``Ixx``, ``Fv``, ``Fc+``, ``Ia`` …
    unit : str
        SI unit.
    group : str
        Name of the effect that the column comes from (``rigid_body``, …).
    symbol : str
        Short form of the owner for labels, such as the ``3`` of ``my(3)``.
    nonnegative : bool
        Whether physics forbids a value below zero.
    stated_as : str
        How a robot file can state it: an inertial kind of its body, or ``damping``,
        ``frictionloss``, ``armature``, ``stiffness`` or ``offset`` of its joint; empty if by
        nothing.
    sd : float
        Standard deviation of its prior about zero, which holds for any robot.
    """

    owner: str
    kind: str
    unit: str
    group: str
    symbol: str = ""
    nonnegative: bool = False
    stated_as: str = ""
    sd: float = float("inf")

    @property
    def name(self) -> str:
        """The public name, ``platform.mx``."""
        return f"{self.owner}.{self.kind}"

    @property
    def term(self) -> str:
        """The form used inside a grouping, ``mx(3)``."""
        return f"{self.kind}({self.symbol or self.owner})"


#: Between the names of two joints, where one effect acts over both; see `name_pair`.
OVER_BOTH = "~"


def name_pair(first: str, second: str) -> str:
    """Return a name for two joints; its sign is longer than any such sign in their names.

    Examples
    --------
    >>> print(name_pair("shoulder", "elbow"), name_pair("shoulder", "el~bow"))
    shoulder~elbow shoulder~~el~bow
    """
    runs = re.findall(f"{OVER_BOTH}+", f"{first} {second}")
    longest = max(map(len, runs), default=0)
    return f"{first}{OVER_BOTH * (longest + 1)}{second}"


def split_pair(name: str) -> Strings:
    """Return the two joints of a name that `name_pair` made; another name by itself."""
    runs = re.findall(f"{OVER_BOTH}+", name)
    return tuple(name.split(max(runs, key=len))) if runs else (name,)


def is_pattern(text: str) -> bool:
    """Return whether a text is a pattern for names: ``*`` is any letters, ``?`` is one."""
    return "*" in text or "?" in text


def specificity(text: str) -> tuple[bool, int]:
    """Return a sort key: patterns before names, and patterns with more letters later."""
    return not is_pattern(text), len(text) - text.count("*") - text.count("?")


def numbered(count: int) -> tuple[str, ...]:
    """Return default names 1 … n, for joints of which only the order is known."""
    return tuple(str(k + 1) for k in range(count))


def find_named(text: str, names: Iterable[str]) -> list[str]:
    """Return the names that fit a name or a pattern such as ``wrist_*.K``, in their order.

    Parameters
    ----------
    text : str
        A text that equals a name means only that name.
    names : iterable of str
    """
    if not is_pattern(text):
        return [text] if text in names else []
    known = dict.fromkeys(names)
    if text in known:
        return [text]
    letters = {"*": ".*", "?": "."}
    parts = (letters.get(c, re.escape(c)) for c in text)
    rule = re.compile("".join(parts), re.DOTALL)
    return [name for name in known if rule.fullmatch(name)]


#: Parts of a name between which a pattern may begin or end.
_PARTS = re.compile(r"[A-Za-z]+|\d|[^A-Za-z\d]+")


def find_patterns(names: Iterable[str], others: Iterable[str]) -> list[str]:
    """Return few names and patterns that fit all of some names and no other.

    Parameters
    ----------
    names : iterable of str
    others : iterable of str
        Names that no pattern may fit.

    Example
    -------
    >>> find_patterns(["left_hip", "left_knee", "head"], ["right_hip", "right_knee"])
    ['left*', 'head']
    """
    wanted = list(dict.fromkeys(names))
    known = [*wanted, *others]
    allowed = set(wanted)
    covers = {}
    for pattern in dict.fromkeys(p for name in wanted for p in _patterns_of(name)):
        found = set(find_named(pattern, known))
        if len(found) > 1 and found <= allowed:
            covers[pattern] = found
    out = []
    rest = set(wanted)
    while covers:
        best = max(covers, key=lambda p: (len(covers[p] & rest), -len(p)))
        if len(covers[best] & rest) < 2:
            break
        out.append(best)
        rest -= covers.pop(best)
    return [*out, *(name for name in wanted if name in rest)]


def _patterns_of(name: str) -> Iterator[str]:
    """Yield patterns that fit a name: with its beginning, its end, or without digits."""
    parts = _PARTS.findall(name) if len(name) <= LONGEST else []
    for k in range(1, len(parts)):
        yield "".join([*parts[:k], "*"])
        yield "".join(["*", *parts[k:]])
    for digits in re.finditer(r"\d+", name) if parts else ():
        before = name[: digits.start()]
        after = name[digits.end() :]
        yield f"{before}*{after}"
        yield f"{before}{'?' * len(digits[0])}{after}"


def inertial_unit(kind: str) -> str:
    """Return the SI unit of an inertial parameter kind."""
    return _INERTIAL_UNITS.get(kind, "kg·m²")


# `Renames`: map names of one source to names of another, by literal or regular rules.
#
# A rule ``fer_joint(\d)`` = ``panda_joint\1`` has a regular expression for the whole name, and the
# new name. A name that equals the left side literally fits, too, including brackets and dots.


#: Repetitions in a rule, and letters of a name that it is tried on: a search takes the length of
#: the name to the power of the repetitions.
MOST_REPEATS, LONGEST = 3, 200

_REPEATS = re.compile(r"\\.|([*+{])", re.DOTALL)
_REPEATED_GROUP = re.compile(r"(?<!\\)\)[*+{]")


@frozen
class Renames:
    """Rules in order; the first that fits a name renames it.

    Attributes
    ----------
    rules : tuple of (str, str)
        Name or regular expression, and the new name. Make them with `Renames.of`.
    """

    rules: tuple[tuple[str, str], ...] = ()

    @staticmethod
    def of(rules: Mapping[str, str]) -> Renames:
        r"""Return the rules after a check.

        Raises
        ------
        ValueError
            If one is no regular expression, or refers to a group that it does not have.

        Example
        -------
        >>> Renames.of({r"fer_joint(\d)": r"panda_joint\1"}).apply("fer_joint7")
        'panda_joint7'
        """
        for old, new in rules.items():
            try:
                empty = re.compile(f"{old}|").fullmatch("")
                assert empty is not None
                empty.expand(new)
            except (re.error, IndexError, RecursionError, OverflowError) as error:
                raise ValueError(
                    f"'{old}' = '{new}' is no rule for names ({error}); give a name and its new "
                    r"name, or a regular expression as in 'fer_joint(\d)' = 'panda_joint\1'"
                ) from None
            repeats = sum(bool(m[1]) for m in _REPEATS.finditer(old))
            if repeats > MOST_REPEATS or _REPEATED_GROUP.search(old):
                raise ValueError(
                    f"'{old}' = '{new}' may be looked for without end: give a rule with at most "
                    f"{MOST_REPEATS} repetitions (*, +), none of them of a group"
                )
            if not old or not new:
                raise ValueError(f"'{old}' = '{new}' renames nothing; give two names")
        return Renames(tuple(rules.items()))

    def __bool__(self) -> bool:
        """Return whether there is any rule."""
        return bool(self.rules)

    def before(self, others: Renames) -> Renames:
        """Return these rules, followed by others for names that fit none of these."""
        return Renames((*self.rules, *others.rules))

    def apply(self, name: str) -> str:
        """Return the new name of a column; the name itself if no rule fits."""
        for old, new in self.rules:
            if name == old:
                # Groups have no text here: the rule means itself.
                return new
            match = re.fullmatch(old, name) if len(name) <= LONGEST else None
            if match is not None:
                return match.expand(new)
        return name

    @property
    def text(self) -> str:
        """The rules as they are written for a command."""
        return "; ".join(f"{old}={new}" for old, new in self.rules)


def name_rule(old: str, new: str) -> str:
    r"""Return the rule ``OLD=NEW`` that renames one name, with any letters.

    Examples
    --------
    >>> print(name_rule("pos[1]", "elbow.q"), name_rule("*", "elbow.q"))
    pos[1]=elbow.q \*=elbow.q
    """
    try:
        Renames.of({old: new})
    except ValueError:
        return f"{re.escape(old)}={new.replace(chr(92), 2 * chr(92))}"
    return f"{old}={new}"


def shorten_paths(paths: Sequence[str]) -> list[str]:
    """Shorten paths by the folders that are not needed to distinguish them.

    Example
    -------
    >>> shorten_paths(["x/run.csv", "y/run.csv", "y/bag:/joint_states"])
    ['x/run.csv', 'y/run.csv', 'bag:/joint_states']
    """
    every = {f"/{path}" for path in paths}
    out = []
    for path in paths:
        place, colon, topic = path.rpartition(":/")
        folders = (place if colon else topic).split("/")
        ends = ("/".join(folders[k:]) for k in reversed(range(len(folders))))
        labels = (f"{end}:/{topic}" if colon else end for end in ends)
        others = every - {f"/{path}"}
        own = (x for x in labels if all(not p.endswith(f"/{x}") for p in others))
        out.append(next(own, path))
    return out
