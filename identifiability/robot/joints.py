"""Take the joints off a Pinocchio model, for the batched kinematics."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.errors import RobotError
from identifiability.robot.kinematics import WORLD, Joint, Tree

_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


def read_tree(path: Path, model: Any, root: ET.Element) -> tuple[Tree, dict[int, int]]:
    """Return the joints of a Pinocchio model; a composite joint becomes one joint an axis.

    Also return where each Pinocchio joint ends among them: loop points refer to that index.
    """
    joints: list[Joint] = []
    last = {0: WORLD}
    for index in range(1, model.njoints):
        whole = model.joints[index]
        placement = model.jointPlacements[index]
        parts, places = [whole], [placement]
        if whole.shortname() == "JointModelComposite":
            inner = whole.extract()
            parts = list(inner.joints)
            places = [placement * inner.jointPlacements[0], *list(inner.jointPlacements)[1:]]
        names = _dof_names(model, index, len(parts), root)
        parent = last[model.parents[index]]
        iq, iv = whole.idx_q, whole.idx_v
        for part, place, name in zip(parts, places, names, strict=True):
            joint = _read_joint(path, part, place, name, parent, iq, iv)
            joints.append(joint)
            parent = len(joints) - 1
            iq, iv = iq + joint.nq, iv + joint.nv
        last[index] = parent
    return Tree(tuple(joints)), last


def _dof_names(model: Any, index: int, count: int, root: ET.Element) -> list[str]:
    """Return the file's names of the joints in a Pinocchio joint."""
    if count == 1:
        return [model.names[index]]
    body = next(
        f.name for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == index
    )
    element = next(b for b in root.iter("body") if b.get("name") == body)
    named = [j.get("name") for j in element.findall("joint")]
    return [n or f"{body}_{k + 1}" for k, n in enumerate(named)]


def _read_joint(
    path: Path, part: Any, place: Any, name: str, parent: int, iq: int, iv: int
) -> Joint:
    kind = part.shortname().removeprefix("JointModel")
    R, p = np.array(place.rotation), np.array(place.translation)
    axis, unbounded = np.zeros(3), False
    if kind in ("RX", "RY", "RZ", "PX", "PY", "PZ"):
        axis = np.array(_AXES[kind[1]])
        type_ = "revolute" if kind[0] == "R" else "prismatic"
    elif kind in ("RUBX", "RUBY", "RUBZ"):
        axis, type_, unbounded = np.array(_AXES[kind[3]]), "revolute", True
    elif kind in ("RevoluteUnaligned", "RevoluteUnboundedUnaligned", "PrismaticUnaligned"):
        inner = part.extract() if hasattr(part, "extract") else part
        axis = np.array(inner.axis)
        type_ = "prismatic" if kind.startswith("P") else "revolute"
        unbounded = "Unbounded" in kind
    elif kind == "Spherical":
        type_ = "ball"
    elif kind == "FreeFlyer":
        type_ = "free"
    else:
        raise RobotError(
            f"{path}: joint '{name}' is of a type ({kind}) that is not supported; use hinge, "
            "slide, ball or free joints."
        )
    if type_ in ("revolute", "prismatic") and not abs(np.linalg.norm(axis) - 1) < 1e-6:
        raise RobotError(f"{path}: joint '{name}' has no axis; give one that is not all zero.")
    dofs = {
        "ball": tuple(f"{name}.{k}" for k in ("rx", "ry", "rz")),
        "free": tuple(f"{name}.{k}" for k in ("tx", "ty", "tz", "rx", "ry", "rz")),
    }.get(type_, (name,))
    return Joint(dofs, type_, parent, R, p, axis, iq, iv, unbounded)  # type: ignore[arg-type]
