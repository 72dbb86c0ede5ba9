"""What is known of the mass of bodies and of where their centres are."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen


@frozen
class Ellipsoid:
    """An ellipsoid along the axes of a body's frame.

    Attributes
    ----------
    centre, radii : (3,) [m]
    """

    centre: tuple[float, float, float]
    radii: tuple[float, float, float]


@frozen
class Bound:
    """What is known of the mass of bodies, or of the centre of mass of one.

    Attributes
    ----------
    bodies : tuple of str
        Whose masses add up; one where there is anything about its centre.
    mass : (float, float) or None [kg]
    box : three pairs or None [m]
        Where the centre of mass is, along the axes of the body's frame.
    ellipsoid : Ellipsoid or None
        The same, in the body's frame.
    rotation, origin : (3, 3), (3,) [m]
        The body's frame in that of its joint, which parameters are about.
    """

    bodies: tuple[str, ...]
    mass: tuple[float, float] | None = None
    box: tuple[tuple[float, float], ...] | None = None
    ellipsoid: Ellipsoid | None = None
    rotation: Array = field(default_factory=lambda: np.eye(3))
    origin: Array = field(default_factory=lambda: np.zeros(3))
