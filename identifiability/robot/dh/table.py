r"""A table of Denavit and Hartenberg, as `identifiability convert` reads it.

A TOML file. Every key but ``convention`` and ``links`` is optional; lengths are in m, angles in
rad::

    name = "PUMA 560"
    convention = "modified"              # the frame of a link is Rot_x(alpha) Trans_x(a)
                                         # Rot_z(theta) Trans_z(d) from that of its parent, and its
                                         # joint is along its own z [Craig 2005]; or "standard":
                                         # Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha), and
                                         # along the z of its parent [Denavit 1955]; or "frames":
                                         # links have position, rpy (fixed axes x, y, z, as in a
                                         # URDF) and axis instead of a, alpha, d and theta
    angles = "deg"                       # of alpha, theta, range, home and equals (default: rad)
    gravity = [0, 0, -9.81]              # along the axes of the base [m/s²]

    [[links]]                            # each after its parent
    name = "upper_arm"
    parent = "column"                    # default: the link before, or the base
    joint = "shoulder"                   # what turns the link; without one it is fixed
    type = "prismatic"                   # default: revolute
    a = 0.4318
    alpha = "-pi/2"                      # a text is always in rad
    d = 0.15
    theta = 0                            # what the joint's position adds to (d of a prismatic one)
    equals = "-pitch + 0.5 * roll - 0.1" # the joint follows others
    passive = true                       # no motor: loops determine it
    range = [-2.8, 2.8]                  # [rad or m]
    mass = 17.4                          # [kg]; 0 for a link that weighs nothing, as fixed ones do
                                         # of which nothing is said
    centre = [-0.36, 0.006, 0.23]        # of mass, in the frame of the link [m]
    inertia = {xx = 0.13, yy = 0.52, zz = 0.54, xy = 0, xz = 0, yz = 0}   # about it [kg·m²]

    [[closures]]                         # points of two links that are one, in their frames
    name = "parallelogram"
    link1 = "rod"
    point1 = [0.28, 0, 0]
    link2 = "forearm"
    point2 = [0.1, 0, 0]

    [[springs]]                          # straight between points of two links
    name = "counter_spring"
    link1 = "platform"
    point1 = [0.1, 0, 0]
    link2 = "wrist"
    point2 = [0.01, 0, 0]
    stiffness = 271                      # [N/m]
    rest = 0.06                          # length at which it is relaxed [m]

    [home]                               # joint = position (default 0); selects the assembly
    shoulder = 0.3

    [sidecar]                            # whatever a sidecar can state beside the robot file:
    effects = ["joint_stiffness@roll"]   # transmission, axes, limits, nominal, …
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from identifiability.robot.sidecar import Length, Sidecar, Span, Triple

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
FAR = 1e6

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
