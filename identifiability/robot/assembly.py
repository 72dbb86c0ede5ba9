"""Put a `Description` together from model, closures and sidecar; they must determine the motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import BASE, INERTIAL_KINDS, Array, Renames
from identifiability.robot.actuation import choose_joints, position_limits
from identifiability.robot.axes import combine_joints, motor_tendons
from identifiability.robot.bounds import read_bounds
from identifiability.robot.description import Description
from identifiability.robot.joints import body_names
from identifiability.robot.kinematics import Point
from identifiability.robot.known_torque import KnownTorque
from identifiability.robot.magnitudes import check_nominal
from identifiability.robot.measured_torque import MeasuredTorque
from identifiability.robot.parts import (
    Combination,
    Loop,
    LoopFrame,
    Stated,
    Transmission,
    name_numbers,
)
from identifiability.robot.patterns import Owners, spread_patterns
from identifiability.robot.sidecar import LimitEntry, LoopEntry, Sidecar


def assemble(path: Path, sidecar: Path | None, extra: Sidecar, stated: Stated) -> Description:
    """Put the parts together and check that they determine the motion.

    Parameters
    ----------
    path, sidecar : Path
    extra : Sidecar
    stated : Stated

    Raises
    ------
    RobotError
    """
    model, bodies = stated.model, body_names(stated.model)
    motors = tuple(extra.transmission.motors) if extra.transmission else ()
    taken = (*bodies, *(d for j in stated.tree.joints for d in j.dofs), *stated.locked, *motors)
    stated, driven = motor_tendons(stated, motors)
    axes = combine_joints(path, extra.axes, stated, taken)
    dofs = tuple(d for j in stated.tree.joints for d in j.dofs)
    owners = Owners(bodies, (*dofs, *motors, *axes), (*stated.locked, *stated.welded))
    extra = spread_patterns(path, extra, owners)
    _check_sidecar(path, extra, bodies, stated, (*motors, *axes))
    loops = stated.loops
    if extra.loops is not None:
        loops = [_sidecar_loop(path, entry, stated) for entry in extra.loops]
    named = tuple(body for body in extra.base_parameters.bodies if body in bodies)
    name = path.resolve().parent.name if path.stem == "robot" else path.stem
    robot = Description(
        name=name,
        title=extra.name or model.name or name,
        path=path,
        sidecar=sidecar,
        model=model,
        tree=stated.tree,
        bodies=bodies,
        body_symbols={b: extra.symbols.get(b, b) for b in bodies},
        joint_symbols=dict(extra.symbols),
        loops=tuple(loops),
        couplings=tuple(stated.couplings),
        home=np.array(pin.neutral(model)) if stated.home is None else stated.home,
        rest={name: relaxed for name, (_, relaxed) in stated.springs.items()}
        | {name: axis.rest for name, axis in axes.items() if axis.rest is not None}
        | {name: at for name, at in extra.rest.items() if name not in stated.locked},
        combinations={name: axis.weights for name, axis in axes.items()},
        placed=tuple(extra.effects),
        tendons=tuple(name for name, axis in axes.items() if axis.numbers),
        body_order=named + tuple(b for b in bodies if b not in named),
        inertia_parts=tuple(extra.inertia_parts),
        prior_relative=extra.prior_relative,
        prior={name: (entry.mean, entry.sd) for name, entry in extra.prior.items()},
        ties=tuple(_ties(extra, stated)),
        shapes=extra.shapes,
        reference=extra.reference,
        columns=Renames.of(extra.columns),
        time_unit=extra.time.unit or "",
        torque=_measured_torque(extra, stated),
        known_torque=_known_torque(extra, stated),
        angles=extra.angles,
        locked=dict(stated.locked),
        welded=dict(stated.welded),
        bounds=read_bounds(path, extra.bounds, bodies, stated),
        cables=stated.cables,
        outside=stated.outside,
        entries=stated.entries,
    )
    robot = choose_joints(robot, extra, stated)
    for key in ("gain", "ratio", "sign"):
        _check_known(
            path, f"torque.{key}", getattr(robot.torque, key), ("", *robot.joints, *motors)
        )
    lifted = robot.torque.compensated
    _check_known(
        path, "torque.compensated", lifted if isinstance(lifted, tuple) else (), robot.joints
    )
    limits = [extra.limits.get(joint, LimitEntry()) for joint in robot.joints]
    robot = replace(
        robot,
        nominal=_nominal(robot, extra, stated, {**axes, **driven}),
        limits=position_limits(robot, robot.joints, extra.limits),
        speed_limits=np.array([np.inf if limit.v is None else limit.v for limit in limits]),
        acceleration_limits=np.array([np.inf if limit.a is None else limit.a for limit in limits]),
        transmission=_transmission(robot, extra),
    )
    lines = (a.name for a in (*(x for x in robot.axes if x.row is not None), *robot.passive_axes))
    along = [k.along for k in extra.known_torque]
    _check_known(path, "known_torque", along, (*lines, *robot.locked))
    return robot


def _check_sidecar(
    path: Path, extra: Sidecar, bodies: tuple[str, ...], stated: Stated, lines: tuple[str, ...]
) -> None:
    """Refuse a sidecar that names what the robot does not have; what is locked may have limits."""
    dofs = (*(d for j in stated.tree.joints for d in j.dofs), *stated.locked)
    known = (*bodies, *dofs, *lines)
    _check_known(path, "symbols", extra.symbols, (*known, *stated.welded))
    _check_known(
        path, "base_parameters.bodies", extra.base_parameters.bodies, (*bodies, *stated.welded)
    )
    _check_known(path, "limits", extra.limits, dofs)
    _check_known(path, "rest", extra.rest, (*stated.tree.single, *stated.locked))
    tied = [name for tie in _ties(extra, stated) for members in tie.values() for name in members]
    tables = {key: getattr(extra, key) for key in ("nominal", "prior", "shapes", "reference")}
    for key, names in {"symmetry": tied, **tables}.items():
        owners = [name.rpartition(".")[0] for name in names]
        gone = [body for body in stated.welded if body in owners]
        if gone:
            raise RobotError(
                f"The sidecar of {path}: [{key}] names the body '{gone[0]}', which hangs behind a "
                "locked joint and is one with what is before; take the line out, or give the "
                "values of both together."
            )
        _check_known(path, key, owners, (*known, BASE))


def _ties(extra: Sidecar, stated: Stated) -> list[dict[str, tuple[str, ...]]]:
    """Return the sums that symmetry allows; with a locked leg legs are no longer equal."""
    gone = {*stated.locked, *stated.welded}
    every = [{k: tuple(v) for k, v in s.tie.items()} for s in extra.symmetry]
    names = [{n.rpartition(".")[0] for members in tie.values() for n in members} for tie in every]
    return [tie for tie, owners in zip(every, names, strict=True) if not owners & gone]


def _check_known(path: Path, key: str, given: Any, known: tuple[str, ...]) -> None:
    for name in given:
        if name not in known:
            raise RobotError(
                f"The sidecar of {path}: [{key}] names '{name}', which the robot does not have"
                f"{near_match(name, known)} Known: {listing(known)}."
            )


def _sidecar_loop(path: Path, entry: LoopEntry, stated: Stated) -> Loop:
    ends = []
    places = ((entry.body1, entry.point1), (entry.body2, entry.point2))
    for body, point in places:
        joint, rotation, translation = _find_body(path, body, stated)
        ends.append(Point(joint, rotation @ np.array(point) + translation))
    frame = None
    if entry.frame is not None:
        joint, rotation, _ = _find_body(path, entry.frame, stated)
        frame = LoopFrame(entry.frame, joint, rotation)
    axes = tuple("xyz".index(a) for a in entry.axes)
    name = entry.name or f"{entry.body1}-{entry.body2}"
    return Loop(name, ends[0], ends[1], axes, places, frame)


def _find_body(path: Path, body: str, stated: Stated) -> tuple[int, Array, Array]:
    """Return the joint of the tree that a body is behind, and its rotation and place there."""
    model = stated.model
    frames = [f for f in model.frames if f.name == body and f.type == pin.FrameType.BODY]
    if not frames:
        known = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
        raise RobotError(
            f"The sidecar of {path}: a loop names the body '{body}', which the robot does not "
            f"have{near_match(body, known)} Known: {listing(known)}."
        )
    place = frames[0].placement
    return stated.last[frames[0].parentJoint], np.array(place.rotation), np.array(place.translation)


def _nominal(
    robot: Description, extra: Sidecar, stated: Stated, axes: Mapping[str, Combination]
) -> dict[str, float]:
    """Return the parameter values that the files state, by name."""
    model = robot.model
    values: dict[str, float] = {}
    for k, body in enumerate(robot.bodies):
        pi = model.inertias[k + 1].toDynamicParameters()
        values |= {f"{body}.{kind}": float(v) for kind, v in zip(INERTIAL_KINDS, pi, strict=True)}
    friction = np.nan_to_num(model.upperDryFrictionLimit, posinf=0.0)
    parts = robot.inertia_parts
    numbers = {"damping": model.damping, "frictionloss": friction, "armature": model.armature}
    stated_at = [{word: float(x[dof]) for word, x in numbers.items()} for dof in range(model.nv)]
    stated_at += [{word: t.numbers.get(word, 0.0) for word in numbers} for t in robot.cables]
    for name, stated_here in zip(robot.dofs, stated_at, strict=True):
        values |= name_numbers(name, stated_here, parts) | {f"{name}.{p}": 0.0 for p in parts[1:]}
    values |= {f"{name}.K": stiffness for name, (stiffness, _) in stated.springs.items()}
    for name, axis in axes.items():
        values |= name_numbers(name, axis.numbers, parts)
    locked = tuple(f"{name}." for name in stated.locked)  # no friction where nothing moves
    given = {name: value for name, value in extra.nominal.items() if not name.startswith(locked)}
    for name, value in given.items():  # one level of dry friction is that of both directions
        joint, _, kind = name.rpartition(".")
        if kind == "Fc":
            values |= name_numbers(joint, {"frictionloss": value}, parts)
    check_nominal(robot.path, values | given, ("Fv", "Fc", "Fc+", "Fc-", *parts[:1]))
    return values | given


def _measured_torque(extra: Sidecar, stated: Stated) -> MeasuredTorque:
    """Return what torque columns hold; a number is for all joints.

    Before the gears, those that an MJCF states are the ratios that nobody gives.
    """
    entry = extra.torque
    tables = {
        key: dict(value) if isinstance(value, dict) else {"": float(value)}
        for key in ("gain", "ratio", "sign")
        if (value := getattr(entry, key)) is not None
    }
    if entry.side == "motor" and "ratio" not in tables:
        forces = stated.entries.get("actuator_force", {}).values()
        tables["ratio"] = {e.column.removesuffix(".tau"): e.factor for e in forces}
    some = entry.compensated
    return MeasuredTorque(
        entry.side, **tables, compensated=tuple(some) if isinstance(some, list) else some
    )


def _known_torque(extra: Sidecar, stated: Stated) -> tuple[KnownTorque, ...]:
    """Return the torque that is known; along a locked joint it moves nothing."""
    return tuple(
        KnownTorque.of_table(k.along, k.table, k.interpolation or "linear")
        if k.table
        else KnownTorque.of_polynomial(k.along, k.polynomial, k.range or (-np.inf, np.inf))
        for k in extra.known_torque
        if k.along not in stated.locked
    )


def _transmission(robot: Description, extra: Sidecar) -> Transmission | None:
    entry, n = extra.transmission, len(robot.actuated)
    if entry is None:
        return None
    m = len(entry.motors)
    whole = len(entry.coupling) == m and all(len(row) == n for row in entry.coupling)
    coupling = np.array(entry.coupling, float) if whole else np.zeros((m, n))
    if m < n or not np.linalg.cond(coupling) < 1e9 or not coupling.any(axis=1).all():
        raise RobotError(
            f"The sidecar of {robot.path}: [transmission] needs at least {n} motors that move all "
            f"the actuated joints {listing(robot.joints)}: a row of {n} numbers in 'coupling' for "
            f"each motor, and together of rank {n}, such as an invertible {n}×{n} coupling."
        )
    ratio = np.ones(m) if entry.ratio is None else np.array(entry.ratio, float)
    offset = np.zeros(n) if entry.offset is None else np.array(entry.offset, float)
    if ratio.shape != (m,) or offset.shape != (n,) or not np.all(ratio):
        raise RobotError(
            f"The sidecar of {robot.path}: [transmission] needs {m} non-zero ratios (one a motor) "
            f"and {n} offsets (one a joint)."
        )
    return Transmission(tuple(entry.motors), coupling, ratio, offset)
