"""Write a robot file with other parameters, in the robot's own format or in the other one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from identifiability.effects.gravity_tilt import settle_gravity
from identifiability.effects.holding import (
    complete_values,
    read_back,
    settle_springs,
    stated_numbers,
)
from identifiability.foundation.errors import RobotError, near_match
from identifiability.foundation.names import BASE, INERTIAL_KINDS
from identifiability.foundation.scratch import temporary_folder
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.twin import write_twin
from identifiability.robot.write import write_robot


@frozen
class Written:
    """What was written.

    Attributes
    ----------
    robot : Path
    sidecar : Path or None
    beside : tuple of str
        Parameters that the robot file cannot hold and the sidecar does.
    """

    robot: Path
    sidecar: Path | None
    beside: tuple[str, ...]


def write_parameters(
    robot: Robot,
    parameters: Mapping[str, float],
    path: str | Path,
    *,
    keep: bool = True,
    shapes: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
) -> Written:
    """Write a robot file with other parameters; what it cannot hold stands in its sidecar.

    Parameters
    ----------
    robot : Robot
        Whose file is the template.
    parameters : mapping
        Standard parameters by name (``platform.mx``, ``slider1.Fv`` …).
    path : str or Path
        ``.xml`` for MJCF, ``.urdf`` for URDF. In the template's format everything but the numbers
        stays; the other one is written anew, without geometry.
    keep : bool
        Whether parameters that are not given keep the file's values; else joints have none.
    shapes : mapping, optional
        Shapes of effects by ``<joint>.<effect>``; by default those that the robot has.
    reference : mapping, optional
        Standard parameters by which loads are known; by default those that the robot has.

    Raises
    ------
    RobotError
        If a parameter is of nothing that the robot has, the format cannot hold the robot or a body
        has no mass.
    OutputError
        If the files cannot be written, or the sidecar's name is taken by something else.
    """
    path = Path(path)
    robot, parameters = settle_gravity(robot, parameters)
    if path.suffix.lower() in (".xml", ".urdf") and (path.suffix.lower() == ".urdf") == robot.mjcf:
        with temporary_folder() as folder:  # the same robot in the other format is the template
            beside = Path(folder) / f"{path.stem}{path.suffix.lower()}"
            write_twin(robot, beside)
            twin = replace(Robot.load(beside), rest=robot.rest).turned(robot.gravity)
            shapes = robot.shapes if shapes is None else shapes
            reference = robot.reference if reference is None else reference
            whole = complete_values(robot, parameters, keep=keep)
            return write_parameters(
                twin, whole, path, keep=False, shapes=shapes, reference=reference
            )
    motors = () if robot.transmission is None else robot.transmission.motors
    known = (*robot.bodies, *robot.dofs, *motors, *robot.combinations, BASE)
    for name in parameters:
        owner = name.rpartition(".")[0]
        if owner not in known:
            raise RobotError(
                f"'{name}' is of no body, joint, motor or axis of {robot.name}"
                f"{near_match(owner, known)}"
            )
    robot, values = settle_springs(robot, complete_values(robot, parameters, keep=keep))
    alone = read_back(robot, values)
    nominal = {n: v for n, v in values.items() if v != alone.get(n, 0.0)}
    tables = {
        "nominal": nominal,
        "shapes": robot.shapes if shapes is None else shapes,
        "reference": robot.reference if reference is None else reference,
        "rest": {} if robot.mjcf else _rests(robot, values),
    }
    bodies = {b: np.array([values[f"{b}.{kind}"] for kind in INERTIAL_KINDS]) for b in robot.bodies}
    sidecar = write_robot(robot, path, bodies, stated_numbers(robot, values), tables)
    parts = robot.inertia_parts if robot.mjcf else ()
    summed = {f"{joint}.{part}" for joint in robot.tree.single for part in parts}
    lost = tuple(name for name in nominal if name not in summed)  # the file has a rotor's sum
    return Written(Path(path), sidecar, lost)


def _rests(robot: Robot, values: Mapping[str, float]) -> dict[str, float]:
    """Return where the springs of joints are relaxed; those of stated axes stand with them."""
    joints = robot.tree.single
    return {j: x for j, x in robot.rest.items() if j in joints and values.get(f"{j}.K")}
