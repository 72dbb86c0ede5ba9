"""Whether the bodies of a real robot weigh what bodies like those of the robot file can."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identifiability.foundation.errors import listing
from identifiability.physical.cad_prior import WEAK
from identifiability.robot import Robot

#: Times the robot file's total mass beyond which another one is spoken of.
HEAVY = 3.0


def state_mass(robot: Robot, parameters: Mapping[str, float], cad_weight: float = 0.0) -> str:
    """Return what is wrong with the total mass of a robot, and the remedy; nothing if it is right.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name.
    cad_weight : float
        Weight of the prior that they were found with.
    """
    mass = total_mass(robot, parameters)
    stated = total_mass(robot, robot.nominal)
    if not mass > HEAVY * stated > 0:
        return ""
    remedy = f"--cad-prior {10 * cad_weight or WEAK:g} keeps it nearer to the file"
    why = f"the logs do not determine every mass; {remedy}"
    if cad_weight:
        why = (
            "the logs contradict the file where they are not silent; look whether a mass of the "
            f"file, a unit or a torque scale is wrong, or {remedy}"
        )
    return (
        f"The nearest real robot weighs {mass:.4g} kg, that of the robot file {stated:.4g} kg: "
        f"{why}."
    )


def mass_rows(robot: Robot, parameters: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return of each body and of all its mass and the robot file's [kg].

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name; empty where no real robot was found.
    """
    return [
        {
            "body": body,
            "mass": sum(parameters[n] for n in _masses(body) if n in parameters),
            "mass_file": float(robot.nominal.get(f"{body}.m", 0.0)),
        }
        for body in robot.bodies
        if any(n in parameters for n in _masses(body))
    ]


def state_masses(robot: Robot, parameters: Mapping[str, float]) -> str:
    """Return in one line what a real robot and its bodies weigh beside the robot file's.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name; the line is empty without masses.
    """
    rows = mass_rows(robot, parameters)
    if not rows:
        return ""
    text = (
        f"The nearest real robot weighs {total_mass(robot, parameters):.4g} kg, that of the robot "
        f"file {total_mass(robot, robot.nominal):.4g} kg"
    )
    far = [r for r in rows if not r["mass_file"] / HEAVY <= r["mass"] <= HEAVY * r["mass_file"]]
    if not far:
        return f"{text}; every body is within a factor {HEAVY:g} of the file's."
    each = [f"{r['body']} {r['mass']:.3g} for {r['mass_file']:.3g} kg" for r in far]
    return f"{text}; far from the file's are {listing(each, 4)}."


def total_mass(robot: Robot, parameters: Mapping[str, float]) -> float:
    """Return the mass of all moving bodies with their payloads [kg]."""
    return float(sum(parameters.get(name, 0.0) for b in robot.bodies for name in _masses(b)))


def real_robot_dict(
    robot: Robot,
    parameters: Mapping[str, float],
    errors: tuple[float, float, float],
    shapes: Mapping[str, float],
    cad_weight: float = 0.0,
) -> dict[str, Any]:
    """Return a real robot as plain values, as `export` reads them.

    Parameters
    ----------
    robot : Robot
        Whose file it is written to.
    parameters : mapping
        Standard parameters by name; empty where no real robot was found.
    errors : (float, float, float)
        ε_RA on the fitted logs, of all parameters and of what a robot file holds of them: one of
        the robot's own format, and one of the other.
    shapes : mapping
        Of the model's effects, by ``<joint>.<effect>``.
    cad_weight : float
        Of the prior that it was found with.
    """
    own, other = ("mjcf", "urdf") if robot.mjcf else ("urdf", "mjcf")
    return {
        "error_ra": errors[0],
        "error_ra_file": errors[1],
        "file": own,
        "error_ra_files": {own: errors[1], other: errors[2]},
        "mass": total_mass(robot, parameters) if parameters else None,
        "mass_file": total_mass(robot, robot.nominal),
        "masses": mass_rows(robot, parameters),
        "cad_prior": cad_weight,
        "shapes": dict(shapes),
        "parameters": dict(parameters),
    }


def _masses(body: str) -> tuple[str, str]:
    return f"{body}.m", f"{body}.payload_m"
