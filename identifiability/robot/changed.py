"""Robots that are changed in code: other numbers in a copy of the file, or another file.

A body's ten parameters come from its mass, centre and moments of inertia.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

from identifiability.foundation import handed
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.options import Expected
from identifiability.foundation.output import temporary_folder
from identifiability.foundation.rules import Tolerance
from identifiability.robot.description import Description
from identifiability.robot.locking import least_eigenvalue

# The ten parameters of a body from its mass, centre and moments of inertia.


Point = Annotated[Sequence[float] | np.ndarray, Expected("three numbers, x, y and z")]
Moments = Annotated[
    Sequence[float] | Sequence[Sequence[float]] | np.ndarray,
    Expected("three moments of inertia about the centre, or a symmetric (3, 3) of them"),
]

#: By how much of its largest number a body may fail to be possible; what rounding does.
ROUNDING: Tolerance = 1e-12


def ten_parameters(mass: float, centre: Point, inertia: Moments) -> Array:
    """Return the parameters of a body in the order of `INERTIAL_KINDS`, (10,).

    Parameters
    ----------
    mass : float [kg]
    centre : (3,) [m]
        Its centre of mass, in the frame of the joint that moves it.
    inertia : (3,) or (3, 3) [kg·m²]
        About the centre, along the axes of that frame.

    Raises
    ------
    RobotError
        If no real body has them.
    """
    c, about = np.asarray(centre, float), np.asarray(inertia, float)
    about = np.diag(about) if about.shape == (3,) else about
    given = [mass, *c.ravel(), *about.ravel()]
    if c.shape != (3,) or about.shape != (3, 3) or not np.isfinite(given).all():
        raise RobotError(
            "A body has a mass, a centre of three numbers and an inertia of three moments or a "
            "(3, 3) tensor about that centre; give finite numbers."
        )
    tensor = about + mass * (c @ c * np.eye(3) - np.outer(c, c))
    first = mass * c
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor
    theta = np.array([mass, *first, xx, xy, yy, xz, yz, zz])
    if not np.allclose(about, about.T, rtol=ROUNDING) or mass < 0 or not possible(theta):
        raise RobotError(
            f"No real body has a mass of {mass:g} kg and these moments of inertia about its "
            "centre: the largest is at most the sum of the others, and none is below zero."
        )
    return theta


def possible(theta: Array) -> bool:
    """Whether some real body has these ten parameters."""
    least: float = least_eigenvalue(theta)
    return least >= -ROUNDING * float(np.abs(theta).max())


# Robots that are changed in code: other numbers in a copy of the file, or another file.
#
# A robot is always a standard file, also one that is made in code: until it is saved it stands in
# a folder that goes with the program.


_NUMBERS = count()


@cache
def _shelf() -> TemporaryDirectory[str]:
    return temporary_folder()


def new_place(name: str, ending: str) -> Path:
    """Return a file of a folder of its own that is gone when the program ends."""
    folder = Path(_shelf().name) / str(next(_NUMBERS)) / name
    folder.mkdir(parents=True)
    return folder / f"{name}{ending}"


def write(robot: Any, values: Mapping[str, float], path: str | Path) -> Path:
    """Write a robot with other standard parameters; see `Robot.save`.

    Raises
    ------
    RobotError
        If the robot has no such parameter.
    """
    # What a file holds of friction, rotors and springs effects say, which stand above robots.
    written: Path = handed("save_robot")(robot, values, path)
    return written


def write_copy(robot: Any, values: Mapping[str, float]) -> Path:
    """Write a robot with other parameters where nobody looks, with the ladder beside it."""
    ending = ".xml" if robot.mjcf else ".urdf"
    path = new_place(robot.name, ending)
    if robot.path.stem == "robot":
        path = path.with_name(f"robot{ending}")
    write(robot, values, path)
    ladder = robot.path.with_name("ladder.toml")
    if ladder.is_file():
        shutil.copy(ladder, path.with_name("ladder.toml"))
    return path


def last_bodies(robot: Description) -> tuple[str, ...]:
    """Return the bodies that carry no other: where a load can hang."""
    parents = {int(robot.model.parents[k]) for k in range(1, robot.model.njoints)}
    return tuple(b for k, b in enumerate(robot.bodies) if k + 1 not in parents)


def body_of(robot: Description, body: str | None) -> str:
    """Return a body that is named, or the only one that carries no other.

    Raises
    ------
    RobotError
    """
    if body is None:
        last = last_bodies(robot)
        if len(last) > 1:
            raise RobotError(
                f"A load may hang on {listing(last, 8)} of {robot.name}; name its body."
            )
        return last[0]
    if body not in robot.bodies:
        raise RobotError(
            f"{robot.name} has no moving body '{body}'{near_match(body, robot.bodies)} Its bodies "
            f"are {listing(robot.bodies)}."
        )
    return body


def _stated(robot: Description, body: str) -> Array:
    return np.array([robot.nominal[f"{body}.{kind}"] for kind in INERTIAL_KINDS])


def _named(body: str, theta: Array) -> dict[str, float]:
    return {f"{body}.{k}": float(v) for k, v in zip(INERTIAL_KINDS, theta, strict=True)}


def other_body(
    robot: Description,
    body: str,
    mass: float | None,
    centre: Point | None,
    inertia: Moments | None,
) -> dict[str, float]:
    """Return the ten parameters of a body of which some things are different, by name."""
    theta = _stated(robot, body_of(robot, body))
    old = theta[0] if theta[0] > 0 else 1.0
    whole = float(theta[0]) if mass is None else float(mass)
    c = theta[1:4] / old if centre is None else np.asarray(centre, float)
    if inertia is None:  # the same shape: moments grow with the mass
        own = pin.Inertia.FromDynamicParameters(np.array([old, *theta[1:]]))
        inertia = own.inertia * whole / old
    return _named(body, ten_parameters(whole, c, inertia))


def loaded_body(
    robot: Description, body: str | None, mass: float, centre: Point, inertia: Moments
) -> dict[str, float]:
    """Return the ten parameters of a body with something fixed to it, by name."""
    name = body_of(robot, body)
    theta = _stated(robot, name) + ten_parameters(mass, centre, inertia)
    if not possible(theta):
        raise RobotError(f"{robot.name}: '{name}' with this load is no real body; check its file.")
    return _named(name, theta)
