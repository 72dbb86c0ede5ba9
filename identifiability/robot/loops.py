"""Closures of a robot: points that coincide, joints that are coupled."""

from __future__ import annotations

from identifiability.foundation.values import frozen
from identifiability.robot.kinematics import Point


@frozen
class Loop:
    """A point closure: a point of one body coincides with a point of another.

    `axes` are the world directions in which the closure is demanded (a planar loop needs two);
    `stated` is the entry of a sidecar: bodies, and points in their frames.
    """

    name: str
    first: Point
    second: Point
    axes: tuple[int, ...] = (0, 1, 2)
    stated: tuple[tuple[str, tuple[float, ...]], tuple[str, tuple[float, ...]]] | None = None


@frozen
class Coupling:
    """A joint coupling ``q_joint = Σ c_k (q_of)^k`` (MJCF ``<joint>`` equality, URDF mimic)."""

    name: str
    joint: str
    of: str | None
    polynomial: tuple[float, ...]
