"""Patterns in a sidecar's tables: ``wrist_*.Fv`` for every joint, motor and axis that fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import INERTIAL_KINDS, find_named, is_pattern
from identifiability.foundation.values import frozen
from identifiability.robot.sidecar import LimitEntry, Sidecar

V = TypeVar("V")


@frozen
class Owners:
    """What parameters can be named after.

    Attributes
    ----------
    bodies : tuple of str
    lines : tuple of str
        Joints, motors and axes.
    gone : tuple of str
        What is locked, and bodies behind it: a pattern may fit nothing else.
    """

    bodies: tuple[str, ...]
    lines: tuple[str, ...]
    gone: tuple[str, ...] = ()


def spread_patterns(path: Path, extra: Sidecar, owners: Owners) -> Sidecar:
    """Return a sidecar in which every name that a pattern stands for is written out.

    A name goes before a pattern, and of two patterns the one that stands last.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    extra : Sidecar
    owners : Owners

    Raises
    ------
    RobotError
        If nothing fits a pattern.
    """
    tables = {
        key: _spread(path, key, getattr(extra, key), owners)
        for key in ("nominal", "prior", "shapes", "reference")
    }
    limits: dict[str, LimitEntry] = {}
    for text in sorted(extra.limits, key=is_pattern, reverse=True):
        names = _fitting(path, "limits", text, owners.lines, owners.gone)
        limits |= dict.fromkeys(names, extra.limits[text])
    ties = [
        s.model_copy(
            update={
                "tie": {
                    name: [n for text in members for n in _named(path, "symmetry", text, owners)]
                    for name, members in s.tie.items()
                }
            }
        )
        for s in extra.symmetry
    ]
    return extra.model_copy(update={**tables, "limits": limits, "symmetry": ties})


def _spread(path: Path, key: str, table: Mapping[str, V], owners: Owners) -> dict[str, V]:
    out: dict[str, V] = {}
    for text in sorted(table, key=is_pattern, reverse=True):
        out |= dict.fromkeys(_named(path, key, text, owners), table[text])
    return out


def _named(path: Path, key: str, text: str, owners: Owners) -> list[str]:
    """Return the parameters that a text stands for; those of inertia are bodies'."""
    if not is_pattern(text):
        return [text]
    owner, _, kind = text.rpartition(".")
    kinds = find_named(kind, INERTIAL_KINDS) if is_pattern(kind) else [kind]
    of_bodies = is_pattern(kind) or kind in INERTIAL_KINDS or kind.startswith("payload_")
    known = owners.bodies if of_bodies else owners.lines
    return [
        f"{name}.{k}"
        for name in _fitting(path, key, owner if kinds else text, known, owners.gone, text)
        for k in kinds
    ]


def _fitting(
    path: Path, key: str, pattern: str, known: Sequence[str], gone: Sequence[str], text: str = ""
) -> list[str]:
    """Return the names that fit a pattern, none where only what is gone does; a name is itself."""
    if not is_pattern(pattern):
        return [pattern]
    found = find_named(pattern, known)
    if not found and not find_named(pattern, gone):
        raise RobotError(
            f"The sidecar of {path}: [{key}] has the pattern '{text or pattern}', which nothing "
            f"fits; the names are {listing(known)}."
        )
    return found
