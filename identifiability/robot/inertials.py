"""Bodies as a robot file states them, before fixed joints are merged: which of them cannot exist.

A body exists if its mass is not negative and its principal moments about the centre of mass are
those of some density: none is negative, and none is more than the sum of the others.
"""

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.linalg import NEARLY, TINY
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.values import frozen

from .locate import read_markup

#: Attributes of an inertia in a URDF, and their places in the tensor.
_URDF_MOMENTS = {
    "ixx": (0, 0),
    "iyy": (1, 1),
    "izz": (2, 2),
    "ixy": (0, 1),
    "ixz": (0, 2),
    "iyz": (1, 2),
}

#: The same of the numbers of ``fullinertia`` in an MJCF.
_FULL_MOMENTS = dict(
    zip(("M11", "M22", "M33", "M12", "M13", "M23"), _URDF_MOMENTS.values(), strict=True)
)


@frozen
class StatedInertial:
    """Mass and inertia of one body, as its file states them.

    Attributes
    ----------
    body : str
    mass : float [kg]
    moments : mapping
        Moments and products of inertia about the centre of mass by their words [kg·m²].
    tensor : (3, 3) [kg·m²]
    """

    body: str
    mass: float
    moments: NumberByName
    tensor: Array

    @property
    def fault(self) -> str:
        """Return the impossible value of the body with the file's numbers; empty without one."""
        if self.mass < 0:
            return f"{self.body} (mass {self.mass:g} kg is negative)"
        least, *_, largest = np.linalg.eigvalsh(self.tensor)
        slack = NEARLY * np.abs(self.tensor).max() + TINY * self.mass
        if least < -slack:
            why = "a principal moment is negative"
        elif 2.0 * largest > np.trace(self.tensor) + slack:
            why = "one principal moment is more than the other two together"
        elif self.mass == 0 and self.tensor.any():
            why = "it has no mass"
        else:
            return ""
        return f"{self.body} ({self.numbers}: {why})"

    @property
    def numbers(self) -> str:
        """Mass, moments and those products that are not zero, in the words of the file."""
        shown = {word: x for word, x in self.moments.items() if x or word[-1] == word[-2]}
        moments = ", ".join(f"{word} = {x:g}" for word, x in shown.items())
        return f"{self.mass:g} kg, {moments} kg·m²"


def read_inertials(root: ET.Element) -> list[StatedInertial]:
    """Return the inertials that a robot file states; skip those whose numbers cannot be read."""
    bodies = root.iter("body") if root.tag == "mujoco" else root.iterfind("link")
    read = _read_mjcf if root.tag == "mujoco" else _read_urdf
    found = []
    for body in bodies:
        inertial = body.find("inertial")
        if inertial is None:
            continue
        try:
            mass, moments = read(inertial)
        except ValueError:
            continue
        tensor = np.zeros((3, 3))
        for word, x in moments.items():
            row, column = {**_URDF_MOMENTS, **_FULL_MOMENTS}[word]
            tensor[row, column] = tensor[column, row] = x
        if np.isfinite([mass, *moments.values()]).all():
            found.append(StatedInertial(body.get("name", ""), mass, moments, tensor))
    return found


def _read_urdf(inertial: ET.Element) -> tuple[float, dict[str, float]]:
    """Return mass and moments of an ``<inertial>`` of a URDF."""
    mass = inertial.find("mass")
    inertia = inertial.find("inertia")
    weight = 0.0 if mass is None else float(mass.get("value", "0"))
    if inertia is None:
        return weight, {}
    return weight, {word: float(inertia.get(word, "0")) for word in _URDF_MOMENTS}


def _read_mjcf(inertial: ET.Element) -> tuple[float, dict[str, float]]:
    """Return mass and moments of an ``<inertial>`` of an MJCF, about axes that may be turned."""
    text = inertial.get("fullinertia", inertial.get("diaginertia", ""))
    numbers = [float(word) for word in text.split()]
    return float(inertial.get("mass", "0")), dict(zip(_FULL_MOMENTS, numbers, strict=False))


def find_faults(path: Path, among: Collection[str] | None = None) -> dict[str, str]:
    """Return the impossible inertial values of a robot file, by body.

    Parameters
    ----------
    path : Path
    among : collection of str, optional
        Bodies that are looked at; by default all.
    """
    inertials = read_inertials(read_markup(path))
    faults = {x.body: x.fault for x in inertials if among is None or x.body in among}
    return {body: fault for body, fault in faults.items() if fault}


def describe_faults(faults: Mapping[str, str]) -> str:
    """Return a sentence on the bodies that cannot exist, or nothing."""
    if not faults:
        return ""
    quoted = [*faults.values()][:6]  # of the others it lists the names
    others = listing([*faults][6:], len(faults))
    more = f"; and likewise {others}" * bool(others)
    count = "a body" if len(faults) == 1 else f"{len(faults)} bodies"
    return f"The robot file states {count} that cannot exist: {'; '.join(quoted)}{more}."
