"""What a robot file holds of parameter values by itself, and what is read back from it.

MJCF holds masses (a payload is part of its body), viscous and Coulomb friction with one level for
both directions, the inertia of a rotor and a spring at each joint; URDF masses and friction.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.robot.description import Description

#: Kinds of Coulomb friction: one level for both directions, and one for each.
COULOMB = ("Fc", "Fc+", "Fc-")

#: Levels of both directions that differ by less, as a share, are one: a solver rounded them.
ROUNDING = 1e-9


def file_joints(robot: Description) -> Iterator[str]:
    """Yield the joints of one degree of freedom: those with parameters in a robot file."""
    for joint in robot.tree.joints:
        if joint.nv == 1:
            yield joint.dofs[0]


def complete_values(
    robot: Description, given: Mapping[str, float], *, keep: bool = True
) -> dict[str, float]:
    """Return all nominal values of a robot that has some other ones.

    Payloads become part of their bodies, and every Coulomb level stands there as one for both
    directions and as one for each.

    Parameters
    ----------
    robot : Description
    given : mapping
    keep : bool
        Whether joints keep what is not given.
    """
    bodies = {f"{body}.{kind}" for body in robot.bodies for kind in INERTIAL_KINDS}
    values = {n: v for n, v in robot.nominal.items() if keep or n in bodies} | dict(given)
    for body in robot.bodies:
        for kind in INERTIAL_KINDS:
            values[f"{body}.{kind}"] += values.pop(f"{body}.payload_{kind}", 0.0)
    for owner in {name.rpartition(".")[0] for name in values if name.endswith(".Fc")} | {
        name.rpartition(".")[0] for name in given if name.endswith((".Fc+", ".Fc-"))
    }:
        both, *ways = (f"{owner}.{kind}" for kind in COULOMB)
        level = values.get(both, 0.0)
        alone = both in given and not any(way in given for way in ways)
        for way in ways:
            values[way] = level if alone else values.get(way, level)
        values[both] = 0.5 * sum(values[way] for way in ways)
        if all(abs(values[way] - values[both]) <= ROUNDING * abs(values[both]) for way in ways):
            values |= dict.fromkeys(ways, values[both])
    return values


def rotor_inertia(robot: Description, values: Mapping[str, float], joint: str) -> float:
    """Return the inertia of all parts of a joint's rotor."""
    return sum(values.get(f"{joint}.{part}", 0.0) for part in robot.inertia_parts)


def read_back(robot: Description, values: Mapping[str, float]) -> dict[str, float]:
    """Return the nominal values that are read from a file with these ones, without a sidecar."""
    out = {f"{b}.{kind}": values[f"{b}.{kind}"] for b in robot.bodies for kind in INERTIAL_KINDS}
    for joint in file_joints(robot):
        out[f"{joint}.Fv"] = values.get(f"{joint}.Fv", 0.0)
        out |= {f"{joint}.{kind}": values.get(f"{joint}.Fc", 0.0) for kind in COULOMB}
        out |= {f"{joint}.{part}": 0.0 for part in robot.inertia_parts}
        if robot.mjcf:
            out[f"{joint}.{robot.inertia_parts[0]}"] = rotor_inertia(robot, values, joint)
            out[f"{joint}.K"] = values.get(f"{joint}.K", 0.0)
    return out
