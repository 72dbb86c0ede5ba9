"""`Family`: what a diagnosis must know of an effect before it may name it.

A family is declared before the data are seen: where it can be, which shapes it can have, which
sign its level must have. A study adds its own with `register_family`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from identifiability.effects.effect import Effect
from identifiability.foundation.errors import ModelError, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot


@frozen
class Span:
    """Where an axis was in the logs: shapes are chosen from it.

    Attributes
    ----------
    joint : str
    position_range : float [rad or m]
    rms_speed, max_speed : float [rad/s or m/s]
    """

    joint: str
    position_range: float
    rms_speed: float
    max_speed: float


@frozen
class Family:
    """Effects of one kind, one for each place and shape.

    Attributes
    ----------
    name : str
        Public name, that of its effects.
    title : str
        In words: ``Stribeck friction``.
    build : callable(shape: float, joint: str) -> Effect
        The effect with a shape; families without shapes ignore both arguments.
    places : callable(Robot) -> names of joints, bodies or ``base``
    shapes : callable(Span) -> shapes, optional
        The grid that the shape is searched on.
    shape_unit : callable(prismatic: bool) -> str
    positive : bool
        Whether physics forbids a negative level.
    separate : bool
        Whether each column is a candidate of its own, else they come together.
    fixed_only : bool
        Whether it can differ from the model only while that is not refitted.
    basic : bool
        Whether every joint has it, so that it goes before what only some joints have.
    needs : str
        Family that must be in the model at the same place: what this one refines.
    refuse : callable(Robot, place) -> str
        Why it makes no sense there, as a sentence; empty if it does.
    """

    name: str
    title: str
    build: Callable[[float, str], Effect]
    places: Callable[[Robot], tuple[str, ...]]
    shapes: Callable[[Span], tuple[float, ...]] | None = None
    shape_unit: Callable[[bool], str] | None = None
    positive: bool = False
    separate: bool = False
    fixed_only: bool = False
    basic: bool = False
    needs: str = ""
    refuse: Callable[[Robot, str], str] = lambda robot, place: ""

    def grid(self, span: Span) -> tuple[float, ...]:
        """Return the shapes to try at a place; one nan where there is no shape."""
        if self.shapes is None:
            return (float("nan"),)
        return self.shapes(span)


#: All families by name, in the order in which they are reported.
FAMILIES: dict[str, Family] = {}


def register_family(family: Family) -> Family:
    """Add a family, so that `diagnose` can name it.

    Example
    -------
    A study that suspects a dead weight on a rope::

        class Rope(Effect):
            name, equation = "rope", "τ = R"
            ...
        register_family(Family("rope", "a rope", lambda shape, joint: Rope(), joint_places))

    Raises
    ------
    ModelError
        If the name is taken.
    """
    if family.name in FAMILIES:
        raise ModelError(f"There is a family '{family.name}' already; choose another name.")
    FAMILIES[family.name] = family
    return family


def forget_family(name: str) -> None:
    """Take a registered family away again."""
    FAMILIES.pop(name, None)


def find_families(names: Iterable[str] | None) -> tuple[Family, ...]:
    """Return families by name, all for None.

    Raises
    ------
    ModelError
        If there is none of a name, with the near match.
    """
    if names is None:
        return tuple(FAMILIES.values())
    out = []
    for name in names:
        if name not in FAMILIES:
            raise ModelError(
                f"There is no family of effects '{name}'{near_match(name, FAMILIES)} "
                f"The families are {', '.join(FAMILIES)}."
            )
        out.append(FAMILIES[name])
    return tuple(out)


def joint_places(robot: Robot) -> tuple[str, ...]:
    """Return every actuated joint and coupled motor."""
    return tuple(a.name for a in robot.axes)


def measure_spans(robot: Robot, motions: Iterable[Motion]) -> dict[str, Span]:
    """Return the span of every actuated joint and coupled motor over some motions."""
    motions = list(motions)
    q = np.concatenate([m.actuated_q for m in motions])
    v = np.concatenate([m.actuated_v for m in motions])
    return {a.name: _span(a.name, q @ a.row, v @ a.row) for a in robot.axes if a.row is not None}


def _span(name: str, q: Array, v: Array) -> Span:
    reach = float(np.ptp(q)) or 1.0
    rms = float(np.sqrt(np.mean(v**2))) or 1.0
    return Span(name, reach, rms, float(np.abs(v).max()) or 1.0)
