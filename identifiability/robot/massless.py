"""Links without mass between the axes of one joint, which a URDF needs for a universal joint."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, near_match
from identifiability.robot.joints import body_names

#: Simulators refuse links without any mass: this one is none [kg].
PLACEHOLDER = 1e-12


def merge_axes(
    path: Path, model: Any, massless: Collection[str]
) -> tuple[Any, dict[int, tuple[str, ...]]]:
    """Return a Pinocchio model in which links without mass are part of the joint behind them.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    model : pinocchio.Model
        With joints of one axis before these links.
    massless : collection of str

    Returns
    -------
    model : pinocchio.Model
    names : dict
        Joints of the file in each joint of several axes.

    Raises
    ------
    RobotError
        If a link is not there, has a mass, or does not carry exactly one joint.
    """
    if not massless:
        return model, {}
    bodies = body_names(model)
    for link in massless:
        _check(path, model, bodies, link)
    gone = {k for k in range(1, model.njoints) if bodies[k - 1] in massless}
    out = pin.Model()
    out.name, out.gravity = model.name, model.gravity
    index, names, parts = {0: 0}, {}, []
    for k in range(1, model.njoints):
        parts.append(k)
        if k in gone:  # the joint that it carries comes next
            continue
        joint, above = model.joints[k], index[model.parents[parts[0]]]
        if len(parts) > 1:
            joint = pin.JointModelComposite()
            for n, part in enumerate(parts):
                place = model.jointPlacements[part] if n else pin.SE3.Identity()
                joint.addJoint(model.joints[part], place)
        title = "+".join(model.names[part] for part in parts)
        index[k] = out.addJoint(above, joint, model.jointPlacements[parts[0]], title)
        if len(parts) > 1:
            names[index[k]] = tuple(model.names[part] for part in parts)
        out.appendBodyToJoint(index[k], model.inertias[k], pin.SE3.Identity())
        parts = []
    _copy_frames(model, out, index)
    for limits in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit", "damping",
                   "armature", "upperDryFrictionLimit", "lowerDryFrictionLimit"):  # fmt: skip
        setattr(out, limits, np.array(getattr(model, limits)))
    return out, names


def _check(path: Path, model: Any, bodies: tuple[str, ...], link: str) -> None:
    if link not in bodies:
        raise RobotError(
            f"The sidecar of {path}: 'massless' names '{link}', which is no moving link"
            f"{near_match(link, bodies)}"
        )
    index = bodies.index(link) + 1
    mass = float(model.inertias[index].mass)
    carried = [k for k in range(1, model.njoints) if model.parents[k] == index]
    if mass > PLACEHOLDER or len(carried) != 1 or model.joints[index].nv != 1:
        raise RobotError(
            f"The sidecar of {path}: 'massless' names '{link}', which has a mass of {mass:g} kg "
            f"and carries {len(carried)} joints; it is for links without mass that carry one."
        )


def _copy_frames(model: Any, out: Any, index: dict[int, int]) -> None:
    """Add the frames of a model to another one, but those of joints that are not there."""
    at = {0: 0}
    for k, frame in enumerate(model.frames):
        if not k or frame.parentJoint not in index:
            continue
        joint = index[frame.parentJoint]
        if frame.type == pin.FrameType.JOINT:
            at[k] = out.addJointFrame(joint)
            continue
        before = at.get(frame.parentFrame, 0)
        at[k] = out.addFrame(pin.Frame(frame.name, joint, before, frame.placement, frame.type))
