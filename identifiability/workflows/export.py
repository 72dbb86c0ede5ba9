"""Write the feasible standard parameters of a result into the robot file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from identifiability.effects import FAMILIES
from identifiability.effects.holding import complete_values, read_back, stated_numbers
from identifiability.effects.nominal import reference_values
from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import IdentifiabilityError, RobotError, listing, near_match
from identifiability.foundation.names import BASE, INERTIAL, INERTIAL_KINDS
from identifiability.foundation.options import FilePath, checked
from identifiability.foundation.values import frozen
from identifiability.physical.mass import state_mass
from identifiability.physical.pseudo_inertia import check_body
from identifiability.robot import Robot, RobotLike
from identifiability.robot.write import write_robot


class _Entry(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class RobotEntry(_Entry):
    """What the result is about."""

    name: str
    locked: dict[str, float] = {}


class PhysicalEntry(_Entry):
    """The nearest real robot."""

    parameters: dict[str, float]
    shapes: dict[str, float] = {}
    error_ra: float | None
    error_ra_file: float | None
    cad_prior: float = 0.0
    certificate: str = ""
    sentence: str = ""
    reason: str = ""


class Result(_Entry):
    """The part of a result that is exported."""

    robot: RobotEntry
    physical: PhysicalEntry
    nothing: str | None = None


@frozen(kw_only=True)
class Exported:
    """What was exported.

    Attributes
    ----------
    robot : Path
    sidecar : Path or None
    beside : mapping
        What the robot file cannot hold and the sidecar does: parameters by effect.
    error_ra, error_ra_file : float or None
        ε_RA on the fitted logs of all that was fitted, and of what the robot file alone holds;
        None where the torque does not vary.
    mass : str
        What is wrong with the total mass, and the remedy; empty if nothing is.
    """

    robot: Path
    sidecar: Path | None
    beside: Mapping[str, tuple[str, ...]]
    error_ra: float | None
    error_ra_file: float | None
    mass: str

    @property
    def statement(self) -> str:
        """What the files hold, in words."""
        parts = []
        if self.beside:
            held = [f"{effect} ({listing(n, 4)})" for effect, n in self.beside.items()]
            stand = "it stands" if len(held) == 1 else "they stand"
            parts.append(
                f"{self.robot.name} cannot hold {listing(held, len(held))}: {stand} in the "
                "sidecar, which simulators do not read."
            )
        if self.error_ra is not None and self.error_ra_file is not None:
            parts.append(
                f"On the fitted logs the real robot errs by {100 * self.error_ra:.3g} %, and what "
                f"{self.robot.name} alone holds by {100 * self.error_ra_file:.3g} %."
            )
        return " ".join(parts)


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
        ``.xml`` for MJCF, ``.urdf`` for URDF, as the template.
    keep : bool
        Whether parameters that are not given keep the file's values; else joints have none.
    shapes : mapping, optional
        Shapes of effects by ``<joint>.<effect>``; by default those that the robot has.
    reference : mapping, optional
        Standard parameters by which loads are known; by default those that the robot has.

    Raises
    ------
    RobotError
        If a parameter is of nothing that the robot has, the format differs from the template's or a
        body has no mass.
    OutputError
        If the files cannot be written, or the sidecar's name is taken by something else.
    """
    motors = () if robot.transmission is None else robot.transmission.motors
    known = (*robot.bodies, *robot.dofs, *motors, *robot.combinations, BASE)
    for name in parameters:
        owner = name.rpartition(".")[0]
        if owner not in known:
            raise RobotError(
                f"'{name}' is of no body, joint, motor or axis of {robot.name}"
                f"{near_match(owner, known)}"
            )
    values = complete_values(robot, parameters, keep=keep)
    alone = read_back(robot, values)
    nominal = {n: v for n, v in values.items() if v != alone.get(n, 0.0)}
    tables = {
        "nominal": nominal,
        "shapes": robot.shapes if shapes is None else shapes,
        "reference": robot.reference if reference is None else reference,
    }
    bodies = {b: np.array([values[f"{b}.{kind}"] for kind in INERTIAL_KINDS]) for b in robot.bodies}
    sidecar = write_robot(robot, path, bodies, stated_numbers(robot, values), tables)
    parts = robot.inertia_parts if robot.mjcf else ()
    summed = {f"{joint}.{part}" for joint in robot.tree.single for part in parts}
    lost = tuple(name for name in nominal if name not in summed)  # the file has a rotor's sum
    return Written(Path(path), sidecar, lost)


@checked
def export(robot: RobotLike, result: FilePath, out: FilePath) -> Exported:
    """Write the nearest real robot of a JSON result as a robot file, and a sidecar if it needs one.

    Parameters
    ----------
    robot : Robot, path or shipped name
        The robot that the result is about.
    result : path
        JSON of `analyze`, `prune` or `diagnose`.
    out : path
        ``.xml`` for MJCF, ``.urdf`` for URDF, as the robot's own file.

    Raises
    ------
    IdentifiabilityError
        If the file is no result, one of another robot, or has no masses.
    """
    robot = robot if isinstance(robot, Robot) else Robot.load(robot)
    content = read_document(result, Result, "JSON", "result", IdentifiabilityError)
    if content.nothing:
        raise IdentifiabilityError(
            f"Nothing can be exported, because {content.nothing} ({result}); give a result of "
            "other logs."
        )
    physical = content.physical
    families = reversed(FAMILIES.values())  # of two with the same parameter the first has it
    effect_of = {p.name: f for f in families for p in f.effect.parameters(robot)}
    _check(robot, Path(result), content, {*effect_of, *robot.nominal})
    given = physical.parameters
    loaded = any(value and n in effect_of and effect_of[n].loaded for n, value in given.items())
    reference = reference_values(robot) if loaded else {}
    shapes = physical.shapes
    written = write_parameters(robot, given, out, keep=False, shapes=shapes, reference=reference)
    beside: dict[str, list[str]] = {}
    for name in written.beside:
        if name not in effect_of and name[:-1] in written.beside:
            continue  # one way of a level that both have
        title = effect_of[name].title if name in effect_of else name
        beside.setdefault(title, []).append(name)
    return Exported(
        robot=written.robot,
        sidecar=written.sidecar,
        beside={title: tuple(names) for title, names in beside.items()},
        error_ra=physical.error_ra,
        error_ra_file=physical.error_ra_file,
        mass=state_mass(robot, given, physical.cad_prior),
    )


def _check(robot: Robot, path: Path, content: Result, known: set[str]) -> None:
    given = content.physical.parameters
    if content.robot.locked.keys() != robot.locked.keys():
        was = ", ".join(f"{n} = {at:g}" for n, at in content.robot.locked.items()) or "nothing"
        raise IdentifiabilityError(
            f"{path} was made with {was} locked, and now {listing(robot.locked) or 'nothing'} is; "
            "lock the same joints (--lock, or 'locked' in the sidecar)."
        )
    for name in given:
        if name not in known:
            raise IdentifiabilityError(
                f"{path} is about '{content.robot.name}' and has the parameter '{name}', which "
                f"{robot.name} does not have{near_match(name, known)} Give the robot that the "
                "result was made with."
            )
    if not given:
        entry = content.physical
        why = entry.reason or entry.certificate or entry.sentence
        raise IdentifiabilityError(f"{path} holds no real robot to export. {why}".rstrip())
    missing = [body for body in robot.bodies if f"{body}.m" not in given]
    if missing:
        raise IdentifiabilityError(
            f"{path} has no mass of {listing(missing)}, and a robot file needs one of every body: "
            "make a result whose model has the effect rigid_body."
        )
    whole = complete_values(robot, given, keep=False)
    for body in robot.bodies:
        check = check_body(np.array([whole[f"{body}.{kind}"] for kind in INERTIAL]), body)
        if not check.feasible:
            raise IdentifiabilityError(
                f"{path}: {check.reason} It was found with the other values kept: make the result "
                "without --fixed."
            )
