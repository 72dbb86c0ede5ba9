"""Refuse robots whose numbers no arithmetic holds, or of more joints than can be worked on."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import INERTIAL_KINDS

#: Degrees of freedom of the joints that move; memory grows faster than their number.
MOST_JOINTS = 100

#: Letters of a name.
LONGEST_NAME = 500

#: No mass, moment, length or gravity in SI units is larger, and no mass smaller unless it is zero.
LARGEST, SMALLEST = 1e15, 1e-30


def check_magnitudes(path: Path, model: Any) -> None:
    """Refuse a model (pinocchio.Model) that is too large in number or size.

    Parameters
    ----------
    path : Path
    model : pinocchio.Model

    Raises
    ------
    RobotError
    """
    if model.nv > MOST_JOINTS:
        raise RobotError(
            f"{path} has {model.nv} degrees of freedom; robots of up to {MOST_JOINTS} are read: "
            "lock joints that do not move ([locked] in the sidecar, or --lock)."
        )
    if not np.all(np.abs(model.gravity.linear) < LARGEST):
        raise RobotError(f"{path} states a gravity that is none; give it in m/s².")
    for k in range(1, model.njoints):
        body, place = model.inertias[k], model.jointPlacements[k].translation
        numbers = np.concatenate([body.toDynamicParameters(), place])
        if body.mass < 0:  # told as such later; its centre may be a quotient of nothing
            numbers = np.array([body.mass])
        if not np.all(np.abs(numbers) < LARGEST) or 0 < abs(body.mass) < SMALLEST:
            raise RobotError(
                f"{path}: mass, inertia or place of what joint '{model.names[k]}' moves is no "
                "number of a robot; give kg, m and kg·m²."
            )


def check_nominal(path: Path, values: Mapping[str, float], positive: Collection[str]) -> None:
    """Refuse values that files state and no joint has.

    Parameters
    ----------
    path : Path
    values : mapping
        By name of the parameter.
    positive : collection of str
        Kinds of parameters that are not negative: dry and viscous friction, rotors.

    Raises
    ------
    RobotError
    """
    for name, value in values.items():
        joint, _, kind = name.rpartition(".")
        if kind not in INERTIAL_KINDS and not abs(value) < LARGEST:  # bodies were asked before
            raise RobotError(f"{path}: {name} = {value:g} is no number of a robot; give SI units.")
        if value < 0 and kind in positive:
            raise RobotError(
                f"{path}: the file, or its sidecar, states {name} = {value:g}; friction (damping, "
                f"frictionloss) and rotors (armature) are not negative: correct '{joint}'."
            )
