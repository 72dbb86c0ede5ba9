"""Take the joints off a Pinocchio model, for the batched kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.robot.kinematics import WORLD, Joint, Tree


def read_tree(
    path: Path, model: Any, names: Mapping[int, tuple[str, ...]]
) -> tuple[Tree, dict[int, int]]:
    """Return the joints of a Pinocchio model; a composite joint becomes one joint an axis.

    Also return where each Pinocchio joint ends among them: loop points refer to that index.

    Parameters
    ----------
    path : Path
    model : pinocchio.Model
    names : mapping
        The file's names of the joints in each Pinocchio joint, where they are not its own.
    """
    joints: list[Joint] = []
    last = {0: WORLD}
    still = pin.neutral(model)
    for index in range(1, model.njoints):
        whole = model.joints[index]
        placement = model.jointPlacements[index]
        parts, places = [whole], [placement]
        if whole.shortname() == "JointModelComposite":
            inner = whole.extract()
            parts = list(inner.joints)
            places = [placement * inner.jointPlacements[0], *list(inner.jointPlacements)[1:]]
        parent = last[model.parents[index]]
        iq, iv = whole.idx_q, whole.idx_v
        named = names.get(index, (model.names[index],))
        for part, place, name in zip(parts, places, named, strict=True):
            joint = _read_joint(path, part, place, name, parent, (iq, iv), still)
            joints.append(joint)
            parent = len(joints) - 1
            iq, iv = iq + joint.nq, iv + joint.nv
        last[index] = parent
    return Tree(tuple(joints)), last


def _read_joint(
    path: Path, part: Any, place: Any, name: str, parent: int, at: tuple[int, int], still: Array
) -> Joint:
    kind = part.shortname().removeprefix("JointModel")
    R, p = np.array(place.rotation), np.array(place.translation)
    axis = np.zeros(3)
    if part.nv == 1 and kind[0] in "RP":
        type_ = "revolute" if kind[0] == "R" else "prismatic"
        data = part.createData()
        part.calc(data, still)
        axis = np.array(data.S).ravel()[3:] if kind[0] == "R" else np.array(data.S).ravel()[:3]
    elif kind == "Spherical":
        type_ = "ball"
    elif kind == "FreeFlyer":
        type_ = "free"
    else:
        raise RobotError(
            f"{path}: joint '{name}' is of a type ({kind}) that is not supported; use revolute, "
            "continuous, prismatic or fixed joints."
        )
    if part.nv == 1 and not abs(np.linalg.norm(axis) - 1) < 1e-6:
        raise RobotError(f"{path}: joint '{name}' has no axis; give one that is not all zero.")
    dofs = {
        "ball": tuple(f"{name}.{k}" for k in ("rx", "ry", "rz")),
        "free": tuple(f"{name}.{k}" for k in ("tx", "ty", "tz", "rx", "ry", "rz")),
    }.get(type_, (name,))
    return Joint(dofs, type_, parent, R, p, axis, *at)  # type: ignore[arg-type]


def body_names(model: Any) -> tuple[str, ...]:
    """Return the body behind each joint of a Pinocchio model."""
    names = []
    for index in range(1, model.njoints):
        frames = [
            f for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == index
        ]
        direct = [f for f in frames if model.frames[f.parentFrame].type == pin.FrameType.JOINT]
        names.append((direct or frames)[0].name if frames else model.names[index])
    return tuple(names)
