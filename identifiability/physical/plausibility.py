"""Numbers of a robot file that no robot has: densities, sizes, millimetres, legs on a fixed base.

A body of some mass has a least inertia, that of a ball of the densest material. It is not larger
than the robot itself, and a robot is not lighter than thin air.
"""

from collections.abc import Iterator

import numpy as np

from identifiability.foundation.findings import Finding
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.robot import Robot
from identifiability.robot.floating import find_legs
from identifiability.robot.inertials import read_inertials
from identifiability.robot.kinematics import WORLD
from identifiability.robot.locate import read_markup

from .feasibility import check_bodies
from .pseudo_inertia import to_matrix
from .rules import RULES


def check_plausible(robot: Robot) -> Iterator[Finding]:
    """Yield the findings on implausible numbers of a robot file."""
    scale = [*find_millimetres(robot)]
    yield from scale or find_implausible_bodies(robot)
    yield from find_fixed_legs(robot)


def find_implausible_bodies(robot: Robot) -> Iterator[Finding]:
    """Yield bodies whose inertia is too small or too large for their mass and the robot's size."""
    largest = max(measure_reach(robot), 1.0)
    impossible = check_bodies(robot)
    dense = []
    wide = []
    for body in robot.bodies:
        theta = np.array([robot.nominal[f"{body}.{kind}"] for kind in GROUPED_KINDS])
        mass = float(theta[9])
        if mass <= 0 or body in (*robot.guessed, *impossible):
            continue
        spread = measure_spread(theta)
        if spread < least_spread(mass):
            dense.append(body)
        elif np.sqrt(spread / mass) > RULES.widest * largest:
            wide.append(body)
    name = robot.path.name
    stated = _quote_bodies(robot)
    if dense:
        yield Finding("dense", name, bodies=[stated[body] for body in dense])
    if wide:
        quoted = [stated[body] for body in wide]
        yield Finding("wide", name, bodies=quoted, reach=largest)


def _quote_bodies(robot: Robot) -> dict[str, str]:
    """Return each moving body with the numbers that its file states of it, if it states some."""
    inertials = read_inertials(read_markup(robot.path))
    stated = {x.body: f"{x.body} ({x.numbers})" for x in inertials}
    return {body: stated.get(body, body) for body in robot.bodies}


def measure_spread(theta: Array) -> float:
    """Return the second moment of a body about its centre of mass, ∫|r|² dm [kg·m²].

    Parameters
    ----------
    theta : (10,) [kg m², kg m, kg]
        In the order of `GROUPED_KINDS`, with a mass that is not zero.
    """
    mass = theta[9]
    first = theta[6:9]
    about_origin = float(np.trace(to_matrix(theta)[:3, :3]))
    return about_origin - float(first @ first) / float(mass)


def least_spread(mass: float) -> float:
    """Return the second moment of a ball of the densest material, 3/5 m r² [kg·m²].

    Parameters
    ----------
    mass : float [kg]
    """
    radius = (3.0 * mass / (4.0 * np.pi * RULES.densest)) ** (1 / 3)
    return float(0.6 * mass * radius**2)


def measure_reach(robot: Robot) -> float:
    """Return the longest way from a first joint along the joints behind it to a centre of mass [m].

    The robot's place in its world does not count.
    """
    ways = np.zeros(len(robot.tree.joints))
    for k, joint in enumerate(robot.tree.joints):
        if joint.parent != WORLD:
            ways[k] = ways[joint.parent] + np.linalg.norm(joint.translation)
    reach = float(ways.max(initial=0.0))
    for body, carrier in zip(robot.bodies, robot.carriers, strict=True):
        mass = robot.nominal[f"{body}.m"]
        first = [robot.nominal[f"{body}.m{axis}"] for axis in "xyz"]
        if mass > 0:
            distance = np.linalg.norm(first) / mass
            reach = max(reach, float(ways[carrier - 1] + distance))
    return reach


def find_millimetres(robot: Robot) -> Iterator[Finding]:
    """Yield that lengths seem to be millimetres: in metres the robot weighs less than thin air."""
    masses = sum(robot.nominal[f"{body}.m"] for body in robot.bodies)
    reach = measure_reach(robot)
    if reach > 0 and (masses or 1.0) / reach**3 <= RULES.lightest:
        yield Finding("millimetres", robot.path.name, reach=reach, mass=masses)


def find_fixed_legs(robot: Robot) -> Iterator[Finding]:
    """Yield legs that hang on a base which the file, and nobody else, holds still."""
    if robot.base is not None or robot.said.base is not None or robot.closed:
        return
    joints = [robot.tree.joints[link.first].dofs[0] for link in robot.links]
    legs = find_legs(joints, robot.bodies, [link.parent for link in robot.links])
    if len(legs) > 1:
        yield Finding("legs", robot.path.name, legs=legs)
