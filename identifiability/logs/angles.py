"""Columns of angles that were said to be in degrees."""

from __future__ import annotations

import math
from dataclasses import replace

from identifiability.logs.conventions import Conventions
from identifiability.logs.naming import Column, Naming

#: Channels that are angles or their rates, and one degree [rad].
ANGULAR = ("q", "dq", "ddq", "q_ref", "dq_ref")
DEGREE = math.pi / 180


def settle_angles(naming: Naming, known: Conventions) -> Naming:
    """Return what a log takes from a table, angles in rad; columns that state a unit keep it."""
    columns = tuple(_settle(column, known) for column in naming.columns)
    locked = tuple(_settle(column, known) for column in naming.locked)
    if columns == naming.columns:
        return naming
    notes = (*naming.notes, "angles were read as degrees")
    return replace(naming, columns=columns, notes=notes, locked=locked)


def _settle(column: Column, known: Conventions) -> Column:
    owner, _, kind = column.name.rpartition(".")
    if owner in known.degrees and kind in ANGULAR and column.factor == 1.0:
        return replace(column, factor=DEGREE)
    return column
