"""Read robot files: MJCF as MuJoCo compiles it, URDF through Pinocchio.

A URDF needs links without mass between the axes of one joint for a universal joint.
"""

import copy
import os
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import find_named
from identifiability.foundation.options import Root, Side
from identifiability.foundation.quoting import for_toml
from identifiability.foundation.values import Fields

from .assembly import LockOption, assemble, check_magnitudes, read_locks, resolve_locks
from .description import Coupling, Description, Stated
from .floating import BASE_JOINTS, Base, find_legs
from .kinematics import WORLD, Tree, body_names, read_tree, weld
from .locate import find_sidecar, locate_robot, read_markup
from .sidecar import Sidecar, check_known, read_sidecar
from .write import numbers, root_link, urdf_joint


def _find_massless(path: Path, model: Any, massless: Collection[str]) -> set[int]:
    """Return the joints before links without mass, which a universal joint needs in a URDF.

    Raises
    ------
    RobotError
        If a link is not there, has a mass, or does not carry exactly one joint.
    """
    bodies = body_names(model)
    check_known(path, "massless", massless, bodies)
    gone = {bodies.index(link) + 1 for link in massless}
    for k in gone:
        mass = float(model.inertias[k].mass)
        carried = list(model.parents).count(k)
        if mass > TINY or carried != 1 or model.joints[k].nv != 1:
            raise RobotError(
                f"The sidecar of {path}: 'massless' names '{bodies[k - 1]}', which has a mass of "
                f"{mass:g} kg and carries {carried} joints; it is for links without mass that "
                "carry one."
            )
    return gone


# Read robot files: MJCF as MuJoCo compiles it, URDF through Pinocchio.


def read_robot(
    source: str | Path,
    sidecar: str | Path | None,
    lock: LockOption | None,
    base: Root | None,
    torque_side: Side | None,
) -> Description:
    """Read a robot; see `Robot.load`."""
    path = locate_robot(source)
    chosen = Path(sidecar) if sidecar is not None else find_sidecar(path)
    extra = read_sidecar(chosen)
    given = read_locks(lock)
    extra = extra.model_copy(update={"locked": read_locks(extra.locked) | given})
    extra = extra if base is None else extra.model_copy(update={"base": base})
    stated_torque = extra.torque
    if torque_side is not None:
        torque = extra.torque.model_copy(update={"side": torque_side})
        extra = extra.model_copy(update={"torque": torque})
    root = read_markup(path)
    if root.tag == "mujoco":  # who has a URDF does not wait for MuJoCo
        from .mjcf import state_robot  # noqa: PLC0415

        stated = state_robot(path, extra)
    else:
        stated = _read_urdf(path, root, extra)
    check_magnitudes(path, stated)
    robot = assemble(path, chosen, extra, stated)
    named = {name for text in given for name in find_named(text, robot.locked)}
    option = tuple(name for name in robot.locked if name in named)
    said = robot.said.model_copy(update={"torque": stated_torque})
    return replace(robot, lock_option=option, base_option=base, said=said)


def _read_urdf(path: Path, root: Element, extra: Sidecar) -> Stated:
    """Return the statements of a URDF, with mimic joints as couplings and locked joints welded."""
    if root.find("link") is None:
        raise RobotError(
            f"{path} has no <link>; it may only define parts that another file puts together: "
            "give that file, after xacro has expanded it."
        )
    root, top = release_root(root, extra.base)
    model = _build_model(path, _add_base(root) if top else root)
    if extra.base is None and not top and not extra.loops:
        _ask_for_base(path, model)
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    fixed = {name for name, joint in joints.items() if joint.get("type") == "fixed"}
    drawn = {model.names[j]: 0.0 for j in range(1, model.njoints) if model.joints[j].nv == 1}
    mimics = _read_mimics(path, joints, fixed, extra)
    locked, couplings = resolve_locks(path, extra, drawn, mimics, fixed)
    listed = sorted(drawn, key=partial(_place_of, model, [*joints]))
    model, welded = weld(model, locked)
    gone = _find_massless(path, model, (*extra.massless, *(_BETWEEN if top else ())))
    for k in gone:
        model.inertias[k] = pin.Inertia.Zero()
    base = Base("", top, np.array(model.gravity.linear)) if top else None
    if top:  # gravity is part of the acceleration that is measured on a floating base
        model.gravity.linear = np.zeros(3)
    tree = read_tree(path, model)
    coupled = {c.joint for c in couplings}
    carriers = tuple(k for k in range(1, model.njoints) if k not in gone)
    home = np.array(pin.neutral(model))
    driven = [name for name in listed if name in tree.single and name not in coupled]
    return Stated(
        model=model,
        tree=tree,
        carriers=carriers,
        couplings=tuple(couplings),
        home=home,
        driven=driven,
        listed=tuple(listed),
        locked=locked,
        welded=welded,
        base=base,
        **_read_limits(model, tree),
    )


def _place_of(model: Any, listed: Sequence[str], name: str) -> list[int]:
    """Return where the file lists a joint, behind those that carry it.

    A file may list a chain from its tip. The parser sorts siblings by name, and the file does not.
    """
    at = model.getJointId(name)
    places = list[int]()
    while at > 0:
        carrier = model.names[at]
        places.insert(0, listed.index(carrier) if carrier in listed else -1)
        at = model.parents[at]
    return places


def _build_model(path: Path, root: Element) -> Any:
    """Return the Pinocchio model of a URDF.

    Raises
    ------
    RobotError
        If it cannot be read. A link whose inertia is misspelt is read without any, but printed.
    """
    reason = ""
    with _printed_errors() as printed:
        try:
            model = pin.buildModelFromXML(plain_urdf(root, path.stem))
        except Exception as error:  # noqa: BLE001 - a foreign parser may raise anything
            text = str(error).rpartition("message:")[2]  # Pinocchio puts its source file before it
            reason = " ".join(text.split()).rstrip(".") or type(error).__name__
    for said in (*printed, *filter(None, [reason])):
        raise RobotError(f"{path} cannot be read as URDF: {said[:300]}.")
    return model


def _read_mimics(
    path: Path, joints: Mapping[str, Element], fixed: Collection[str], extra: Sidecar
) -> list[Coupling]:
    """Return the mimic joints of a URDF as couplings.

    Raises
    ------
    RobotError
        If one mimics a missing joint, and the sidecar does not replace it.
    """
    instead = {*extra.locked, *(c.joint for c in extra.couplings)}
    found = []
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is None or name in fixed:
            continue
        of = mimic.get("joint", "")
        others = [n for n in joints if n != name]
        if of in others:
            slope = float(mimic.get("multiplier", 1.0))
            offset = float(mimic.get("offset", 0.0))
            found.append(Coupling(name, name, offset, {of: (0.0, slope)}))
        elif name not in instead:
            raise RobotError(
                f"{path}: joint '{name}' mimics '{of}', but no other joint has that name"
                f"{near_match(of, others)} Correct the file, or state [[couplings]] "
                f"in the sidecar, or lock the joint (locked = {for_toml([name])})."
            )
    return found


def _read_limits(model: Any, tree: Tree) -> Fields:
    """Return limits, damping and dry friction of the joints with one axis, as `Stated` has them."""
    joints = tree.single.items()
    low = model.lowerPositionLimit
    high = model.upperPositionLimit
    friction = np.nan_to_num(model.upperDryFrictionLimit, posinf=0.0)
    spans = {name: (float(low[j.iq]), float(high[j.iq])) for name, j in joints}
    speeds = {name: float(model.velocityLimit[j.iv]) for name, j in joints}
    numbers = {
        name: {"damping": float(model.damping[j.iv]), "frictionloss": float(friction[j.iv])}
        for name, j in joints
    }
    return {
        "spans": spans,
        "speeds": speeds,
        "numbers": numbers,
    }


#: Name of a root link that means the world: links that are fixed to it are bolted down.
WORLD_LINK = "world"


def release_root(root: Element, base: str | None) -> tuple[Element, str]:
    """Return a URDF whose root is the floating link, if any, and the name of its support.

    The support is the joint of type ``floating`` that carries the rest, or the root link itself if
    `base` is "floating". If `base` is "fixed", nothing floats. If the root link is ``world``, the
    link that is fixed to it floats instead.

    Parameters
    ----------
    root : Element
    base : {"fixed", "floating"} or None
    """
    root, top = copy.deepcopy(root), root_link(root)
    parents = ((joint, joint.find("parent")) for joint in root.findall("joint"))
    first = [joint for joint, end in parents if end is not None and end.get("link") == top]
    kind = first[0].get("type") if len(first) == 1 else ""
    if kind == "fixed" and top == WORLD_LINK and base == "floating":
        kind = "floating"
    if kind != "floating":
        return root, top if base == "floating" else ""
    carrier = first[0]
    if base == "fixed":
        carrier.set("type", "fixed")
        return root, ""
    root.remove(carrier)
    links = root.findall("link")
    root.remove(next(link for link in links if link.get("name") == top))
    return root, carrier.get("name", "")


#: Links without mass between the joints of a base that floats.
_BETWEEN = tuple(f"{joint} link" for joint in BASE_JOINTS[:-1])


def _add_base(root: Element) -> Element:
    """Return a URDF with three slides and three hinges before the root link."""
    made = copy.deepcopy(root)
    above = "world of the base"
    first = root_link(root)
    ET.SubElement(made, "link", name=above)
    for k, (joint, below) in enumerate(zip(BASE_JOINTS, (*_BETWEEN, first), strict=True)):
        if below != first:
            ET.SubElement(made, "link", name=below)
        kind = ("revolute", "prismatic")[k < 3]
        own = urdf_joint(made, joint, kind, above, below, pin.SE3.Identity())
        ET.SubElement(own, "axis", xyz=numbers(np.eye(3)[k % 3]))
        above = below
    return made


def _ask_for_base(path: Path, model: Any) -> None:
    """Refuse a legged robot with a free root link: it may walk, or be bolted down.

    Raises
    ------
    RobotError
    """
    root = next(f.name for f in model.frames if f.type == pin.FrameType.BODY)
    if root == WORLD_LINK:
        return
    parents = [parent - 1 for parent in [*model.parents][1:]]
    bodies = body_names(model)
    on_root = {body for body, parent in zip(bodies, parents, strict=True) if parent == WORLD}
    legs = [leg for leg in find_legs([*model.names[1:]], bodies, parents) if leg in on_root]
    if len(legs) > 1 and model.inertias[0].mass:
        raise RobotError(
            f"{path}: its root link '{root}' hangs on nothing and carries the legs "
            f"{listing(legs, 4)}, so it may walk. State in "
            f'{path.with_suffix(".toml").name} how it was measured: base = "fixed" if it was '
            'bolted down or hung up, base = "floating" if it stood on its own feet.'
        )


#: Parts of a URDF that identification needs: elements by their parent element.
_NEEDED = {
    "robot": ("link", "joint"),
    "link": ("inertial",),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic"),
}


def _keep_needed(root: Element) -> Element:
    """Return a copy of a URDF without visuals, collisions and parts for simulators."""
    bare = Element(root.tag, root.attrib)
    for part in root:
        if part.tag in _NEEDED["robot"]:
            kept = ET.SubElement(bare, part.tag, part.attrib)
            kept.extend(copy.deepcopy(child) for child in part if child.tag in _NEEDED[part.tag])
    return bare


def plain_urdf(root: Element, name: str) -> str:
    """Return a URDF with the parts that identification needs; continuous joints become revolute.

    Pinocchio represents a continuous joint by cosine and sine, which do not count turns, but mimic
    joints follow a position. Visuals, collisions and parts for simulators are left out. A name,
    limits and an effort are added, because Pinocchio's reader demands them.
    """
    plain = _keep_needed(root)
    plain.set("name", root.get("name") or name)
    for joint in plain.findall("joint"):
        kind = joint.get("type")
        limit = joint.find("limit")
        if kind not in ("continuous", "revolute", "prismatic"):
            continue
        endless = kind == "continuous" or limit is None
        limit = ET.SubElement(joint, "limit") if limit is None else limit
        none = {"effort": "0", "velocity": "0", "lower": "-1e9", "upper": "1e9"}
        for k, (word, text) in enumerate(none.items()):
            said = limit.get(word, "" if k > 1 else "inf")
            if "inf" in said.lower() or (endless and k > 1):
                limit.set(word, text)
        if kind == "continuous":
            joint.set("type", "revolute")
    return ET.tostring(plain, encoding="unicode")


@contextmanager
def _printed_errors() -> Iterator[list[str]]:
    """Collect the errors that a C++ library prints instead of raising them."""
    found: list[str] = []
    with tempfile.TemporaryFile() as file:
        sys.stderr.flush()
        kept = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield found
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            marked = (line.partition("Error:") for line in lines)
            found += [" ".join(text.split()).rstrip(".") for _, mark, text in marked if mark]
