"""`Limits`: how far, how fast and how hard the joints may move, and where bodies may be.

A limits file is TOML; every key is optional and replaces what the robot says::

    slider1 = {q = [0.62, 0.78], v = 0.16, a = 0.5}    # actuated joint [rad or m, per s, per s²]
    slider2 = {tau = 400, power = 150}                 # of its drive [N·m or N; W]

    [workspace.platform]                               # body: where one of its points may be [m]
    point = [0.2, 0.1, 0.0]                            # in the body's frame (default: its origin)
    z = [0.5, 0.9]                                     # world coordinates; x, y and z
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from identifiability.foundation.documents import first_problem, read_document
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.kinematics import Point
from identifiability.robot.sidecar import LimitEntry, Span
from identifiability.robot.speeds import stated_speeds

#: Condition number (1-norm) of the closure that an exciting motion stays below. Within their
#: limits the shipped robots stay below 130; above 1000 a configuration is called near-singular.
CLOSURE_BOUND = 300.0

#: Reach, speed and acceleration of joints without limits: (rotary [rad], sliding [m]), as those
#: of random trajectories.
ASSUMED = {"q": (1.0, 0.1), "v": (2.0, 0.3), "a": (10.0, 1.0)}


class BoxEntry(BaseModel):
    """Where a point of a body may be, in the world."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    x: Span | None = None
    y: Span | None = None
    z: Span | None = None


class LimitsFile(BaseModel):
    """The file; joints may stand at the top or in a table ``limits``."""

    model_config = ConfigDict(extra="forbid")

    limits: dict[str, LimitEntry] = {}
    workspace: dict[str, BoxEntry] = {}

    @model_validator(mode="before")
    @classmethod
    def _gather_joints(cls, content: Any) -> Any:
        if not isinstance(content, dict) or not isinstance(content.get("limits", {}), dict):
            return content
        joints = {k: v for k, v in content.items() if k not in ("limits", "workspace")}
        out = {"limits": {**content.get("limits", {}), **joints}}
        return out | ({"workspace": content["workspace"]} if "workspace" in content else {})


@frozen
class Box:
    """Where a point of a body may be: world coordinates between `low` and `high`, (3,) [m]."""

    body: str
    point: Point
    low: Array
    high: Array


def _endless() -> Array:
    return np.array(np.inf)


@frozen
class Limits:
    """Limits of the actuated joints and of the workspace.

    Attributes
    ----------
    joints : tuple of str
    low, high : (n,) [rad or m]
    speed, acceleration : (n,) [rad/s or m/s; rad/s² or m/s²]
    torque, power : (n,) [N·m or N; W]
        Of the drives; infinite where nobody stated them.
    boxes : tuple of Box
    closure_bound : float
        Largest condition number of the closure of a closed chain.
    assumed : tuple of str
        Limits that nobody stated, such as ``joint1.v``.
    """

    joints: tuple[str, ...]
    low: Array
    high: Array
    speed: Array
    acceleration: Array
    torque: Array = field(default_factory=_endless)
    power: Array = field(default_factory=_endless)
    boxes: tuple[Box, ...] = ()
    closure_bound: float = CLOSURE_BOUND
    assumed: tuple[str, ...] = ()

    @property
    def middle(self) -> Array:
        """Middle of the range, (n,) [rad or m]."""
        middle: Array = 0.5 * (self.low + self.high)
        return middle

    @property
    def half_range(self) -> Array:
        """Half the range, (n,) [rad or m]."""
        half: Array = 0.5 * (self.high - self.low)
        return half


def find_limits(
    robot: Robot, given: Limits | Mapping[str, Any] | str | Path | None = None
) -> Limits:
    """Return the limits of a robot, or those given where they replace them.

    Parameters
    ----------
    robot : Robot
    given : Limits, path, mapping or None
        A limits file, or what would stand in one.

    Raises
    ------
    RobotError
        If the file cannot be read, or names a joint or body that the robot does not have.
    """
    if isinstance(given, Limits):
        if given.joints != robot.joints or np.any(given.low >= given.high):
            raise RobotError(
                f"The limits are not those of {robot.name}: they must be rising and of its "
                f"actuated joints {listing(robot.joints)}, in this order."
            )
        return given
    source, entry = _read(given)
    _check_names(source, "joint", entry.limits, robot.joints)
    _check_names(source, "body", entry.workspace, robot.bodies)
    slides = np.array([int(robot.is_prismatic(int(k))) for k in robot.actuated])
    home = robot.actuated_positions(robot.home[None])[0]
    own = {"q": robot.limits, "v": stated_speeds(robot), "a": robot.acceleration_limits}
    filled, assumed = {}, []
    for kind, values in own.items():
        stated, likely = values.copy(), np.array(ASSUMED[kind])[slides]
        for name, limit in entry.limits.items():
            if getattr(limit, kind) is not None:
                stated[robot.joints.index(name)] = getattr(limit, kind)
        if kind == "q":
            likely = np.stack([home - likely, home + likely], 1)
        missing = ~np.isfinite(stated)
        filled[kind] = np.where(missing, likely, stated)
        gaps = zip(robot.joints, missing, strict=True)
        assumed += [f"{name}.{kind}" for name, gap in gaps if np.any(gap)]
    _check_rising(robot, filled["q"])
    low, high = filled["q"].T
    return Limits(
        joints=robot.joints,
        low=low,
        high=high,
        speed=filled["v"],
        acceleration=filled["a"],
        torque=_of_drives(robot, entry, "tau"),
        power=_of_drives(robot, entry, "power"),
        boxes=tuple(_box(robot, body, box) for body, box in entry.workspace.items()),
        assumed=tuple(assumed),
    )


def doubt_assumed(limits: Limits, logs: Mapping[str, tuple[Array, Array]]) -> Iterator[str]:
    """Give a sentence for assumed limits that the logs to start from go beyond.

    Parameters
    ----------
    limits : Limits
    logs : mapping
        Name of a log to the least and the largest position, velocity and acceleration, (3, n) each.
    """
    beyond: list[str] = []
    for name, (low, high) in logs.items():
        fast = np.maximum(-low[1], high[1])
        for k, joint in enumerate(limits.joints):
            if f"{joint}.v" in limits.assumed and fast[k] > limits.speed[k]:
                beyond.append(f"{joint} goes at {fast[k]:.3g} in {name} ({limits.speed[k]:.3g})")
            elif f"{joint}.q" in limits.assumed and (
                low[0, k] < limits.low[k] or high[0, k] > limits.high[k]
            ):
                span = f"{low[0, k]:.3g} … {high[0, k]:.3g}"
                room = f"{limits.low[k]:.3g} … {limits.high[k]:.3g}"
                beyond.append(f"{joint} moves over {span} in {name} ({room})")
    if beyond:
        yield (
            f"Limits that were assumed (in brackets) are too narrow: {listing(beyond, 4)}; state "
            "what the joints may do in the sidecar's [limits] or by --limits, or the motion found "
            "says less than it could."
        )


def _of_drives(robot: Robot, entry: LimitsFile, kind: str) -> Array:
    """Return a limit of the drives, (n,); infinite where it is not stated."""
    found = [getattr(entry.limits.get(name), kind, None) for name in robot.joints]
    return np.array([np.inf if x is None else x for x in found])


def _read(given: Mapping[str, Any] | str | Path | None) -> tuple[str, LimitsFile]:
    """Return where limits come from and what they are."""
    if given is None:
        return "", LimitsFile()
    if isinstance(given, (str, Path)):
        return str(given), read_document(given, LimitsFile, "TOML", "limits", RobotError)
    try:
        return "The limits", LimitsFile.model_validate(dict(given))
    except ValidationError as problem:
        raise RobotError(f"The limits: {first_problem(problem, LimitsFile)}") from None


def _check_names(source: str, what: str, given: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for name in given:
        if name not in known:
            raise RobotError(
                f"{source}: '{name}' is no {'actuated joint' if what == 'joint' else what} of the "
                f"robot{near_match(name, known)} Known are {listing(known)}."
            )


def _check_rising(robot: Robot, q: Array) -> None:
    for name, (low, high) in zip(robot.joints, q, strict=True):
        if not low < high:
            raise RobotError(
                f"The limits of {name} leave it no room: [{low:g}, {high:g}]; state both ends."
            )


def _box(robot: Robot, body: str, entry: BoxEntry) -> Box:
    whole = robot.model.joints[robot.bodies.index(body) + 1]
    end = whole.idx_v + whole.nv
    joint = next(k for k, j in enumerate(robot.tree.joints) if j.iv + j.nv == end)
    free = (-np.inf, np.inf)
    span = np.array([free if s is None else s for s in (entry.x, entry.y, entry.z)])
    return Box(body, Point(joint, np.array(entry.point)), span[:, 0], span[:, 1])
