"""How near bodies of a robot that are not joined come to each other along a motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import Array
from identifiability.robot import Robot
from identifiability.robot.geometry import body_of, read_geometry

#: The search keeps bodies twice as far apart [m], and half of it is what a motion must keep at
#: every sample, so that nothing touches between samples either.
MARGIN = 0.01


@dataclass(frozen=True)
class Clearance:
    """The shapes of a robot's file, and the pairs of them that may not touch.

    Attributes
    ----------
    robot : Robot
    geometry : pinocchio.GeometryModel
    touching : tuple of str
        Pairs of bodies that touch at home already, and so are not watched.
    """

    robot: Robot
    geometry: Any
    touching: tuple[str, ...] = ()

    @staticmethod
    def of(robot: Robot) -> tuple[Clearance | None, str]:
        """Return what to watch, or why nothing is watched: a sentence."""
        end = "collisions were not looked for: look at the motion before the robot goes through it."
        if robot.cables:
            return None, f"{robot.path.name} has tendons that push, and {end}"
        try:
            shapes = read_geometry(robot)
        except RobotError as error:
            return None, f"{str(error).rstrip('.')}, so {end}"
        if len(shapes.geometryObjects) < 2:
            return None, f"{robot.path.name} has no shapes that can collide, so {end}"
        if not len(shapes.collisionPairs):
            return None, ""  # bodies are all joined to each other
        whole = Clearance(robot, shapes)
        home = whole._distances(robot.home)
        objects = shapes.geometryObjects
        pairs = [(p.first, p.second) for p in shapes.collisionPairs]
        bad = [pair for pair, d in zip(pairs, home, strict=True) if d < MARGIN]
        for first, second in bad:
            shapes.removeCollisionPair(pin.CollisionPair(first, second))
        names = [" and ".join(sorted(body_of(objects[k]) for k in pair)) for pair in bad]
        if not len(shapes.collisionPairs):
            return None, f"All bodies of {robot.name} touch at home, so {end}"
        return Clearance(robot, shapes, tuple(dict.fromkeys(names))), ""

    @property
    def pairs(self) -> int:
        """Pairs of shapes that are watched."""
        return len(self.geometry.collisionPairs)

    @property
    def said(self) -> str:
        """The sentence on what is not watched; empty if nothing is left out."""
        if not self.touching:
            return ""
        return (
            f"At home {listing(self.touching, 4)} are nearer than {1000 * MARGIN:g} mm already (as "
            "drawn), so collisions of these are not watched."
        )

    def gaps(self, q: Array) -> Array:
        """Return the least distance of any pair at configurations (N, nq), (N,) [m]; < 0 inside."""
        model, shapes = self.robot.model, self.geometry
        data, found = model.createData(), shapes.createData()
        out = np.empty(len(q))
        for k, row in enumerate(q):
            pin.computeDistances(model, data, shapes, found, row)
            out[k] = min(pair.min_distance for pair in found.distanceResults)
        return out

    def _distances(self, q: Array) -> list[float]:
        model, shapes = self.robot.model, self.geometry
        found = shapes.createData()
        pin.computeDistances(model, model.createData(), shapes, found, np.asarray(q, float))
        return [float(pair.min_distance) for pair in found.distanceResults]


def nearness(gaps: Array) -> Array:
    """Return what each sample costs: nothing from twice the margin on, 1 at contact."""
    near: Array = np.maximum(1.0 - np.asarray(gaps) / (2 * MARGIN), 0.0) ** 2
    return near
