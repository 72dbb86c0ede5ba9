"""Write parameters back into a robot file: inertials, armature, damping, frictionloss.

The file is parsed and written as XML; everything but the numbers stays. What a format cannot hold
(rotor inertia in URDF, friction of coupled motors, asymmetric Coulomb levels) is put into a
sidecar where the library reads it back, and is listed for the user.
"""

from __future__ import annotations

import json
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from identifiability.errors import OutputError, RobotError
from identifiability.names import INERTIAL_KINDS, Array
from identifiability.output import write_together
from identifiability.robot.description import Robot
from identifiability.robot.markup import read_markup
from identifiability.robot.sidecar import read_sidecar

#: Rounding of a flat body's moments of inertia, relative to the largest.
FLAT = 1e-13


@dataclass(frozen=True)
class Written:
    """What was written.

    Attributes
    ----------
    robot : Path
    sidecar : Path or None
    left_out : tuple of str
        Parameters that neither file can hold.
    """

    robot: Path
    sidecar: Path | None
    left_out: tuple[str, ...]


def write_robot(robot: Robot, parameters: Mapping[str, float], path: str | Path) -> Written:
    """Write a robot file with other parameters, and its sidecar: both or none.

    Parameters
    ----------
    robot : Robot
        Whose file is the template.
    parameters : mapping
        Standard parameters by name (``platform.mx``, ``slider1.Fv`` …); the others keep the
        file's values.
    path : str or Path
        ``.xml`` for MJCF, ``.urdf`` for URDF, as the template.

    Raises
    ------
    RobotError
        If the format differs from the template's or a body has no mass.
    OutputError
        If the files cannot be written, or the sidecar's name is taken by something else.
    """
    path = Path(path)
    top = _template(robot)
    mjcf = top.tag == "mujoco"
    if (path.suffix.lower() == ".urdf") == mjcf:
        raise RobotError(
            f"'{path}' asks for {'URDF' if mjcf else 'MJCF'}, but {robot.path} is "
            f"{'MJCF' if mjcf else 'URDF'}; give a file name ending in "
            f"{'.xml' if mjcf else '.urdf'}."
        )
    values = {**robot.nominal, **parameters}
    for index, body in enumerate(robot.bodies):
        theta = np.array([values[f"{body}.{kind}"] for kind in INERTIAL_KINDS])
        _write_body(top, robot, index, theta, mjcf=mjcf)
    extra, left_out = _write_joints(top, robot, values, parameters, mjcf=mjcf)
    ET.indent(top)
    text = ET.tostring(top, encoding="unicode") + "\n"
    beside = path.with_suffix(".toml")
    stated = _sidecar_text(robot, extra)
    _check_beside(robot, beside, path, needed=stated is not None)
    pair = [] if stated is None else [(beside, stated.encode())]
    write_together([*pair, (path, text.encode())])
    return Written(path, None if stated is None else beside, tuple(left_out))


def _template(robot: Robot) -> ET.Element:
    """Return the robot file's root, with its comments, or with its includes if it has any."""
    builder = ET.TreeBuilder(insert_comments=True)
    top: ET.Element = ET.parse(robot.path, parser=ET.XMLParser(target=builder)).getroot()
    if any(e.tag == "include" for e in top.iter()):
        top = read_markup(robot.path)
    named = {e.get("name") for e in top.iter() if e.tag in ("joint", "freejoint")}
    single = {d for j in robot.tree.joints if j.nv == 1 for d in j.dofs}
    if single - named:
        raise RobotError(
            f"{robot.path} has joints without a name, so parameters cannot be written to them; "
            "name every <joint>."
        )
    return top


def _write_body(top: ET.Element, robot: Robot, index: int, theta: Array, *, mjcf: bool) -> None:
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
        _write_mjcf_inertial(top, body, mass, centre, inertia)
    else:
        _write_urdf_inertial(top, robot, index, mass, centre, inertia)


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.17g}" for v in values)


def _write_mjcf_inertial(
    top: ET.Element, body: str, mass: float, centre: Array, inertia: Array
) -> None:
    element = next(b for b in top.iter("body") if b.get("name") == body)
    for old in element.findall("inertial"):
        element.remove(old)
    new = ET.Element("inertial", mass=f"{mass:.17g}", pos=_numbers(centre))
    moments, axes = np.linalg.eigh(inertia)
    lack = moments[2] - moments[0] - moments[1]
    if abs(lack) < FLAT * moments[2]:  # MuJoCo refuses a flat body that is a rounding too thin
        inertia = inertia + (FLAT * moments[2] + lack) * axes[:, :2] @ axes[:, :2].T
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    new.set("fullinertia", _numbers(np.array([inertia[i, j] for i, j in order])))
    after = [k for k, c in enumerate(element) if c.tag in ("joint", "freejoint")]
    element.insert(max(after, default=-1) + 1, new)
    for child in element.findall("body"):  # rigidly attached bodies are part of this one now
        if not (child.findall("joint") or child.findall("freejoint")):
            _strip_mjcf(child)
    for geom in element.findall("geom"):
        geom.set("mass", "0")
        geom.attrib.pop("density", None)


def _strip_mjcf(element: ET.Element) -> None:
    """Take the mass off a body that is fixed to its parent."""
    for part in element.findall("inertial"):
        element.remove(part)
    for geom in element.findall("geom"):
        geom.set("mass", "0")
    for child in element.findall("body"):
        if not (child.findall("joint") or child.findall("freejoint")):
            _strip_mjcf(child)


def _write_urdf_inertial(
    top: ET.Element, robot: Robot, index: int, mass: float, centre: Array, inertia: Array
) -> None:
    body = robot.bodies[index]
    element = next(link for link in top.findall("link") if link.get("name") == body)
    for old in element.findall("inertial"):
        element.remove(old)
    new = ET.SubElement(element, "inertial")
    ET.SubElement(new, "origin", xyz=_numbers(centre), rpy="0 0 0")
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


def _write_joints(
    top: ET.Element,
    robot: Robot,
    values: Mapping[str, float],
    given: Mapping[str, float],
    *,
    mjcf: bool,
) -> tuple[dict[str, float], list[str]]:
    """Write friction and rotor inertia; return what belongs into the sidecar, and what nowhere."""
    known: set[str] = {f"{b}.{kind}" for b in robot.bodies for kind in INERTIAL_KINDS}
    sidecar: dict[str, float] = {}
    for dof, name in enumerate(robot.dofs):
        if not any(j.iv == dof and j.nv == 1 for j in robot.tree.joints):
            continue
        inertia = sum(values.get(f"{name}.{part}", 0.0) for part in robot.inertia_parts)
        levels = [values.get(f"{name}.{kind}", 0.0) for kind in ("Fc", "Fc+", "Fc-")]
        if f"{name}.Fc" not in given and (f"{name}.Fc+" in given or f"{name}.Fc-" in given):
            levels[0] = 0.5 * (levels[1] + levels[2])
        elif f"{name}.Fc+" not in given:
            levels[1] = levels[2] = levels[0]
        joint = next(e for e in top.iter("joint") if e.get("name") == name)
        viscous = values.get(f"{name}.Fv", 0.0)
        if mjcf:
            joint.set("damping", f"{viscous:.17g}")
            joint.set("frictionloss", f"{levels[0]:.17g}")
            joint.set("armature", f"{inertia:.17g}")
        else:
            for old in joint.findall("dynamics"):
                joint.remove(old)
            ET.SubElement(
                joint, "dynamics", damping=f"{viscous:.17g}", friction=f"{levels[0]:.17g}"
            )
        known |= {f"{name}.{k}" for k in ("Fv", "Fc", "Fc+", "Fc-", *robot.inertia_parts)}
        if levels[1] != levels[0] or levels[2] != levels[0]:
            sidecar |= {f"{name}.Fc+": levels[1], f"{name}.Fc-": levels[2]}
        if not mjcf or len(robot.inertia_parts) > 1:
            parts = {f"{name}.{p}": values.get(f"{name}.{p}", 0.0) for p in robot.inertia_parts}
            sidecar |= {n: v for n, v in parts.items() if v}
    rest = {n: v for n, v in given.items() if n not in known}
    held = {
        f"{a.name}.{k}"
        for a in robot.axes
        for k in ("Fv", "Fc", "Fc+", "Fc-", *robot.inertia_parts)
    }
    sidecar |= {n: v for n, v in rest.items() if n in held}
    return sidecar, sorted(n for n, v in rest.items() if n not in held and v)


def _sidecar_text(robot: Robot, extra: Mapping[str, float]) -> str | None:
    """Return the template's sidecar with other nominal values, or None if none is needed.

    Raises
    ------
    RobotError
        If the nominal values do not stand in a table of their own.
    """
    if robot.sidecar is None and not extra:
        return None
    given = robot.sidecar.read_text(encoding="utf-8-sig") if robot.sidecar is not None else ""
    lines, skipping = [], False
    for line in given.splitlines():
        if line.strip().startswith("["):
            skipping = line.strip().split("#")[0].strip() == "[nominal]"
        if not skipping:
            lines.append(line)
    if extra:
        lines += ["", "[nominal]  # parameters that the robot file cannot hold"]
        lines += [f"{json.dumps(name)} = {float(value)!r}" for name, value in extra.items()]
    text = "\n".join(lines).strip() + "\n"
    wanted = {k: v for k, v in tomllib.loads(given).items() if k != "nominal"}
    wanted |= {"nominal": dict(extra)} if extra else {}
    try:
        same = tomllib.loads(text) == wanted
    except tomllib.TOMLDecodeError:
        same = False
    if not same:  # written inline or with dotted keys
        raise RobotError(
            f"{robot.sidecar} does not state its nominal values as one table [nominal], so they "
            "cannot be replaced; write them so."
        )
    return text


def _check_beside(robot: Robot, beside: Path, path: Path, *, needed: bool) -> None:
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
