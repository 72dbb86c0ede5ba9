"""Which column of a table is what: its joint and channel, whatever the table calls it."""

from __future__ import annotations

from collections.abc import Sequence

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.checks import CHANNELS, find_joints
from identifiability.logs.conventions import Conventions


@frozen
class Column:
    """One column of a log.

    Attributes
    ----------
    name : str
        ``t``, ``<joint>.q`` …
    source : str
        What the table calls it.
    factor : float
        From its values to SI units.
    offset : float
        What is taken from its values before.
    dates : int or None
        Of times that are dates, the first one [ns since 1970]; None for numbers.
    """

    name: str
    source: str
    factor: float = 1.0
    offset: float = 0.0
    dates: int | None = None

    @property
    def is_time(self) -> bool:
        """Whether it holds times that are no seconds."""
        return self.name == "t" and (self.factor, self.offset, self.dates) != (1.0, 0.0, None)

    def scale(self, values: Array) -> Array:
        """Return values of the table, (N,), in SI units."""
        values = values - self.offset if self.offset else values
        return values if self.factor == 1.0 else values * self.factor


@frozen
class Naming:
    """What a log takes from a table.

    Attributes
    ----------
    columns : tuple of Column
        In the order of the table.
    joints : tuple of str
    notes : tuple of str
        What is read otherwise than literally, half a sentence each.
    """

    columns: tuple[Column, ...]
    joints: tuple[str, ...]
    notes: tuple[str, ...] = ()


def name_columns(found: Sequence[str], source: str, known: Conventions) -> Naming:
    """Return what a log takes from the columns of a table.

    Parameters
    ----------
    found : sequence of str
        What the table calls them.
    source : str
        What sentences call the table.
    known : Conventions

    Raises
    ------
    LogError
        If there is no time, or a column that is needed is missing or there twice.
    """
    columns = [Column(_rename(name.strip(), known), name) for name in found]
    names = [c.name for c in columns]
    notes = []
    renamed = [f"{c.source.strip()} is {c.name}" for c in columns if c.source.strip() != c.name]
    if renamed:
        notes.append(f"columns were renamed ({listing(renamed, 3)})")
    kept = _needed(names, known)
    if kept:
        others = [c for c in columns if c.name != "t" and _owner(c.name) not in kept]
        columns = [c for c in columns if c not in others]
        left = list(dict.fromkeys(_owner(c.name) for c in others if _is_channel(c.name)))
        if left:
            notes.append(
                f"columns of {listing(left, 6)}, which the robot does not drive, were left out"
            )
    joints = find_joints([c.name for c in columns], source)
    wanted = {"t", *(f"{j}.{kind}" for j in joints for kind in CHANNELS)}
    return Naming(tuple(c for c in columns if c.name in wanted), tuple(joints), tuple(notes))


def _rename(name: str, known: Conventions) -> str:
    """Return a column by its new name, or by its joint's."""
    whole = known.columns.apply(name)
    if whole != name or not _is_channel(name):
        return whole
    owner, _, kind = name.rpartition(".")
    return f"{known.columns.apply(owner)}.{kind}"


def _needed(names: Sequence[str], known: Conventions) -> tuple[str, ...]:
    """Return the motors or joints of the robot that a table has all that is needed of, or none."""
    for wanted in (known.motors, known.joints):
        needed = {"t", *(f"{j}.{kind}" for j in wanted for kind in ("q", "tau"))}
        if wanted and needed <= set(names):
            return wanted
    return ()


def _owner(name: str) -> str:
    return name.rpartition(".")[0]


def _is_channel(name: str) -> bool:
    owner, _, kind = name.rpartition(".")
    return bool(owner) and kind in CHANNELS
