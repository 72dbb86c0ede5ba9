"""`find_link_side`: torque sensors behind the gears, where rotor and friction come out zero.

The robot file states the rotor of a joint, and the logs show none, nor friction. Then the sensor
sits behind the gear. Each half of the rows must show it by itself: a third of the file's rotor
inertia, with any friction, fits worse than neither. Drives without rotor in the file are no
evidence, because they may have none.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Strings
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


def list_drives(rows: TorqueRows) -> list[Drive]:
    """Return the drives whose rotor the robot file states."""
    robot, base = rows.robot, rows.structure.base
    drives = []
    for j, joint in enumerate(robot.joints):
        name = f"{joint}.{robot.inertia_parts[0]}"
        stated = robot.nominal.get(name, 0.0)
        alone = name in base.names and len(base.terms(base.names.index(name))) == 1
        rotor = base.names.index(name) if alone else -1
        friction = (f"{joint}.{kind}" for kind in FRICTION)
        places = tuple(base.names.index(kind) for kind in friction if kind in base.names)
        if stated > 0 and places:
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
    drives = [drive for drive in list_drives(rows) if seems_nil(rows, literal, drive)]
    shown = [drive for drive in drives if drive.rotor >= 0]
    tested = sum(drive.rotor >= 0 for drive in list_drives(rows))
    # Sensors of one robot sit alike: most rotors that can be seen are nil.
    if not shown or 2 * len(shown) <= tested:
        return None
    verification = verify_side(rows, literal, shown)
    if not verification.holds:
        return None
    link_side = np.isin(np.arange(len(robot.joints)), [drive.joint for drive in drives])
    joints: Strings = tuple(np.array(robot.joints)[link_side].tolist())
    return replace(
        literal,
        description=phrase("alternative", "link", joints=joints),
        remedy=phrase("alternative", "side"),
        link_side=link_side,
        log_odds=verification.gain,
        verification=verification,
    )


def seems_nil(rows: TorqueRows, literal: Reading, drive: Drive) -> bool:
    """Return whether rotor and friction of a drive are negligible in each half of the rows."""
    speed = rows.excerpt.X[:, drive.joint, list(drive.friction)]
    sizes = np.sqrt((speed**2).mean(0))
    scale = np.sqrt(rows.variation[drive.joint])
    for half in rows.halves():
        value, _ = half.solve(literal, adjusted=False)
        friction = np.abs(value[list(drive.friction)]) @ sizes
        rotor = value[drive.rotor] if drive.rotor >= 0 else 0.0
        if friction > RULES.nil * scale or rotor > RULES.nil * drive.stated:
            return False
    return True


def verify_side(rows: TorqueRows, literal: Reading, drives: list[Drive]) -> Verification:
    """Return the evidence of each half of the rows against a third of the file's rotors."""
    independent = rows.count(literal) / np.maximum(rows.counts, 1)
    nothing = {k: 0.0 for drive in drives for k in (drive.rotor, *drive.friction)}
    least = {drive.rotor: drive.stated / PHYSICAL_RULES.another_robot for drive in drives}
    gains = []
    for half in rows.halves():
        behind = half.solve(literal, adjusted=False, fixed=nothing)[1]
        before = half.solve(literal, adjusted=False, fixed=least)[1]
        gains.append(float(independent * half.counts @ np.log(before / behind)) / 2)
    return Verification(sum(gains), min(gains), sum(gains), len(rows.robot.joints))
