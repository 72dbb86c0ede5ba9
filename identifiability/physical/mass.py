"""Whether the bodies of a real robot weigh what bodies like those of the robot file can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identifiability.effects.gravity import settle_gravity
from identifiability.effects.vocabulary import file_kinds, held_by_file
from identifiability.estimation.prediction import predict
from identifiability.foundation.errors import listing
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.physical.cad_prior import WEAK
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

#: Factor between a mass and that of the robot file, either way, beyond which it is spoken of.
FAR = 3.0


def is_far(mass: float, stated: float) -> bool:
    """Whether a mass is beyond a factor `FAR` of that of the robot file, either way."""
    return not stated / FAR <= mass <= FAR * stated


def state_mass(robot: Robot, parameters: Mapping[str, float], cad_weight: float = 0.0) -> str:
    """Return what is wrong with the total mass of a robot, and the remedy; nothing if it is right.

    It is the first thing that is said of a robot: one that is many times too heavy or too light
    may predict torque well along the motion that was fitted, and moves wrongly in a simulator.

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
    if not (stated > 0 and mass_rows(robot, parameters) and is_far(mass, stated)):
        return ""
    remedy = f"--cad-prior {10 * cad_weight or WEAK:g} keeps it nearer to the file"
    why = f"the logs do not determine every mass; {remedy}"
    if cad_weight:
        why = (
            "identified masses disagree with the file's; look whether a mass of the file, a unit "
            f"or a torque scale is wrong, or {remedy}"
        )
    return f"{state_total(robot, parameters)}: {why}."


def state_total(robot: Robot, parameters: Mapping[str, float]) -> str:
    """Return what a real robot weighs beside that of the robot file, without a full stop."""
    return (
        f"The nearest real robot weighs {total_mass(robot, parameters):.4g} kg, that of the robot "
        f"file {total_mass(robot, robot.nominal):.4g} kg"
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
    text = state_total(robot, parameters)
    far = [r for r in rows if is_far(r["mass"], r["mass_file"])]
    if not far:
        return f"{text}; every body is within a factor {FAR:g} of the file's."
    each = [f"{r['body']} {r['mass']:.3g} for {r['mass_file']:.3g} kg" for r in far]
    return f"{text}; far from the file's are {listing(each, 4)}."


def total_mass(robot: Robot, parameters: Mapping[str, float]) -> float:
    """Return the mass of all moving bodies with their payloads [kg]."""
    return float(sum(parameters.get(name, 0.0) for b in robot.bodies for name in _masses(b)))


def real_robot_dict(
    structure: Structure,
    parameters: Mapping[str, float],
    errors: tuple[float, float, float],
    samples: Sequence[Prepared] = (),
    cad_weight: float = 0.0,
) -> dict[str, Any]:
    """Return a real robot as plain values, as `export` reads them.

    Parameters
    ----------
    structure : Structure
        Of the robot whose file it is written to.
    parameters : mapping
        Standard parameters by name; empty where no real robot was found.
    errors : (float, float, float)
        ε_RA on the fitted logs, of all parameters and of what a robot file holds of them: one of
        the robot's own format, and one of the other.
    samples : sequence of Samples or LongSamples
        The fitted logs.
    cad_weight : float
        Of the prior that it was found with.
    """
    robot = structure.robot
    own, other = file_kinds(robot)
    tilt = settle_gravity(robot, parameters)[0].tilt
    if tilt is not None and samples:
        errors = _errors_tilted(structure, samples, parameters)
    return {
        **({} if tilt is None else {"gravity": tilt.to_dict()}),
        "error_ra": errors[0],
        "error_ra_file": errors[1],
        "file": own,
        "error_ra_files": {own: errors[1], other: errors[2]},
        "mass": total_mass(robot, parameters) if parameters else None,
        "mass_file": total_mass(robot, robot.nominal),
        "masses": mass_rows(robot, parameters),
        "cad_prior": cad_weight,
        "shapes": dict(structure.shapes) if parameters else {},
        "parameters": dict(parameters),
    }


def _errors_tilted(
    structure: Structure, samples: Sequence[Prepared], values: Mapping[str, float]
) -> tuple[float, float, float]:
    """Return ε_RA of a robot whose base is tilted, and of what a file of either format holds.

    Gravity pulls at the bodies that were found, along where it points; the columns of a tilt are
    those of the file's bodies, and to first order.

    Parameters
    ----------
    structure : Structure
    samples : sequence of Samples or LongSamples
    values : mapping
        Standard parameters by name.
    """
    robot, rest = settle_gravity(structure.robot, values)
    held = [rest, *(held_by_file(robot, rest, kind) for kind in file_kinds(robot))]
    phi = np.array([[f.get(name, 0.0) for name in structure.columns] for f in held]).T
    first = [structure.columns.index(n) == k for k, n in enumerate(structure.columns)]
    regression = Regression(robot, structure.model, tuple(samples))
    whole, own, other = predict(regression, phi * np.array(first)[:, None]).relative_error()
    return float(whole), float(own), float(other)


def _masses(body: str) -> tuple[str, str]:
    return f"{body}.m", f"{body}.payload_m"
