"""The sidecar of a robot that is written in the other format.

What is locked is one body with its host there. An MJCF states home, motors and loops itself; a URDF
does not.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.robot import twin_mjcf, twin_urdf
from identifiability.robot.bound import Bound
from identifiability.robot.description import Description
from identifiability.robot.kinematics import WORLD
from identifiability.robot.parts import Coupling
from identifiability.robot.twin_parts import ends_of, stated_in_file

#: Keys that are written anew.
_ANEW = ("locked", "massless", "loops", "couplings", "axes", "actuated", "home", "rest")


def twin_sidecar(robot: Description, path: Path) -> dict[str, Any]:
    """Return what stands in the sidecar of a robot that is written to another path.

    Raises
    ------
    RobotError
        If it cannot say a coupling or a bound.
    """
    text = robot.sidecar.read_text(encoding="utf-8-sig") if robot.sidecar is not None else ""
    given = {k: v for k, v in tomllib.loads(text).items() if k not in _ANEW}
    given = _without(given, {*robot.locked, *robot.welded})
    new: dict[str, Any] = {}
    mjcf = path.suffix == ".xml"
    if not mjcf:
        new["actuated"] = list(robot.joints)
        new["massless"] = list(twin_urdf.links_between(robot).values())
        if robot.home.any():
            places = {name: j.iq for name, j in robot.tree.single.items()}
            new["home"] = {name: float(robot.home[at]) for name, at in places.items()}
    whole = all(len(loop.axes) == 3 for loop in robot.loops)
    ground = twin_mjcf.GROUND if mjcf else twin_urdf.ground_of(robot)
    new["loops"] = [] if mjcf and whole else _loops(robot, ground)
    most = twin_mjcf.MOST if mjcf else twin_urdf.MOST
    left = [c for c in robot.couplings if not stated_in_file(c, most)]
    new["couplings"] = [_coupling(robot, c) for c in left]
    new["axes"] = [_axis(robot, name) for name in robot.combinations]
    if "bounds" in given:
        given["bounds"] = {**given["bounds"], "bodies": _bounds(robot)}
    return {**{k: v for k, v in new.items() if v}, **given}


def _without(given: dict[str, Any], gone: Collection[str]) -> dict[str, Any]:
    """Return a sidecar without what is said of joints and bodies that are gone."""
    kept = _pruned(given, gone)
    kept["symmetry"] = [
        {**entry, "tie": {k: v for k, v in entry["tie"].items() if not _any_of(v, gone)}}
        for entry in given.get("symmetry", [])
    ]
    kept["known_torque"] = [
        entry for entry in given.get("known_torque", []) if entry["along"] not in gone
    ]
    kept["effects"] = [
        text for text in given.get("effects", []) if text.partition("@")[2] not in gone
    ]
    return {key: value for key, value in kept.items() if value or key in given}


def _any_of(names: list[str], gone: Collection[str]) -> bool:
    return any(name.rpartition(".")[0] in gone for name in names)


def _pruned(value: Any, gone: Collection[str]) -> Any:
    if isinstance(value, dict):
        left = {k: v for k, v in value.items() if k not in gone}
        return {k: _pruned(v, gone) for k, v in left.items() if k.rpartition(".")[0] not in gone}
    if isinstance(value, list):
        return [_pruned(v, gone) for v in value if not (isinstance(v, str) and v in gone)]
    return value


def _loops(robot: Description, ground: str) -> list[dict[str, Any]]:
    out = []
    for loop, ends in zip(robot.loops, ends_of(robot, ground), strict=True):
        entry: dict[str, Any] = {"name": loop.name}
        for k, (body, point) in enumerate(ends, 1):
            entry |= {f"body{k}": body, f"point{k}": point.tolist()}
        if len(loop.axes) < 3:
            entry["axes"] = ["xyz"[axis] for axis in loop.axes]
        if loop.frame is not None:
            if not np.allclose(loop.frame.rotation, np.eye(3), atol=1e-9):
                raise RobotError(
                    f"The frame of '{loop.frame.body}' in {robot.path} is turned against "
                    f"its joint, so the axes of the loop '{loop.name}' cannot be said in the other "
                    "format: export it in its own, or as JSON."
                )
            entry |= {} if loop.frame.joint == WORLD else {"frame": loop.frame.body}
        out.append(entry)
    return out


def _coupling(robot: Description, coupling: Coupling) -> dict[str, Any]:
    """Return a coupling as the sidecar says it: a polynomial of each joint.

    Raises
    ------
    RobotError
        If it has one of a sum of joints.
    """
    entry: dict[str, Any] = {"joint": coupling.joint, "polynomial": list(coupling.polynomial)}
    terms: dict[str, Any] = {}
    for term in coupling.more:
        poly = np.polynomial.Polynomial(term.polynomial).trim()
        if (len(term.weights) > 1 and poly.degree() > 1) or terms.keys() & term.weights.keys():
            raise RobotError(
                f"A sidecar cannot hold how '{coupling.joint}' of {robot.path} is coupled to "
                "several joints: export it in its own format, or as JSON."
            )
        for k, (joint, weight) in enumerate(term.weights.items()):
            own = poly(np.polynomial.Polynomial([0.0, weight])) - (poly(0.0) if k else 0.0)
            terms[joint] = own.coef.tolist()
    if coupling.of is not None:
        entry["of"] = coupling.of
    return {**entry, "terms": terms} if terms else entry


def _axis(robot: Description, name: str) -> dict[str, Any]:
    rest = {"rest": robot.rest[name]} if name in robot.rest else {}
    return {"name": name, "joints": dict(robot.combinations[name]), **rest}


def _bounds(robot: Description) -> dict[str, Any]:
    """Return what is known of bodies in the frames of their joints, which are the new file's."""
    out: dict[str, Any] = {}
    for bound in (b for b in robot.bounds if len(b.bodies) == 1):
        entry: dict[str, Any] = {} if bound.mass is None else {"mass": list(bound.mass)}
        _check_turn(robot, bound)
        if bound.box is not None:
            spans = zip(bound.box, bound.origin.tolist(), strict=True)
            entry["box"] = [[low + at, high + at] for (low, high), at in spans]
        if bound.ellipsoid is not None:
            centre = (np.array(bound.ellipsoid.centre) + bound.origin).tolist()
            entry["ellipsoid"] = {"centre": centre, "radii": list(bound.ellipsoid.radii)}
        out[bound.bodies[0]] = entry
    return out


def _check_turn(robot: Description, bound: Bound) -> None:
    turned = not np.allclose(bound.rotation, np.eye(3), atol=1e-9)
    if turned and (bound.box is not None or bound.ellipsoid is not None):
        raise RobotError(
            f"The frame of '{bound.bodies[0]}' in {robot.path} is turned against its joint, so "
            "what [bounds] says of its centre cannot be said in the other format: take it out."
        )
