r"""`Renames`: how names in one place become names in another, by rules that are literal or regular.

A rule ``fer_joint(\d)`` = ``panda_joint\1`` is a regular expression for the whole of a name and
what it becomes. What stands literally in a rule is itself, brackets and dots included.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from identifiability.foundation.values import frozen

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
        Name or regular expression, and what it becomes. Make them with `Renames.of`.
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
        """Return these rules and, where none of them fits, others."""
        return Renames((*self.rules, *others.rules))

    def apply(self, name: str) -> str:
        """Return what a name becomes; itself where no rule fits."""
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
