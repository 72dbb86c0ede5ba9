"""Axes that are combinations of joints: stated in the sidecar, or tendons of the robot file."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.robot.parts import Combination, Stated
from identifiability.robot.sidecar import AxisEntry


def combine_joints(
    path: Path, entries: list[AxisEntry], stated: Stated, taken: Collection[str]
) -> Mapping[str, Combination]:
    """Return every combination of joints by its name; the sidecar goes before the robot file.

    What is locked has no part in them.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    entries : list of AxisEntry
    stated : Stated
    taken : collection of str
        Names of bodies, joints and motors, which no axis can have.

    Raises
    ------
    RobotError
        If a joint is not there or cannot be part of an axis, or a name is taken.
    """
    known = (*stated.tree.single, *stated.locked)
    found = dict(stated.combinations)
    for entry in entries:
        for joint in entry.joints:
            if joint not in known:
                raise RobotError(
                    f"The sidecar of {path}: the axis '{entry.name}' names the joint '{joint}', "
                    f"which does not turn or slide by itself{near_match(joint, known)} Known: "
                    f"{listing(known)}."
                )
        moving = {joint: c for joint, c in entry.joints.items() if joint not in stated.locked}
        if moving:
            found[entry.name] = _restated(found.get(entry.name), moving, entry.rest)
    for name in (*found, *(entry.name for entry in entries)):
        if name in taken:
            raise RobotError(
                f"{path}: the axis '{name}' has the name of a body, joint or motor, and parameters "
                "are named after it; give it another."
            )
    names = [entry.name for entry in entries]
    if len(set(names)) < len(names):
        raise RobotError(f"The sidecar of {path}: the axes are {listing(names)}; name each once.")
    return found


def _restated(
    stated: Combination | None, weights: Mapping[str, float], rest: float | None
) -> Combination:
    """Return an axis of the sidecar, with what the file says of a tendon of its name and course."""
    if stated is None or dict(stated.weights) != dict(weights):
        return Combination(weights, rest=rest)
    return Combination(weights, stated.numbers, stated.rest if rest is None else rest)


def motor_tendons(stated: Stated, motors: Collection[str]) -> tuple[Stated, dict[str, Combination]]:
    """Return what a file states without the tendons that have the names of motors, and these.

    An export writes what a motor that mixes joints has of its own as a tendon.
    """
    own = {name: c for name, c in stated.combinations.items() if name in motors}
    left = {name: c for name, c in stated.combinations.items() if name not in motors}
    return replace(stated, combinations=left), own
