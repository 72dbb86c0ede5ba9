"""Write parameters back into a robot file: inertials, friction, rotors, springs.

The file is parsed and written as XML; everything but the numbers stays. What a format cannot hold
(rotor inertia in URDF, friction of coupled motors, asymmetric Coulomb levels, offsets, Stribeck
friction …) is put into a sidecar where the library reads it back, and is listed for the user.
"""

from __future__ import annotations

import json
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import OutputError, RobotError, listing, near_match
from identifiability.foundation.names import BASE, INERTIAL_KINDS, Array
from identifiability.foundation.output import write_together
from identifiability.foundation.values import frozen
from identifiability.robot.description import Description
from identifiability.robot.holding import complete_values, file_joints, read_back, rotor_inertia
from identifiability.robot.markup import read_markup
from identifiability.robot.mjcf_text import clear_mjcf, in_radians, numbers, write_inertial
from identifiability.robot.sidecar import read_sidecar


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


def write_robot(
    robot: Description,
    parameters: Mapping[str, float],
    path: str | Path,
    *,
    keep: bool = True,
    shapes: Mapping[str, float] | None = None,
    reference: Mapping[str, float] | None = None,
) -> Written:
    """Write a robot file with other parameters, and its sidecar: both or none.

    Parameters
    ----------
    robot : Description
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
        If the format differs from the template's or a body has no mass.
    OutputError
        If the files cannot be written, or the sidecar's name is taken by something else.
    """
    path = Path(path)
    top, mjcf = _template(robot), robot.mjcf
    if (path.suffix.lower() == ".urdf") == mjcf:
        raise RobotError(
            f"'{path}' asks for {'URDF' if mjcf else 'MJCF'}, but {robot.path} is "
            f"{'MJCF' if mjcf else 'URDF'}; give a file name ending in "
            f"{'.xml' if mjcf else '.urdf'}."
        )
    _check_owners(robot, parameters)
    values = complete_values(robot, parameters, keep=keep)
    for index, body in enumerate(robot.bodies):
        theta = np.array([values[f"{body}.{kind}"] for kind in INERTIAL_KINDS])
        _write_body(top, robot, index, theta, mjcf=mjcf)
    _write_joints(top, robot, values)
    if mjcf:
        clear_mjcf(top)
    ET.indent(top)
    text = ET.tostring(top, encoding="unicode") + "\n"
    alone = read_back(robot, values)
    nominal = {n: v for n, v in values.items() if v != alone.get(n, 0.0)}
    beside = path.with_suffix(".toml")
    tables = {
        "nominal": nominal,
        "shapes": robot.shapes if shapes is None else shapes,
        "reference": robot.reference if reference is None else reference,
    }
    stated = _sidecar_text(robot, tables)
    _check_beside(robot, beside, path, needed=stated is not None)
    pair = [] if stated is None else [(beside, stated.encode())]
    write_together([*pair, (path, text.encode())])
    summed = {f"{j}.{part}" for j in file_joints(robot) for part in robot.inertia_parts if mjcf}
    lost = tuple(name for name in nominal if name not in summed)  # the file has a rotor's sum
    return Written(path, None if stated is None else beside, lost)


def _check_owners(robot: Description, parameters: Mapping[str, float]) -> None:
    """Refuse a parameter of what the robot does not have."""
    motors = () if robot.transmission is None else robot.transmission.motors
    known = (*robot.bodies, *robot.dofs, *motors, BASE)
    for name in parameters:
        owner = name.rpartition(".")[0]
        if owner not in known:
            raise RobotError(
                f"'{name}' is of no body, joint or motor of {robot.name}{near_match(owner, known)}"
            )


def _template(robot: Description) -> ET.Element:
    """Return the robot file's root, with its comments, or with its includes if it has any."""
    builder = ET.TreeBuilder(insert_comments=True)
    top: ET.Element = ET.parse(robot.path, parser=ET.XMLParser(target=builder)).getroot()
    if any(e.tag == "include" for e in top.iter()):
        top = read_markup(robot.path)
    if any(e.tag == "replicate" for e in top.iter()):
        raise RobotError(
            f"{robot.path} uses <replicate>, whose copies have no place in the file to write "
            "parameters to; write them out as bodies."
        )
    named = {e.get("name") for e in top.iter() if e.tag in ("joint", "freejoint")}
    single = {d for j in robot.tree.joints if j.nv == 1 for d in j.dofs}
    bodies = {e.get("name") for e in top.iter() if e.tag in ("body", "link")}
    for what, missing in (("joint", single - named), ("body", set(robot.bodies) - bodies)):
        if missing:
            raise RobotError(
                f"{robot.path} has a {what} without a name, so parameters cannot be written to it; "
                f"name every <{what}>."
            )
    return top


def _write_body(
    top: ET.Element, robot: Description, index: int, theta: Array, *, mjcf: bool
) -> None:
    """Write ten parameters of the body behind a joint, given in the joint's frame."""
    body = robot.bodies[index]
    mass, first = float(theta[0]), theta[1:4]
    if mass <= 0:
        raise RobotError(
            f"The body '{body}' has a mass of {mass:.3g} kg; a robot file needs a positive one: "
            "export a physically feasible result."
        )
    centre = first / mass
    xx, xy, yy, xz, yz, zz = theta[4:]
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia = about_origin - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    # The library's frame is the joint's; the file's may be shifted or turned against it.
    frame = robot.model.frames[robot.model.getFrameId(body, pin.FrameType.BODY)].placement
    R, p = np.array(frame.rotation), np.array(frame.translation)
    centre, inertia = R.T @ (centre - p), R.T @ inertia @ R
    if mjcf:
        write_inertial(top, body, mass, centre, inertia)
    else:
        _write_urdf_inertial(top, robot, index, mass, centre, inertia)


def _write_urdf_inertial(
    top: ET.Element, robot: Description, index: int, mass: float, centre: Array, inertia: Array
) -> None:
    body = robot.bodies[index]
    element = next(link for link in top.findall("link") if link.get("name") == body)
    for old in element.findall("inertial"):
        element.remove(old)
    new = ET.SubElement(element, "inertial")
    ET.SubElement(new, "origin", xyz=numbers(centre), rpy="0 0 0")
    ET.SubElement(new, "mass", value=f"{mass:.17g}")
    names = {
        "ixx": (0, 0),
        "ixy": (0, 1),
        "ixz": (0, 2),
        "iyy": (1, 1),
        "iyz": (1, 2),
        "izz": (2, 2),
    }
    ET.SubElement(new, "inertia", {n: f"{inertia[i, j]:.17g}" for n, (i, j) in names.items()})
    for frame in robot.model.frames:  # links that are fixed to this one are part of it now
        attached = frame.type == pin.FrameType.BODY and frame.parentJoint == index + 1
        if attached and frame.name != body:
            for link in top.findall("link"):
                if link.get("name") == frame.name:
                    for old in link.findall("inertial"):
                        link.remove(old)


def _write_joints(top: ET.Element, robot: Description, values: Mapping[str, float]) -> None:
    """Write friction, rotors and springs of every joint; what is not there is written as zero."""
    home, degrees = robot.home[None], robot.mjcf and not in_radians(top)
    joints = {e.get("name"): e for e in top.iter("joint")}
    for name in file_joints(robot):
        joint = joints[name]
        viscous, friction = (values.get(f"{name}.{kind}", 0.0) for kind in ("Fv", "Fc"))
        if not robot.mjcf:
            for old in joint.findall("dynamics"):
                joint.remove(old)
            ET.SubElement(joint, "dynamics", damping=f"{viscous:.17g}", friction=f"{friction:.17g}")
            continue
        stiffness = values.get(f"{name}.K", 0.0)
        joint.set("damping", f"{viscous:.17g}")
        joint.set("frictionloss", f"{friction:.17g}")
        joint.set("armature", f"{rotor_inertia(robot, values, name):.17g}")
        if stiffness or joint.get("stiffness"):
            rest = robot.rest.get(name, float(robot.dof_position(home, name)[0]))
            turned = not robot.is_prismatic(robot.dof_index(name))
            joint.set("stiffness", f"{stiffness:.17g}")
            joint.set("springref", f"{np.degrees(rest) if turned and degrees else rest:.17g}")


_MEANING = {
    "nominal": "parameters that the robot file cannot hold",
    "shapes": "Stribeck velocities and periods of the effects",
    "reference": "values by which the loads of effects are known",
}


def _sidecar_text(robot: Description, tables: Mapping[str, Mapping[str, float]]) -> str | None:
    """Return the template's sidecar with other tables of numbers, or None if none is needed.

    Raises
    ------
    RobotError
        If one of them does not stand there in a table of its own.
    """
    if robot.sidecar is None and not any(tables.values()):
        return None
    given = robot.sidecar.read_text(encoding="utf-8-sig") if robot.sidecar is not None else ""
    heads = {f"[{key}]" for key in tables}
    lines, skipping = [], False
    for line in given.splitlines():
        if line.strip().startswith("["):
            skipping = line.strip().split("#")[0].strip() in heads
        if not skipping:
            lines.append(line)
    for key, table in tables.items():
        lines += ["", f"[{key}]  # {_MEANING[key]}"] if table else []
        lines += [f"{json.dumps(name)} = {float(value)!r}" for name, value in table.items()]
    text = "\n".join(lines).strip() + "\n"
    wanted = {k: v for k, v in tomllib.loads(given).items() if k not in tables}
    wanted |= {key: dict(table) for key, table in tables.items() if table}
    try:
        same = tomllib.loads(text) == wanted
    except tomllib.TOMLDecodeError:
        same = False
    if not same:  # written inline or with dotted keys
        named = [f"[{key}]" for key in tables if key in tomllib.loads(given)]
        raise RobotError(
            f"{robot.sidecar} does not state {listing(named)} as a table of its own, so it cannot "
            "be replaced; write it so."
        )
    return text


def _check_beside(robot: Description, beside: Path, path: Path, *, needed: bool) -> None:
    """Refuse a sidecar that would replace another kind of file, or pair up with this robot."""
    if not beside.exists():
        return
    own = robot.sidecar is not None and beside.resolve() == robot.sidecar.resolve()
    if own and path.resolve() != robot.path.resolve():
        raise OutputError(
            f"'{beside}' is the sidecar of {robot.path} and would be replaced by that of '{path}'; "
            "give another name."
        )
    if not needed:
        raise OutputError(
            f"'{beside}' would be read as the sidecar of '{path}', which has none; give another "
            "name, or move it away."
        )
    try:
        read_sidecar(beside)
    except RobotError:
        raise OutputError(
            f"'{beside}' is no sidecar, but that of '{path}' must have its name; give another name."
        ) from None
