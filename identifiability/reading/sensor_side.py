"""`find_link_side`: torque sensors behind the gears, where rotor and friction come out zero.

The robot file states the rotor of a joint, and the logs show none, nor friction. Then the sensor
sits behind the gear. Both halves of the rows must show that there is no friction. Together, a third
of the file's rotor inertias, with any friction, must fit worse than neither. Drives without rotor
in the file are no evidence, because they may have none.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen
from identifiability.physical.rules import RULES as PHYSICAL_RULES

from .fit import TorqueRows
from .reading import Reading
from .rules import RULES
from .verification import Verification

#: Kinds of friction of the default model.
FRICTION = ("Fv", "Fc", "Fc+", "Fc-")


@frozen
class Drive:
    """The drive of a joint as base parameters.

    Attributes
    ----------
    joint : int
    rotor : int
        Base parameter of its rotor alone; −1 if bodies are part of that parameter.
    friction : tuple of int
        Base parameters of its friction.
    stated : float
        Rotor inertia in the robot file [kg·m² or kg].
    """

    joint: int
    rotor: int
    friction: tuple[int, ...]
    stated: float

    @property
    def least(self) -> float:
        """The smallest rotor inertia that a file with this one may mean."""
        return self.stated / PHYSICAL_RULES.another_robot


def list_drives(rows: TorqueRows) -> list[Drive]:
    """Return the drives whose rotor the robot file states."""
    robot = rows.robot
    base = rows.structure.base
    names = base.names
    drives = []
    for j, joint in enumerate(robot.joints):
        name = f"{joint}.{robot.inertia_parts[0]}"
        stated = robot.nominal.get(name, 0.0)
        alone = name in names and len(base.terms(names.index(name))) == 1
        rotor = names.index(name) if alone else -1
        friction = (f"{joint}.{kind}" for kind in FRICTION)
        places = tuple(names.index(kind) for kind in friction if kind in names)
        if stated > 0 and places and rows.variation[j] > 0:
            drives.append(Drive(j, rotor, places, stated))
    return drives


def find_link_side(rows: TorqueRows, literal: Reading) -> Reading | None:
    """Return the reading by which torque sensors sit behind gears; None without evidence.

    Parameters
    ----------
    rows : TorqueRows
        Of the fitted logs.
    literal : Reading
    """
    robot = rows.robot
    told = "side" in robot.torque.model_fields_set
    if told or robot.transmission is not None or len(robot.inertia_parts) > 1:
        return None
    stated = list_drives(rows)
    if not stated:
        return None
    values = [half.solve(literal, adjusted=False)[0] for half in rows.halves()]
    free = [drive for drive in stated if has_no_friction(rows, values, drive)]
    if 2 * len(free) <= len(stated):
        return None
    comparison = Comparison(rows, literal)
    behind = [drive for drive in free if not comparison.shows_rotor(drive)]
    alone = [drive for drive in behind if drive.rotor >= 0]
    every = [drive for drive in stated if drive.rotor >= 0]
    # Sensors of one robot sit alike.
    if not alone or 2 * len(alone) <= len(every):
        return None
    verification = comparison.verify(alone)
    if not verification.holds:
        return None
    link_side = np.isin(np.arange(len(robot.joints)), [drive.joint for drive in behind])
    joints: Strings = tuple(np.array(robot.joints)[link_side].tolist())
    description = phrase("alternative", "link", joints=joints)
    return replace(
        literal,
        description=description,
        remedy=phrase("alternative", "side"),
        link_side=link_side,
        log_odds=verification.gain,
        verification=verification,
    )


def has_no_friction(rows: TorqueRows, values: Sequence[Array], drive: Drive) -> bool:
    """Return whether friction of a drive is negligible in base parameters (b,) of each half."""
    places = list(drive.friction)
    columns = rows.excerpt.X[:, drive.joint, places]
    sizes = np.sqrt((columns**2).mean(0) / rows.variation[drive.joint])
    return all(np.abs(value[places]) @ sizes <= RULES.nil for value in values)


class Comparison:
    """Fits of rows with some base parameters fixed, compared by their evidence.

    Parameters
    ----------
    rows : TorqueRows
    literal : Reading
    """

    def __init__(self, rows: TorqueRows, literal: Reading) -> None:
        self.rows = rows
        self.literal = literal
        #: Share of the rows of each joint that are independent, (n,).
        self.independent = rows.count(literal) / np.maximum(rows.counts, 1)

    def gain(self, rows: TorqueRows, one: Mapping[int, float], other: Mapping[int, float]) -> float:
        """Return the evidence for fixed values against other ones [nat]."""
        misfit = rows.solve(self.literal, adjusted=False, fixed=one)[1]
        worse = rows.solve(self.literal, adjusted=False, fixed=other)[1]
        return float(self.independent * rows.counts @ np.log(worse / misfit)) / 2

    def shows_rotor(self, drive: Drive) -> bool:
        """Return whether the rows need a rotor of a size like the file's."""
        if drive.rotor < 0:
            return False
        like = self.rows.solve(self.literal, adjusted=False)[0][drive.rotor] >= drive.least
        return bool(like and self.gain(self.rows, {}, {drive.rotor: 0.0}) >= RULES.unseen_gain)

    def verify(self, drives: Sequence[Drive]) -> Verification:
        """Return the evidence of each half of the rows against the least rotors of drives."""
        nothing = {k: 0.0 for drive in drives for k in (drive.rotor, *drive.friction)}
        rotors = {drive.rotor: drive.least for drive in drives}
        gains = [self.gain(half, nothing, rotors) for half in self.rows.halves()]
        return Verification(sum(gains), min(gains), sum(gains), len(self.rows.robot.joints))
