"""The real robot of a result as plain JSON, for programs of one's own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from identifiability.effects.holding import complete_values
from identifiability.effects.vocabulary import every_parameter
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.foundation.output import write_json
from identifiability.robot import Robot
from identifiability.workflows.export.entries import PhysicalEntry


def write_parameters_json(
    robot: Robot, given: Mapping[str, float], physical: PhysicalEntry, out: Path
) -> Path:
    """Write names, values and units of the real robot, and each body as it is usually stated."""
    known = every_parameter(robot, physical.shapes)
    whole = complete_values(robot, given, keep=False)
    bodies = {b: _state_body([whole[f"{b}.{kind}"] for kind in INERTIAL_KINDS])
              for b in robot.bodies}  # fmt: skip
    told = {
        "schema": "identifiability/robot/1",
        "robot": robot.identity,
        "parameters": [
            {"name": name, "value": value, "unit": known[name].unit if name in known else ""}
            for name, value in given.items()
        ],
        "shapes": physical.shapes,
        "bodies": bodies,
        "error_ra": physical.error_ra,
    }
    return write_json(out, told)


def _state_body(theta: list[float]) -> dict[str, object]:
    """Return mass [kg], centre [m] and inertia about it [kg·m²], in the frame of the joint."""
    mass, first = theta[0], np.array(theta[1:4])
    xx, xy, yy, xz, yz, zz = theta[4:]
    centre = first / mass
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return {"mass": mass, "centre": centre, "inertia": inertia}
