"""Numbers in the XML of an MJCF: inertials, and what would change them in compiling."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np

from identifiability.foundation.names import Array

#: Rounding of a flat body's moments of inertia, relative to the largest.
FLAT = 1e-13

#: What would change the written values in compiling, or add to them: elements and attributes. The
#: compiler changes masses; what tendons and actuators add to joints is part of the joints' values.
_GONE = (
    ("compiler", "settotalmass boundmass boundinertia balanceinertia"),
    ("compiler", "inertiafromgeom inertiagrouprange"),
    ("flag", "passive spring damper frictionloss"),
    ("joint", "springdamper"),
    ("tendon fixed spatial", "stiffness damping frictionloss armature springlength"),
    ("general motor position velocity intvelocity damper", "armature damping"),
    ("cylinder muscle adhesion dcmotor", "armature damping"),
)


def numbers(values: Array) -> str:
    """Return numbers as an attribute that is read back to the bit."""
    return " ".join(f"{v:.17g}" for v in values)


def in_radians(top: ET.Element) -> bool:
    """Whether the angles of an MJCF are in radians; MuJoCo's default is degrees."""
    stated = [c.get("angle") for c in top.iter("compiler") if c.get("angle")]
    return bool(stated) and stated[-1] == "radian"


def clear_mjcf(top: ET.Element) -> None:
    """Take away what would change the written values, or add to them, in compiling."""
    for tags, keys in _GONE:
        for element in (e for tag in tags.split() for e in top.iter(tag)):
            for key in keys.split():
                element.attrib.pop(key, None)


def write_gravity(top: ET.Element, gravity: Array) -> None:
    """Write gravity (3,) [m/s²] where an MJCF states another one."""
    options = [e for e in top.iter("option") if e.get("gravity")]
    stated = options[-1].get("gravity", "").split() if options else ["0", "0", "-9.81"]
    if not gravity.any() or np.allclose(np.array(stated, float), gravity, rtol=0, atol=1e-12):
        return
    for element in options or top.findall("option")[:1] or [ET.SubElement(top, "option")]:
        element.set("gravity", numbers(gravity))


def write_cable(element: ET.Element, stated: Mapping[str, float], rest: float) -> None:
    """Write friction, inertia and spring of a tendon that is relaxed at a length [m]."""
    for word, value in stated.items():
        element.set(word, f"{value:.17g}")
    if stated.get("stiffness"):
        element.set("springlength", f"{rest:.17g}")


def thicken(inertia: Array) -> Array:
    """Return an inertia (3, 3) of a flat body that MuJoCo takes: rounding may make it too thin."""
    moments, axes = np.linalg.eigh(inertia)
    lack = moments[2] - moments[0] - moments[1]
    if abs(lack) >= FLAT * moments[2]:
        return inertia
    thick: Array = inertia + (FLAT * moments[2] + lack) * axes[:, :2] @ axes[:, :2].T
    return thick


def write_inertial(top: ET.Element, body: str, mass: float, centre: Array, inertia: Array) -> None:
    """Write the inertial of a body, in its own frame, and take the mass off what it is made of.

    Parameters
    ----------
    top : Element
    body : str
    mass : float [kg]
    centre : (3,) [m]
    inertia : (3, 3) [kg·m²]
        About the centre.
    """
    element = next(b for b in top.iter("body") if b.get("name") == body)
    for old in element.findall("inertial"):
        element.remove(old)
    new = ET.Element("inertial", mass=f"{mass:.17g}", pos=numbers(centre))
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    new.set("fullinertia", numbers(np.array([inertia[i, j] for i, j in order])))
    after = [k for k, c in enumerate(element) if c.tag in ("joint", "freejoint")]
    element.insert(max(after, default=-1) + 1, new)
    _take_mass_off(element)


def _take_mass_off(element: ET.Element) -> None:
    """Take the mass off the geoms of a body and off the bodies that are fixed to it."""
    for geom in _parts(element, "geom"):
        geom.set("mass", "0")
        geom.attrib.pop("density", None)
    for child in _parts(element, "body"):
        if not _parts(child, "joint", "freejoint"):
            for part in child.findall("inertial"):
                child.remove(part)
            _take_mass_off(child)


def _parts(element: ET.Element, *tags: str) -> list[ET.Element]:
    """Return the parts of a body, also those in frames."""
    found = [part for part in element if part.tag in tags]
    for frame in element.findall("frame"):
        found += _parts(frame, *tags)
    return found
