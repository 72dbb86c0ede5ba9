"""Which joints move the robot, which follow, and whether its home position says so.

A closed chain has several assemblies; home selects one, so it must nearly close the loops. Of a
robot whose files state no home it is the assembly nearest to the file's configuration, if no other
one is about as near.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from identifiability.foundation.errors import ClosureError, RobotError, listing
from identifiability.foundation.names import Array
from identifiability.robot import closure
from identifiability.robot.cables import stretch_home
from identifiability.robot.description import Description
from identifiability.robot.loop_equations import loop_jacobian
from identifiability.robot.newton import ACCEPTED, LEAP, find_assemblies, newton
from identifiability.robot.parts import Stated
from identifiability.robot.sidecar import LimitEntry, Sidecar

#: A home position further than this from closing the loops is no rounded one [m or rad].
OPEN = 1e-2

#: Another assembly less than so many times as far from the file's configuration is near, too, and
#: any is where the nearest is farther than `LEAP`. Of 990 drawings of five mechanisms, off by up to
#: 0.6 rad in every joint, and of 240 of two, off by up to 1 rad, none then gave a wrong assembly.
NEAR = 2.0

#: A base whose motion changes the loop equations by less than this is in none [m/m or m/rad].
FREE = 1e-9

#: No joint is further from zero than this [m or rad].
FAR = 1e6


def choose_joints(robot: Description, extra: Sidecar, stated: Stated) -> Description:
    """Split the degrees of freedom into actuated and dependent ones, and check the count.

    Raises
    ------
    RobotError
    """
    names = extra.actuated if extra.actuated is not None else stated.actuated
    if names is stated.actuated and stated.undriven:
        raise RobotError(
            f"{robot.path}: the actuator '{stated.undriven}' drives no single joint; name the "
            'joints whose torque is measured in the sidecar: actuated = ["joint1", …].'
        )
    pulling = {cable.name for cable in robot.cables}
    names = [n for n in robot.tree.single if n not in pulling] if names is None else names
    names = [name for name in names if name not in robot.locked]
    index = np.array([_driven_dof(robot, n) for n in names], int)
    if not names and robot.locked:
        raise RobotError(f"{robot.path}: every actuated joint is locked; leave one that moves.")
    if not names and extra.actuated is None:
        raise RobotError(
            f"{robot.path} has no joint that turns or slides by itself; there is nothing to "
            "identify. A base that floats is not supported: make its joint 'fixed'."
        )
    if len(set(names)) != len(names) or not names:
        raise RobotError(f"{robot.path}: the actuated joints are {names}; name each one once.")
    dependent = np.array([k for k in range(robot.nv) if k not in set(index.tolist())], int)
    robot = replace(robot, actuated=index, dependent=dependent, home=_set_home(robot, extra))
    if not len(dependent) and not robot.equations:
        return robot
    robot = stretch_home(replace(robot, home=_follow_couplings(robot)))
    if not stated.posed and not set(extra.home) & set(robot.passive):
        robot = _assemble_nearest(robot, extra)
    count = closure.count_independent(robot) if robot.equations else 0
    if count < len(dependent):
        _refuse_loose(robot, count)
    if count > len(dependent):
        _refuse_unstated(
            robot, count, stated=bool(extra.actuated or (robot.mjcf and stated.actuated))
        )
        raise RobotError(
            f"{robot.path}: the loops give {count} independent equations for "
            f"{len(dependent)} passive joints, so not all {len(index)} actuated joints are free; "
            "remove an actuator or a closure (or give the lengths and angles of redundant loops "
            "all their digits)."
        )
    _check_closed_home(robot)
    if not len(dependent):  # the loops say nothing that is not so anyway
        return robot
    try:
        closure.check_home(robot)
    except ClosureError as error:
        raise RobotError(str(error)) from None
    return robot


def _refuse_unstated(robot: Description, count: int, *, stated: bool) -> None:
    """Refuse a closed robot of which nothing says where its motors are."""
    moving = len(robot.actuated) + len(robot.dependent)
    if stated or len(robot.dependent) or moving <= count:
        return
    where = "with a <motor> each in <actuator>, or " if robot.mjcf else ""
    raise RobotError(
        f"{robot.path}: nothing says which of its {moving} joints have motors, and its loops leave "
        f"{moving - count} of them free; name these {where}in the sidecar: actuated = "
        f'["{robot.joints[0]}", …]. The joints are {listing(robot.joints)}.'
    )


def _driven_dof(robot: Description, name: str) -> int:
    """Return the index in ``v`` of an actuated joint; only hinges and slides can be."""
    for j in robot.tree.joints:
        if j.nv > 1 and (name in j.dofs or name == j.dofs[0].rpartition(".")[0]):
            raise RobotError(
                f"{robot.path}: the {j.kind} joint '{j.dofs[0].rpartition('.')[0]}' cannot be "
                "actuated; only joints with one axis can: write an actuated ball as three hinges "
                "in one body, and fix a floating base to the ground."
            )
    return robot.dof_index(name)


def _set_home(robot: Description, extra: Sidecar) -> Array:
    """Return the file's home with the positions that the sidecar states."""
    home, single = np.array(robot.home), robot.tree.single
    for name, value in extra.home.items():
        if name in robot.locked:
            continue
        if name not in single:
            dof = robot.dof_index(name)
            raise RobotError(
                f"The sidecar of {robot.path}: [home] gives '{robot.dofs[dof]}', an axis of a ball "
                "or free joint, one position; give the whole position as a keyframe."
            )
        home[single[name].iq] = value
    return home


def _follow_couplings(robot: Description) -> Array:
    """Return the home at which coupled passive joints are where the others put them, (nq,)."""
    home, single = np.array(robot.home), robot.tree.single
    passive = set(robot.passive)
    for c in robot.couplings * len(robot.couplings):  # each may follow another
        poly = np.polynomial.Polynomial(c.polynomial)
        if c.joint in passive and c.joint not in c.sources:
            value = 0.0
            for term in c.terms:
                parts = (w * robot.dof_position(home[None], j)[0] for j, w in term.weights.items())
                value += float(np.polynomial.Polynomial(term.polynomial)(sum(parts)))
            follower = c.joint
        elif not c.more and c.of in passive and len(np.trim_zeros(poly.coef, "b")) == 2:
            at = float(robot.dof_position(home[None], c.joint)[0])
            follower, value = c.of, (at - poly.coef[0]) / poly.coef[1]
        else:
            continue
        if abs(value) < FAR:
            home[single[follower].iq] = value
    return home


def _refuse_loose(robot: Description, count: int) -> NoReturn:
    """Say what to do about passive joints that no equation determines."""
    if count or robot.loops or robot.couplings:
        _check_closed_home(robot)
    wide = [j for j in robot.tree.joints if j.nv > 1]
    A = loop_jacobian(robot, robot.home[None])[0]
    floating = [
        j
        for j in wide
        if j.kind == "free" and np.abs(A[:, j.iv : j.iv + j.nv]).max(initial=0) < FREE
    ]
    if floating:
        name = floating[0].dofs[0].rpartition(".")[0]
        raise RobotError(
            f"{robot.path} floats on the free joint '{name}', which nothing determines: robots "
            "must stand on the ground (a floating base is not supported); if this one was bolted "
            "down while it was measured, remove that joint, or make it 'fixed' in URDF."
        )
    advice = (
        "name the missing actuated joints (<actuator> in MJCF, 'actuated' in the sidecar), add the "
        "closures, or choose a home position away from singularities"
    )
    if wide:
        name, kind = wide[0].dofs[0].rpartition(".")[0], wide[0].kind
        hinges = ", or write the ball as three hinges in one body with an actuator each"
        advice = f"the {kind} joint '{name}' can only be passive in a closed loop: add the closure"
        advice += hinges if kind == "ball" else ""
    raise RobotError(
        f"{robot.path}: {len(robot.dependent)} joints have no actuator ({listing(robot.passive)}) "
        f"but the loops give only {count} independent equations; {advice}."
    )


def position_limits(
    robot: Description, names: Sequence[str], given: Mapping[str, LimitEntry]
) -> Array:
    """Return the position limits of one-dof joints, (n, 2), those of the sidecar first."""
    out = np.tile([-np.inf, np.inf], (len(names), 1))
    for row, name in enumerate(names):
        iq, stated = robot.tree.single[name].iq, given.get(name, LimitEntry()).q
        pulling = [cable for cable in robot.cables if cable.name == name]
        if stated is not None or pulling:
            out[row] = pulling[0].limits if stated is None else stated
            continue
        lower = float(robot.model.lowerPositionLimit[iq])
        upper = float(robot.model.upperPositionLimit[iq])
        if lower < upper and max(abs(lower), abs(upper)) < FAR:
            out[row] = lower, upper
    return out


def _assemble_nearest(robot: Description, extra: Sidecar) -> Description:
    """Return a robot of which nothing states a home, its loops closed as nearly as they can be.

    Raises
    ------
    RobotError
        If several assemblies are about as near.
    """
    if robot.equations < max(len(robot.dependent), 1):
        return robot
    if not OPEN < closure.loop_error(robot, robot.home[None])[0] < FAR:
        return robot
    limits = np.tile([[-np.inf], [np.inf]], len(robot.home))
    for name, joint in robot.tree.single.items():
        if name not in extra.home:
            limits[:, joint.iq] = position_limits(robot, [name], extra.limits)[0]
    q, distance = find_assemblies(robot, *limits, held=bool(extra.home))
    if not len(q):
        return robot
    near = q[(distance < NEAR * distance[0]) | (distance[0] > LEAP)]
    if len(near) > 1:
        _check_closed_home(robot, near)
    return replace(robot, home=q[0], assembled=True)


def _check_closed_home(robot: Description, near: Array | None = None) -> None:
    """Refuse a home position that is far from closing the loops; a rounded one is near."""
    gap = float(closure.loop_error(robot, robot.home[None])[0])
    if not gap <= OPEN:
        several = "" if near is None else f" ({len(near)} that close them were found)"
        if near is None and robot.equations >= len(robot.dependent):
            closed = newton(robot, robot.home[None])
            near = closed.q[closed.error < ACCEPTED]
        raise RobotError(
            f"{robot.path}: the loops are open by {gap:.2g} m at the home position "
            f"({robot.describe_home()}), so their assembly is not determined{several}; give a "
            'position of every joint that closes them: <keyframe><key name="home" qpos="…"/>'
            f"</keyframe> in MJCF, or a table [home] in the sidecar{_such_as(robot, near)}."
        )


def _such_as(robot: Description, near: Array | None) -> str:
    """Return positions that close the loops; with balls and free joints they are no sentence."""
    single = robot.tree.single
    if near is None or any(name not in single for name in robot.passive):
        return ""
    moved = [
        n
        for n in single
        if n in robot.passive or (near[:, single[n].iq] != robot.home[single[n].iq]).any()
    ]
    ways = [", ".join(f"{n} = {q[single[n].iq]:.4f}" for n in moved) for q in near[:2]]
    return f", such as {' or '.join(ways)}" if ways else ""
