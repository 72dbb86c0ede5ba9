"""Straight C and Python from a CasADi function: self-contained, without any package but numpy."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from identifiability.foundation.errors import RobotError
from identifiability.foundation.output import write_text
from identifiability.robot import Robot
from identifiability.workflows.export.closed_code import CLOSED_PYTHON, closed_parts
from identifiability.workflows.export.statements import (
    FUNCTIONS,
    Language,
    comment_text,
    indent,
    names_text,
    write_statements,
)
from identifiability.workflows.export.symbols import torque_symbols

_C = """\
/* Inverse dynamics of {title}, {count}.
   {values}
   inverse_dynamics(q, v, a, tau): positions [rad or m], velocities and accelerations in,
   torques [N m or N] out, of the joints
     {joints}
   in this order. */
#include <math.h>

void inverse_dynamics(const double q[{n}], const double v[{n}], const double a[{n}],
                      double tau[{n}]);

void inverse_dynamics(const double q[{n}], const double v[{n}], const double a[{n}],
                      double tau[{n}])
{{
{torque}
}}
"""

_PYTHON = '''\
"""Inverse dynamics of {title}, {count}.

{values}
"""

import math

import numpy as np

#: The joints, in the order of all columns.
JOINTS = {joints}

{functions}

def inverse_dynamics(q, v, a):
    """Return torques [N m or N] (..., {n}) of positions [rad or m], velocities, accelerations."""
    q, v, a = (np.moveaxis(np.asarray(x, float), -1, 0) for x in (q, v, a))
    tau = np.zeros(q.shape)
{torque}
    return np.moveaxis(tau, 0, -1)
'''


def write_code(
    robot: Robot,
    values: Mapping[str, float],
    shapes: Mapping[str, float],
    path: Path,
    language: Language,
) -> Path:
    """Write a function of positions, velocities and accelerations that returns torques.

    Parameters
    ----------
    robot : Robot
        In C a tree.
    values, shapes : mapping
        Standard parameters, and shapes of effects, by name.
    path : Path
    language : {"c", "python"}

    Raises
    ------
    RobotError
        If C is asked for a closed chain.
    IdentifiabilityError
        If there is no CasADi, or something has no code.
    """
    if robot.closed and language == "c":
        raise RobotError(
            f"C is generated for trees, and {robot.name} is a closed chain: export it as Python "
            "(.py), which closes the loops."
        )
    function = torque_symbols(robot, values, shapes)
    lines = list(write_statements(function, language, ("q", "v", "a", "slope"), ("tau",)))
    known = "; what is known of its torque beforehand is not in it" if robot.known_torque else ""
    texts = {
        "title": comment_text(robot.title),
        "count": f"{len(lines)} statements",
        "values": f"Generated with the {sum(map(bool, values.values()))} values of a fitted "
        f"model{known}.",
        "joints": names_text(robot.joints)
        if language == "python"
        else ", ".join(map(comment_text, robot.joints)),
        "n": len(robot.joints),
        "torque": indent(lines),
        "functions": FUNCTIONS,
    }
    template = _C if language == "c" else _PYTHON
    if robot.closed:
        template = CLOSED_PYTHON
        texts |= closed_parts(robot)
    return write_text(path, template.format(**texts))
