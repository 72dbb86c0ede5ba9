"""What a sidecar says of masses and centres of mass, body by body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import find_named, is_pattern
from identifiability.robot.bound import Bound, Ellipsoid
from identifiability.robot.parts import Stated
from identifiability.robot.sidecar import BodyBoundsEntry, BoundsEntry


def read_bounds(
    path: Path, entry: BoundsEntry, bodies: tuple[str, ...], stated: Stated
) -> tuple[Bound, ...]:
    """Return the bounds of a robot.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    entry : BoundsEntry
    bodies : tuple of str
        The moving bodies.
    stated : Stated

    Raises
    ------
    RobotError
        If a body is not there, or the masses of bodies contradict the total one.
    """
    known: dict[str, BodyBoundsEntry] = {}
    for text in sorted(entry.bodies, key=is_pattern, reverse=True):  # a name says more
        named = find_named(text, bodies)
        if not named and text not in stated.welded:
            raise RobotError(
                f"The sidecar of {path}: [bounds.bodies] names '{text}', which is no moving body"
                f"{near_match(text, bodies)} Known: {listing(bodies)}."
            )
        known |= dict.fromkeys(named, entry.bodies[text])
    bounds = [_of_body(body, known[body], stated) for body in bodies if body in known]
    if entry.total_mass is None:
        return tuple(bounds)
    spans = [known[body].mass if body in known else None for body in bodies]
    least = sum(span[0] for span in spans if span is not None)
    most = sum(np.inf if span is None else span[1] for span in spans)
    low, high = entry.total_mass
    if least >= high or most <= low:
        raise RobotError(
            f"The sidecar of {path}: [bounds] says that the total mass is {low:g} … {high:g} kg, "
            f"and that of its bodies is {least:g} … {most:g} kg; widen one of them."
        )
    return (*bounds, Bound(bodies, entry.total_mass))


def _of_body(body: str, entry: BodyBoundsEntry, stated: Stated) -> Bound:
    frames = [f for f in stated.model.frames if f.type == pin.FrameType.BODY and f.name == body]
    place = frames[0].placement if frames else pin.SE3.Identity()
    ellipsoid = entry.ellipsoid
    return Bound(
        (body,),
        entry.mass,
        entry.box,
        None if ellipsoid is None else Ellipsoid(ellipsoid.centre, ellipsoid.radii),
        np.array(place.rotation),
        np.array(place.translation),
    )
