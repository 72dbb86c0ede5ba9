"""Whether the bodies of a real robot weigh what bodies like those of the robot file can."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identifiability.physical.cad_prior import thick_inertia
from identifiability.physical.feasibility import stated_body
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
    remedy = f"analyze and prune with --cad-prior {10 * cad_weight or 1:g} keep it near the file"
    if any(".payload_" in name for name in parameters):
        remedy = f"leave the effect payload out (the last body has it); then {remedy}"
    if not _can_pull(robot):
        remedy = f"correct the bodies of the robot file that cannot exist; then {remedy}"
    return (
        f"The nearest real robot weighs {mass:.4g} kg, that of the robot file {stated:.4g} kg: the "
        f"logs do not determine every mass; {remedy}."
    )


def total_mass(robot: Robot, parameters: Mapping[str, float]) -> float:
    """Return the mass of all moving bodies with their payloads [kg]."""
    kinds = ("m", "payload_m")
    return float(sum(parameters.get(f"{b}.{kind}", 0.0) for b in robot.bodies for kind in kinds))


def real_robot_dict(
    robot: Robot,
    parameters: Mapping[str, float],
    errors: tuple[float, float],
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
    errors : (float, float)
        ε_RA on the fitted logs, of all parameters and of what a robot file holds of them.
    shapes : mapping
        Of the model's effects, by ``<joint>.<effect>``.
    cad_weight : float
        Of the prior that it was found with.
    """
    return {
        "error_ra": errors[0],
        "error_ra_file": errors[1],
        "file": "mjcf" if robot.mjcf else "urdf",
        "mass": total_mass(robot, parameters) if parameters else None,
        "mass_file": total_mass(robot, robot.nominal),
        "cad_prior": cad_weight,
        "shapes": dict(shapes),
        "parameters": dict(parameters),
    }


def _can_pull(robot: Robot) -> bool:
    """Whether a prior around the bodies of the robot file is possible."""
    try:
        for body in robot.bodies:
            thick_inertia(stated_body(robot, body), body)
    except ValueError:
        return False
    return True
