"""Every parameter that a model of a robot can have, by name, and the values that its file holds."""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Literal

from identifiability.foundation.names import BASE, INERTIAL_KINDS, NumberByName, Parameter, Strings
from identifiability.robot import Robot
from identifiability.robot.description import FIELDS, name_numbers

from .effect import AlongAxes, Family
from .friction import complete_coulomb_levels
from .inertia import Payload
from .registry import FAMILIES

# Values of a model's parameters that a robot file holds, as their effects state them.
#
# Masses (a payload is part of its body), where gravity points, and at each joint viscous and
# Coulomb friction with one level for both directions; an MJCF also has the inertia of a rotor, a
# spring with its rest, which a spring of unknown rest is too where it pulls back, and, as the bias
# of an actuator, a torque offset, so that its dry friction may differ between the directions.


#: The formats of robot files, and the actuators of Isaac Lab with the bodies of a robot file.
Kind = Literal["mjcf", "urdf", "isaaclab"]

#: Effects of the measurement of a log, which no robot has.
MISREADS = ("torque_scale", "time_delay", "clock_error", "encoder_bias")


def file_kinds(robot: Robot) -> tuple[Kind, Kind]:
    """Return the format of a robot's own file, and the other one."""
    if robot.mjcf:
        return "mjcf", "urdf"
    return "urdf", "mjcf"


def joint_numbers(kind: Kind) -> Strings:
    """Return the attributes that a file format can state of a joint with one degree of freedom."""
    every = ("damping", "frictionloss", "armature", "stiffness")
    counts = {"mjcf": 4, "urdf": 2, "isaaclab": 3}
    return every[: counts[kind]]


def biased_places(robot: Robot, kind: Kind) -> Strings:
    """Return the joints or actuators with a torque offset in a file format."""
    if kind != "mjcf":
        return ()
    if robot.mjcf:
        return tuple(robot.offsets)
    return robot.motor_joints


@lru_cache(maxsize=8)
def _stated(robot: Robot, families: tuple[Family, ...], kind: Kind) -> tuple[Parameter, ...]:
    """Return the parameters that a file of a robot can state."""
    axes = {*robot.tree.single, *(robot.mixed_axes if kind == "mjcf" else ())}
    # A body, a joint and the base may have one name.
    inertial = product(robot.bodies, INERTIAL_KINDS)
    of_axes = product(axes, joint_numbers(kind))
    biased = axes & {*biased_places(robot, kind)}
    stated = {
        (BASE, "gravity"),
        *inertial,
        *of_axes,
        *product(biased, ("offset",)),
    }
    every = (p for family in families for p in family.effect.parameters(robot))
    return tuple(p for p in every if (p.owner, p.stated_as) in stated)


def values_in_file(
    robot: Robot, values: NumberByName, kind: Kind | None = None
) -> dict[str, float]:
    """Return the values that a robot file of a format keeps.

    Parameters
    ----------
    robot : Robot
        Whose file is written.
    values : mapping
        By name.
    kind : {"mjcf", "urdf"}, optional
        Format of the file; by default that of the robot's own.
    """
    kind = kind or file_kinds(robot)[0]
    stated = {p.name for p in _stated(robot, tuple(FAMILIES.values()), kind)}
    if "stiffness" in joint_numbers(kind):
        stated |= values.keys() - merge_springs(robot, values)[1].keys()
    out = {name: value if name in stated else 0.0 for name, value in values.items()}
    held = biased_places(robot, kind)
    for joint in (*robot.tree.single, *(robot.mixed_axes if kind == "mjcf" else ())):
        ways = [f"{joint}.{kind}" for kind in ("Fc+", "Fc-") if f"{joint}.{kind}" in values]
        mean = 0.5 * sum(values[name] for name in ways)
        out |= {name: values[name] if joint in held else mean for name in ways}
    return out


def values_not_in_file(robot: Robot, values: NumberByName, kind: Kind) -> dict[str, float]:
    """Return the parts of values that a file of a format cannot hold, without faults of sensors."""
    held = values_in_file(robot, values, kind)
    faults = {p.name for family in MISREADS for p in FAMILIES[family].effect.parameters(robot)}
    lost = {n: x - held[n] for n, x in values.items() if n not in faults}
    return {n: x for n, x in lost.items() if x}


def file_values(robot: Robot, values: NumberByName) -> list[dict[str, float]]:
    """Return the values that each file format can store, that of the robot first."""
    return [values_in_file(robot, values, kind) for kind in file_kinds(robot)]


def merge_springs(robot: Robot, values: NumberByName) -> tuple[Robot, dict[str, float]]:
    """Return robot and values with springs of unknown rest as files state them: K and a rest.

    With a spring, a constant force or a torque offset shifts the rest position: so it stays when
    actuators are exchanged. A spring that pushes away is none that a file states, and neither is a
    constant force alone.

    Parameters
    ----------
    robot : Robot
    values : mapping
        By name.
    """
    out = dict(values)
    rest = dict(robot.rest)
    lengths = {cable.name for cable in robot.cables}
    for place in (*robot.tree.single, *robot.tendons):
        stated = out.get(f"{place}.K", 0.0)
        k = out.get(f"{place}.k", 0.0)
        force = out.get(f"{place}.F0", 0.0) + out.get(f"{place}.off", 0.0)
        if not (k or force) or not stated + k > 0:
            continue
        start = rest[place] if place in rest else _home(robot, place)
        relaxed = (stated * start + out.get(f"{place}.kq0", 0.0) - force) / (stated + k)
        if place in lengths and relaxed < 0:
            continue
        out[f"{place}.K"] = stated + k
        rest[place] = relaxed
        for kind in ("k", "kq0", "F0", "off"):
            out.pop(f"{place}.{kind}", None)
    return replace(robot, rest=rest), out


def convert_asymmetry(robot: Robot, values: NumberByName) -> dict[str, float]:
    """Return values with dry friction that differs by direction as its mean and a torque offset.

    So it is where the file of the robot has an actuator that holds one. At rest, too: between
    −Fc− and Fc+ lies the offset ± the mean.
    """
    out = dict(values)
    for place in biased_places(robot, file_kinds(robot)[0]):
        ways = [f"{place}.{kind}" for kind in ("Fc+", "Fc-")]
        if all(way in out for way in ways):
            forward, backward = (out[way] for way in ways)
            out |= dict.fromkeys((f"{place}.Fc", *ways), 0.5 * (forward + backward))
            offset = out.get(f"{place}.off", 0.0) + 0.5 * (forward - backward)
            if offset:
                out |= {f"{place}.off": offset}
    return out


def _home(robot: Robot, joint: str) -> float:
    return float(robot.dof_position(robot.home[None], joint)[0])


def by_effect(
    robot: Robot, names: Iterable[str], shapes: NumberByName | None
) -> dict[str, Strings]:
    """Return parameters by the titles of the effects that have them; others by themselves.

    Parameters
    ----------
    robot : Robot
    names : iterable of str
    shapes : mapping, optional
        As in `every_parameter`.
    """
    every = every_parameter(robot, shapes)
    out = dict[str, Strings]()
    for name in names:
        title = FAMILIES[every[name].group].title if name in every else name
        out[title] = (*out.get(title, ()), name)
    return out


def drop_follower_friction(robot: Robot) -> dict[str, float]:
    """Return zero friction of the passive joints, by name of the parameter.

    Friction along a joint that follows is part of the friction of the joint that it follows.
    """
    kinds = (*FIELDS["damping"].kinds, *FIELDS["frictionloss"].kinds)
    return {f"{axis.name}.{kind}": 0.0 for axis in robot.passive_axes for kind in kinds}


def complete_values(robot: Robot, given: NumberByName, *, keep: bool) -> dict[str, float]:
    """Return all nominal values of a robot that has some other ones.

    Payloads become part of their bodies. Every Coulomb level is given for both directions together
    and for each.

    Parameters
    ----------
    robot : Robot
    given : mapping
    keep : bool
        Whether joints keep what is not given. Else passive joints have no friction.
    """
    bodies = {f"{body}.{kind}" for body in robot.bodies for kind in INERTIAL_KINDS}
    values = {n: v for n, v in robot.nominal.items() if keep or n in bodies}
    values |= ({} if keep else drop_follower_friction(robot)) | dict(given)
    for p in _stated(robot, tuple(FAMILIES.values()), file_kinds(robot)[0]):
        of_body = f"{p.owner}.{p.stated_as}"
        if of_body in bodies and p.kind != p.stated_as:
            values[of_body] += values.pop(p.name, 0.0)
    complete_coulomb_levels(values, given)
    return values


def stated_numbers(
    robot: Robot, values: NumberByName, kind: Kind | None = None
) -> dict[str, dict[str, float]]:
    """Return the numbers that a file states of each joint and each tendon axis, by attribute.

    The format is by default that of the robot's own file.
    """
    every = (*robot.tree.single, *robot.tendon_axes)
    kind = kind or file_kinds(robot)[0]
    out = {joint: dict.fromkeys(joint_numbers(kind), 0.0) for joint in every}
    for place in set(out) & set(biased_places(robot, kind)):
        out[place]["offset"] = 0.0
    own = _stated(robot, tuple(FAMILIES.values()), kind)
    for p in {p.name: p for p in own if p.stated_as in out.get(p.owner, ())}.values():
        out[p.owner][p.stated_as] += values.get(p.name, 0.0)
    return out


def read_back(robot: Robot, values: NumberByName) -> dict[str, float]:
    """Return the nominal values that are read from a file with these ones, without a sidecar."""
    out = {f"{b}.{kind}": values[f"{b}.{kind}"] for b in robot.bodies for kind in INERTIAL_KINDS}
    for joint, numbers in stated_numbers(robot, values).items():
        out |= name_numbers(joint, numbers, robot.inertia_parts)
    return out


# Every parameter that a model of a robot can have, by name.


def every_parameter(robot: Robot, shapes: NumberByName | None = None) -> dict[str, Parameter]:
    """Return every parameter of every effect, by name, at its default places and at all others.

    Of two effects with the same parameter the first has it; `Parameter.group` says which.

    Parameters
    ----------
    robot : Robot
    shapes : mapping, optional
        Shapes of effects by ``<joint>.<effect>``, in addition to those of the robot.
    """
    robot = replace(robot, shapes={**robot.shapes, **(shapes or {})})
    effects = [family.effect for family in reversed(FAMILIES.values())]
    placed = [e.placed("*") for e in effects if isinstance(e, AlongAxes) and e.placeable]
    weight = Payload(robot.gravity)
    every = (weight, *placed, *effects)
    return {p.name: p for e in every for p in e.parameters(robot)}
