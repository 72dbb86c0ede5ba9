"""A table of Denavit and Hartenberg, as `identifiability convert` reads it, and its links.

Each link has a place, an axis, a mass; joints may follow others: ``-pitch + 0.5 * roll - 0.1``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot.sidecar import Length, Sidecar, Span, Triple

# Joints that follow others: ``-pitch + 0.5 * roll - 0.1``.


_NUMBER = r"\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?"
_TERM = re.compile(
    rf"\s*([+-])\s*(?:({_NUMBER})\s*(?:\*\s*([^\W\d]\w*))?|([^\W\d]\w*))\s*(?=[+-]|$)"
)


@frozen
class Follow:
    """A joint at ``constant + Σ weights · positions`` [rad or m]."""

    constant: float
    weights: Mapping[str, float]


def read_follow(what: str, text: str, units: Mapping[str, float], unit: float) -> Follow:
    """Return what a joint follows.

    Parameters
    ----------
    what : str
        The table and the joint, for sentences.
    text : str
    units : mapping
        Every joint of the table to the unit that its positions stand in there [rad or m].
    unit : float
        That of the joint itself.

    Raises
    ------
    RobotError
    """
    rest = text.strip().removeprefix("=").strip()
    rest = rest if rest.startswith(("+", "-")) else f"+{rest}"
    constant, weights = 0.0, dict[str, float]()
    while rest:
        found = _TERM.match(rest)
        if found is None:
            raise RobotError(
                f"{what} equals '{text}', which is no sum of joints; write it as -pitch, or as "
                "0.5 * yaw - pitch + 0.1 (polynomials of joints stand in [[sidecar.couplings]])."
            )
        sign, number, scaled, alone = found.groups()
        factor = float(f"{sign}{number or 1}")
        joint, rest = scaled or alone, rest[found.end() :]
        if joint is None:
            constant += unit * factor
            continue
        if joint not in units:
            raise RobotError(
                f"{what} equals '{text}', and there is no joint '{joint}'{near_match(joint, units)}"
                f" The joints are {listing(units)}."
            )
        weights[joint] = weights.get(joint, 0.0) + factor * unit / units[joint]
    return Follow(constant, weights)


# A table of Denavit and Hartenberg, as `identifiability convert` reads it.
#
# A TOML file. Every key but ``convention`` and ``links`` is optional; lengths are in m, angles in
# rad::
#
# name = "PUMA 560"
# convention = "modified"              # the frame of a link is Rot_x(alpha) Trans_x(a)
#                                      # Rot_z(theta) Trans_z(d) from that of its parent, and its
#                                      # joint is along its own z [Craig 2005]; or "standard":
#                                      # Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha), and
#                                      # along the z of its parent [Denavit 1955]; or "frames":
#                                      # links have position, rpy (fixed axes x, y, z, as in a
#                                      # URDF) and axis instead of a, alpha, d and theta
# angles = "deg"                       # of alpha, theta, range, home and equals (default: rad)
# gravity = [0, 0, -9.81]              # along the axes of the base [m/s²]
#
# [[links]]                            # each after its parent
# name = "upper_arm"
# parent = "column"                    # default: the link before, or the base
# joint = "shoulder"                   # what turns the link; without one it is fixed
# type = "prismatic"                   # default: revolute
# a = 0.4318
# alpha = "-pi/2"                      # a text is always in rad
# d = 0.15
# theta = 0                            # what the joint's position adds to (d of a prismatic one)
# equals = "-pitch + 0.5 * roll - 0.1" # the joint follows others
# passive = true                       # no motor: loops determine it
# range = [-2.8, 2.8]                  # [rad or m]
# mass = 17.4                          # [kg]; 0 for a link that weighs nothing, as fixed ones do
#                                      # of which nothing is said
# centre = [-0.36, 0.006, 0.23]        # of mass, in the frame of the link [m]
# inertia = {xx = 0.13, yy = 0.52, zz = 0.54, xy = 0, xz = 0, yz = 0}   # about it [kg·m²]
#
# [[closures]] # points of two links that are one, in their frames name = "parallelogram" link1 =
# "rod" point1 = [0.28, 0, 0] link2 = "forearm" point2 = [0.1, 0, 0]
#
# [[springs]] # straight between points of two links name = "counter_spring" link1 = "platform"
# point1 = [0.1, 0, 0] link2 = "wrist" point2 = [0.01, 0, 0] stiffness = 271 # [N/m] rest = 0.06 #
# length at which it is relaxed [m]
#
# [home] # joint = position (default 0); selects the assembly shoulder = 0.3
#
# [sidecar] # whatever a sidecar can state beside the robot file: effects =
# ["joint_stiffness@roll"] # transmission, axes, limits, nominal, …


#: The name of what the first links stand on.
BASE = "base"

#: Letters of the longest angle.
LONG = 60

_PI = re.compile(r"([+-]?)\s*(\d*\.?\d*)\s*\*?\s*(?:pi|π)\s*(?:/\s*(\d+\.?\d*))?")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


def _angle(value: Any) -> Any:
    """Check that a text is a part of π; it stays a text, whose unit is never degrees."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(value, str):
        read_pi(value)
    elif not number:
        raise ValueError('give a number, or a text such as "-pi/2"')
    return value


def read_pi(text: str) -> float:
    """Return the angle of a text such as ``-pi/2`` or ``0.75 pi`` [rad].

    Raises
    ------
    ValueError
    """
    found = _PI.fullmatch(text.strip()[:LONG])
    if found is None or len(text) > LONG or (found[3] and not float(found[3])):
        raise ValueError(
            f"'{text[:LONG]}' is no part of pi; write it as -pi/2 or 3*pi/4, or as a number"
        )
    sign = -1.0 if found[1] == "-" else 1.0
    return sign * float(found[2] or 1.0) * math.pi / float(found[3] or 1.0)


Angle = Annotated[float | str, BeforeValidator(_angle)]
#: No link is longer than this [m].
FAR: Tolerance = 1e6

Distance = Annotated[float, Field(ge=-FAR, le=FAR)]
NotNegative = Annotated[float, Field(ge=0)]
Name = Annotated[str, Field(min_length=1)]


class InertiaEntry(_Strict):
    """Moments and products of inertia about the centre of mass [kg·m²]."""

    xx: NotNegative
    yy: NotNegative
    zz: NotNegative
    xy: float = 0.0
    xz: float = 0.0
    yz: float = 0.0


class LinkEntry(_Strict):
    """A row of the table."""

    name: Name
    parent: str | None = None
    joint: Name | None = None
    type: Literal["revolute", "prismatic"] = "revolute"
    a: Distance = 0.0
    alpha: Angle = 0.0
    d: Distance = 0.0
    theta: Angle = 0.0
    position: Triple | None = None
    rpy: Triple | None = None
    axis: Triple | None = None
    equals: str | None = None
    passive: bool = False
    range: Span | None = None
    mass: NotNegative | None = None
    centre: Triple | None = None
    inertia: InertiaEntry | None = None


class EndsEntry(_Strict):
    """Points of two links."""

    name: Name
    link1: str
    point1: Triple = (0.0, 0.0, 0.0)
    link2: str
    point2: Triple = (0.0, 0.0, 0.0)


class SpringEntry(EndsEntry):
    """A straight spring between points of two links."""

    stiffness: NotNegative
    rest: Length


class DhTable(_Strict):
    """The whole file."""

    name: str = ""
    convention: Literal["standard", "modified", "frames"]
    angles: Literal["rad", "deg"] = "rad"
    gravity: Triple = (0.0, 0.0, -9.81)
    links: list[LinkEntry] = Field(min_length=1)
    closures: list[EndsEntry] = []
    springs: list[SpringEntry] = []
    home: dict[str, float] = {}
    sidecar: Sidecar = Sidecar()


# The links of a table: where each one is, along what it moves, and what it weighs.


#: An angle that is this near to a multiple of 45°, and not it, may have been rounded [rad].
ROUNDED: Tolerance = 1e-3
EXACT: Tolerance = 1e-12


@frozen(kw_only=True)
class Link:
    """A row of the table in SI units.

    Attributes
    ----------
    entry : LinkEntry
    parent : str
    rotation, position : (3, 3), (3,) [m]
        Its frame in that of its parent, with the joint at zero.
    axis, anchor : (3,), (3,) [m]
        Of its joint, in its own frame.
    follow : Follow or None
        What its joint follows.
    range : (float, float) or None [rad or m]
    """

    entry: LinkEntry
    parent: str
    rotation: Array
    position: Array
    axis: Array
    anchor: Array
    follow: Follow | None = None
    range: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """Its name."""
        return self.entry.name

    @property
    def joint(self) -> str | None:
        """What moves it against its parent; None where it is fixed to it."""
        return self.entry.joint

    @property
    def driven(self) -> bool:
        """Whether its joint has a motor."""
        return self.joint is not None and self.follow is None and not self.entry.passive


def transform(
    convention: Literal["standard", "modified"], a: float, alpha: float, d: float, theta: float
) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) [m] of a frame in the one before."""
    ca, sa, ct, st = (_clean(f(x)) for x in (alpha, theta) for f in (math.cos, math.sin))
    if convention == "modified":
        R = np.array([[ct, -st, 0.0], [st * ca, ct * ca, -sa], [st * sa, ct * sa, ca]])
        return R, np.array([a, -sa * d, ca * d])
    R = np.array([[ct, -st * ca, st * sa], [st, ct * ca, -ct * sa], [0.0, sa, ca]])
    return R, np.array([a * ct, a * st, d])


def _clean(value: float) -> float:
    """Return a sine or cosine without the rounding that is left at right angles."""
    return round(value) if abs(value - round(value)) < np.finfo(float).eps else value


def read_links(path: str, table: DhTable) -> tuple[Link, ...]:
    """Return the links of a table, each after its parent.

    Parameters
    ----------
    path : str
        What the table is called in sentences.
    table : DhTable

    Raises
    ------
    RobotError
    """
    _check_names(path, table.links)
    _check_places(path, table)
    slides = {row.joint: row.type == "prismatic" for row in table.links if row.joint}
    units = {j: 1.0 if s or table.angles == "rad" else math.pi / 180 for j, s in slides.items()}
    known, out = [BASE], []
    for row in table.links:
        parent = row.parent if row.parent is not None else known[-1]
        if parent not in known:
            raise RobotError(
                f"{path}: the link '{row.name}' hangs on '{parent}', which is no link above it"
                f"{near_match(parent, known)} The links above it are {listing(known)}."
            )
        known.append(row.name)
        R, p, axis, anchor = _place(table, row)
        unit = units.get(row.joint, 1.0) if row.joint else 1.0
        follow = None
        if row.equals is not None:
            what = f"{path}: the joint '{row.joint}'"
            follow = read_follow(what, row.equals, units, unit)
            if row.joint in follow.weights:
                raise RobotError(f"{what} equals '{row.equals}', itself; name other joints.")
        limits = None if row.range is None else (unit * row.range[0], unit * row.range[1])
        out.append(
            Link(
                entry=row,
                parent=parent,
                rotation=R,
                position=p,
                axis=axis,
                anchor=anchor,
                follow=follow,
                range=limits,
            )
        )
    return tuple(out)


def _place(table: DhTable, row: LinkEntry) -> tuple[Array, Array, Array, Array]:
    """Return rotation, position, and axis and anchor of the joint of a row."""
    if table.convention == "frames":
        turn = math.pi / 180 if table.angles == "deg" else 1.0
        R = _turned(*(turn * x for x in row.rpy or (0.0, 0.0, 0.0)))
        position = np.array(row.position or (0.0, 0.0, 0.0))
        return R, position, np.array(row.axis or (0.0, 0.0, 1.0)), np.zeros(3)
    alpha, theta = (_radians(x, table.angles) for x in (row.alpha, row.theta))
    R, p = transform(table.convention, row.a, alpha, row.d, theta)
    if table.convention == "modified":
        return R, p, np.array([0.0, 0.0, 1.0]), np.zeros(3)
    # Along the z of its parent, as its own frame sees it.
    axis = np.array([0.0, _clean(math.sin(alpha)), _clean(math.cos(alpha))])
    return R, p, axis, np.array([-row.a, 0.0, 0.0])


def _turned(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation of angles about the fixed axes x, y and z, one after the other."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (_clean(math.cos(x)), _clean(math.sin(x))) for x in (roll, pitch, yaw)
    )
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    out: Array = about_z @ about_y @ about_x
    return out


#: What places a link in a table of frames, and in one of Denavit and Hartenberg.
_FRAMES, _DH = ("position", "rpy", "axis"), ("a", "alpha", "d", "theta")


def _check_places(path: str, table: DhTable) -> None:
    """Refuse what places a link in another convention, and an axis that is none."""
    odd = _DH if table.convention == "frames" else _FRAMES
    for row in table.links:
        wrong = [key for key in odd if key in row.model_fields_set]
        if wrong:
            usual = _FRAMES if odd is _DH else _DH
            raise RobotError(
                f"{path}: the link '{row.name}' has '{wrong[0]}', which is not of the convention "
                f"'{table.convention}'; give {listing(usual)}."
            )
        if row.axis is not None and not any(row.axis):
            raise RobotError(f"{path}: the axis of '{row.name}' is zero; give its direction.")


def _radians(angle: Angle, unit: Literal["rad", "deg"]) -> float:
    if isinstance(angle, str):
        return read_pi(angle)
    return math.radians(angle) if unit == "deg" else angle


def _check_names(path: str, rows: Sequence[LinkEntry]) -> None:
    """Refuse names that are given twice and rows that contradict themselves."""
    for what, names in (
        ("link", [BASE, *(row.name for row in rows)]),
        ("joint", [row.joint for row in rows if row.joint is not None]),
    ):
        twice = [name for k, name in enumerate(names) if name in names[:k]]
        if twice:
            raise RobotError(f"{path}: two of its {what}s are called '{twice[0]}'; name each once.")
    for row in rows:
        moving = [key for key in ("equals", "range") if getattr(row, key) is not None]
        moving += ["passive"] if row.passive else []
        if row.joint is None and moving:
            raise RobotError(
                f"{path}: the link '{row.name}' has '{moving[0]}' but no joint; name its joint."
            )
        if row.passive and row.equals is not None:
            raise RobotError(
                f"{path}: the joint '{row.joint}' is passive and equals '{row.equals}'; what "
                "follows others has no motor anyway: leave out one of both."
            )
        weighed = [key for key in ("centre", "inertia") if getattr(row, key) is not None]
        if weighed and not row.mass:
            raise RobotError(
                f"{path}: the link '{row.name}' has '{weighed[0]}' but no mass; state it."
            )


def rounded_angles(table: DhTable) -> Iterator[str]:
    """Give a sentence for the angles that look like multiples of 45° with too few digits."""
    found = []
    for row in table.links:
        for key in ("alpha", "theta"):
            angle = _radians(getattr(row, key), table.angles)
            apart = abs(angle - round(angle / (math.pi / 4)) * math.pi / 4)
            if EXACT < apart < ROUNDED:
                found.append(f"{key} = {getattr(row, key)} of '{row.name}'")
    if found:
        yield (
            f"{listing(found)}: nearly a multiple of 45°, and taken as it stands; axes that are "
            "not quite parallel have parameters of their own, so if it was rounded give it as a "
            'text such as "pi/2".'
        )
