"""Put a `Description` together from model, closures and sidecar: do they determine the motion?

It finds the joints that move the robot, the locked ones and the dependent ones. It checks that the
home position fits them. It adds axes that combine joints, and the sidecar's data on masses.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import NEARLY, ROUNDOFF
from identifiability.foundation.names import (
    INERTIAL_KINDS,
    Array,
    NumberByName,
    Renames,
    Strings,
    find_named,
    is_pattern,
)
from identifiability.foundation.options import Expected
from identifiability.foundation.quoting import for_toml, option_for_shell, toml_key
from identifiability.foundation.values import Fields

from .closure import Closed, count_independent, invert, newton, stretch_home
from .description import (
    ENDLESS,
    NOT_NEGATIVE,
    Bound,
    Coupling,
    Description,
    Loop,
    Stated,
    Transmission,
    name_numbers,
)
from .floating import BASE_JOINTS, Base, Contact, Imu, Wrench
from .inertials import describe_faults, find_faults
from .kinematics import Point, body_names
from .locate import LARGEST, SMALLEST
from .rules import RULES
from .servo import read_servo
from .sidecar import (
    ImuEntry,
    LimitEntry,
    LoopEntry,
    MeasuredTorque,
    Sidecar,
    by_name,
    check_known,
    expand_names,
    renaming,
)

#: Joints by name; a number is the position of a lock, None the home position.
Locks = Mapping[str, float | None]

LockOption = Annotated[
    Sequence[str] | Mapping[str, Any],
    Expected("a list of joints, each 'NAME' or 'NAME=POSITION', or a table of positions by joint"),
]


def _split_lock(word: str) -> tuple[str, str | None]:
    """Return joint and position of ``NAME=VALUE``; None as the position of ``NAME``."""
    name, equals, value = word.rpartition("=")
    if equals:
        return name.strip(), value or None
    return word.strip(), None


def read_locks(given: LockOption | None) -> dict[str, float | None]:
    """Return the joints to lock, as an option or a sidecar gives them.

    Raises
    ------
    RobotError
        If a position is no finite number.
    """
    words = [given] if isinstance(given, str) else given or ()
    if isinstance(given, Mapping):
        pairs: Iterable[tuple[str, Any]] = given.items()
    else:
        pairs = [_split_lock(word) for word in words]
    out: dict[str, float | None] = {}
    for name, value in pairs:
        try:
            out[name] = None if value is None else float(value)
        except (TypeError, ValueError):
            out[name] = np.nan
        if not np.isfinite(out[name] or 0.0):
            raise RobotError(
                f"The joint '{name}' cannot be locked at '{value}'; give its position in rad or m, "
                f"as {name}=0.5, or none for its home position."
            )
    return out


def resolve_locks(
    path: Path,
    extra: Sidecar,
    home: NumberByName,
    stated: Iterable[Coupling],
    fixed: Collection[str] = (),
) -> tuple[dict[str, float], list[Coupling]]:
    """Return the position of every locked joint, and the remaining couplings.

    For each joint, a coupling of the sidecar overrides that of the file. A joint that is coupled to
    a locked joint is locked too.

    Parameters
    ----------
    path : Path
        Of the robot file, for sentences.
    extra : Sidecar
    home : mapping
        Positions of the joints with one axis, as the file draws them.
    stated : iterable of Coupling
        Couplings of the file.
    fixed : collection of str
        Joints without an axis, which need no lock; joints that follow only these are locked.

    Raises
    ------
    RobotError
        If a joint cannot be locked, or couplings give it another position.
    """
    stated = [c.held(dict.fromkeys(fixed, 0.0)) for c in stated]
    left = [c for c in stated if c.joint not in {entry.joint for entry in extra.couplings}]
    wanted: Locks = {c.joint: None for c in left if fixed and not c.terms}
    wanted = by_name(path, "locked or --lock", {**wanted, **read_locks(extra.locked)}, home, fixed)
    for c in extra.couplings:
        first = {} if c.of is None else {c.of: c.polynomial}
        constant = 0.0 if first else c.polynomial[0]
        left.append(Coupling.of(c.name or c.joint, c.joint, {**first, **c.terms}, constant))
    follow = {c.joint: c for c in left if c.terms or c.joint in wanted}
    own = {name: at for name, at in wanted.items() if name not in follow}
    locked = {n: extra.home.get(n, home[n]) if at is None else at for n, at in own.items()}
    while True:
        left = [c.held(locked) for c in left]
        still = {c.joint: c.constant for c in left if not c.terms and c.joint in follow}
        if not still:
            break
        locked |= still | locked
        left = [c for c in left if c.terms or c.joint not in still]
    for name, at in wanted.items():
        others = listing(follow[name].terms) if name in follow else ""
        if name not in locked:
            raise RobotError(
                f"{path}: the joint '{name}' cannot be locked, as it follows {others}; lock that."
            )
        if at is not None and abs(locked[name] - at) > NEARLY * (1 + abs(at)):
            raise RobotError(
                f"{path}: the joint '{name}' is locked at {at:g}, but its coupling to {others} "
                f"puts it at {locked[name]:g}; lock one of them, the other follows."
            )
    return locked, left


# Refuse robots whose numbers no arithmetic holds, or of more joints than can be worked on.


#: Degrees of freedom of the joints that move; memory grows faster than their number.
MOST_JOINTS = 100


def check_magnitudes(path: Path, stated: Stated) -> None:
    """Refuse a robot that is too large in number or size.

    Raises
    ------
    RobotError
    """
    model = stated.model
    points = [p for c in stated.cables for p in c.points]
    if model.njoints < 2:
        raise RobotError(f"{path} has no joint that moves; there is nothing to identify.")
    if model.nv > MOST_JOINTS:
        raise RobotError(
            f"{path} has {model.nv} degrees of freedom; robots of up to {MOST_JOINTS} are read: "
            "lock joints that do not move ([locked] in the sidecar, or --lock)."
        )
    places = [place.translation for place in model.jointPlacements]
    points += [p for loop in stated.loops for p in (loop.first, loop.second)]
    every = [model.gravity.linear, *places, *(p.position for p in points), stated.home]
    if not np.all(np.abs(np.concatenate(every)) < LARGEST):
        raise RobotError(
            f"{path}: gravity, the place of a joint or site, or a home position is infinite or "
            "implausibly large; correct it."
        )


def check_nominal(path: Path, values: NumberByName, rotor: str) -> None:
    """Refuse values that files state and no robot has; `rotor` is an actuator's inertia.

    Raises
    ------
    RobotError
    """
    for name, value in values.items():
        owner, _, kind = name.rpartition(".")
        if not abs(value) < LARGEST:
            raise RobotError(f"{path}: {name} = {value:g} is no number of a robot; give SI units.")
        if kind == "m" and 0 < value < (1 - NEARLY) * SMALLEST:
            raise RobotError(
                f"{path}: {name} = {value:g} kg is below {SMALLEST:g} kg, the least mass that is "
                f"read; correct '{owner}', or give it no mass."
            )
        if value < 0 and kind in {*NOT_NEGATIVE, rotor}:
            faults = find_faults(path) if kind in INERTIAL_KINDS else {}
            if faults:
                raise RobotError(f"{path}: {describe_faults(faults)} Correct <inertial> there.")
            raise RobotError(
                f"{path}: the file, or its sidecar, states {name} = {value:g}; stiffness, damping, "
                "friction, armature, mass and moments of inertia are not negative: correct "
                f"'{owner}'."
            )


# Axes that are combinations of joints: stated in the sidecar, or tendons of the robot file.


def combine_joints(path: Path, extra: Sidecar, stated: Stated, taken: Collection[str]) -> Stated:
    """Return the statements of a file with the sidecar's combinations of joints added.

    The sidecar overrides the robot file. Locked joints are no part of a combination.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    extra : Sidecar
    stated : Stated
    taken : collection of str
        Names of bodies, joints and motors, which no axis can have.

    Raises
    ------
    RobotError
        If a joint is not there or cannot be part of an axis, or a name is taken.
    """
    known = (*stated.tree.single, *stated.locked)
    # An export writes the numbers of a motor that mixes joints as a tendon of its name.
    motors = extra.transmission.motors if extra.transmission else ()
    found = {name: c for name, c in stated.combinations.items() if name not in motors}
    rests = {**stated.rests}
    numbers = {**stated.numbers}
    for entry in extra.axes:
        name = entry.name
        check_known(path, f"axes.{name}.joints", entry.joints, known)
        moving = {joint: c for joint, c in entry.joints.items() if joint not in stated.locked}
        if found.get(name) != moving:
            rests.pop(name, None)
            numbers.pop(name, None)
        if moving:
            found |= {name: moving}
        rests |= {} if entry.rest is None else {name: entry.rest}
    names = [*found, *(entry.name for entry in extra.axes)]
    odd = [name for name in names if name in taken]
    odd += [cable.name for cable in stated.cables if [*taken].count(cable.name) > 1]
    if odd:
        raise RobotError(
            f"{path}: '{odd[0]}', an axis or tendon, has the name of a body, joint or motor, and "
            "parameters are named after it; give it another."
        )
    return replace(stated, combinations=found, rests=rests, numbers=numbers)


# A sidecar's data on masses and centres of mass, body by body.


def read_bounds(path: Path, extra: Sidecar, bodies: Strings, stated: Stated) -> tuple[Bound, ...]:
    """Return the bounds of a robot.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    extra : Sidecar
    bodies : tuple of str
        The moving bodies.
    stated : Stated

    Raises
    ------
    RobotError
        If a body is not there, or the masses of bodies contradict the total one.
    """
    known = by_name(path, "bounds.bodies", extra.bounds.bodies, bodies, stated.welded)
    frames = {f.name: f.placement for f in stated.model.frames if f.type == pin.FrameType.BODY}
    bounds = []
    for body, entry in known.items():
        R = np.array(frames[body].rotation)
        p = np.array(frames[body].translation)
        bounds.append(Bound((body,), entry.mass, entry.box, R, p))
    total = extra.bounds.total_mass
    if total is None:
        return tuple(bounds)
    masses = {body: entry.mass or (0.0, np.inf) for body, entry in known.items()}
    ranges = [masses.get(body, (0.0, np.inf)) for body in bodies]
    least, most = np.sum(ranges, axis=0)
    low, high = total
    if least >= high or most <= low:
        raise RobotError(
            f"The sidecar of {path}: [bounds] says that the total mass is {low:g} … {high:g} kg, "
            f"and that of its bodies is {least:g} … {most:g} kg; widen one of them."
        )
    return (*bounds, Bound(bodies, total))


# Find the actuated and the dependent joints, and check the home position.
#
# A closed chain has several assemblies. Home selects one, so it must nearly close the loops. If the
# files state no home, Newton's steps from the drawn position find one, if it is near.


def choose_joints(robot: Description, extra: Sidecar, stated: Stated) -> Description:
    """Split the degrees of freedom into actuated and dependent ones, and check the count.

    Raises
    ------
    RobotError
    """
    single = robot.tree.single
    names = extra.actuated if extra.actuated is not None else stated.driven
    if names is not None and stated.base is not None:
        names = [*BASE_JOINTS, *(n for n in names if n not in BASE_JOINTS)]
    pulling = {cable.name for cable in robot.cables}
    names = [n for n in single if n not in pulling] if names is None else names
    names = [name for name in names if name not in robot.locked]
    for name in names:
        if name not in single:
            raise RobotError(
                f"{robot.path}: '{name}' cannot be actuated, as it is no joint that turns or slides"
                f"{near_match(name, single)} Known: {listing(single)}. Write "
                "an actuated ball as three hinges in one body."
            )
    if not names:
        raise RobotError(
            f"{robot.path}: no actuated joint is left that is not locked; name those whose torque "
            'is measured, in the sidecar: actuated = ["joint1", …], and leave one that moves.'
        )
    index = np.array([robot.dof_index(name) for name in names], int)
    dependent = np.setdiff1d(np.arange(robot.nv), index)
    passive = len(dependent)
    robot = replace(robot, actuated=index, dependent=dependent)
    robot = stretch_home(replace(robot, home=_state_home(robot, extra)))
    if not passive and not robot.equations:
        return robot
    # Redundant equations contradict each other away from closed configurations.
    enough = robot.equations >= passive > 0
    there = newton(robot, robot.home[None], most=0)
    closed = newton(robot, robot.home[None]) if enough else there
    count = count_independent((closed if closed.error[0] < ROUNDOFF else there).A[0])
    if count > passive:
        raise RobotError(
            f"{robot.path}: the loops give {count} independent equations for {passive} "
            f"passive joints, so not all {len(index)} actuated joints are free; remove an actuator "
            "or a closure, or name the joints that have motors, in <actuator> of an MJCF or in the "
            f"sidecar: actuated = [{for_toml(names[0])}, …] (or give the lengths and angles of "
            "redundant loops all their digits)."
        )
    posed = stated.posed or bool(set(extra.home) & set(robot.passive))
    if there.error[0] > RULES.home_open or (enough and closed.error[0] >= ROUNDOFF):
        robot = _close_home(robot, float(there.error[0]), closed, stated=posed)
    if count < passive:
        _refuse_loose(robot, count)
    if passive and not invert(closed.A[:, :, dependent])[1][0] * ROUNDOFF < 1:
        raise RobotError(
            f"The loops of {robot.path} do not determine {listing(robot.passive)} at its home "
            f"position {robot.describe_home()}: it is singular, or other joints are the actuated "
            "ones; choose another home or other actuators."
        )
    return robot


def _state_home(robot: Description, extra: Sidecar) -> Array:
    """Return the home of the files, with passive joints where couplings put them, (nq,)."""
    home = np.array(robot.home)
    single = robot.tree.single
    passive = {*robot.passive}
    check_known(robot.path, "home", extra.home, single)
    for name, value in extra.home.items():
        home[single[name].iq] = value
    for c in robot.couplings * len(passive):  # each may follow another
        chain = (c.joint, *c.terms)
        at = {j: float(robot.dof_position(home[None], j)[0]) for j in chain}
        value = c.held(at).constant
        if c.joint in passive and abs(value) < ENDLESS:
            home[single[c.joint].iq] = value
    return home


def _refuse_loose(robot: Description, count: int) -> NoReturn:
    """Refuse passive joints that no equation determines, and state the remedy."""
    wide = [j.dofs[0].rpartition(".")[0] for j in robot.tree.joints if j.nv > 1]
    following = {coupling.joint for coupling in robot.couplings}
    single = [n for n in robot.passive if n in robot.tree.single and n not in following]
    advice = ""
    pulled = [c.along for c in robot.cables if c.along is not None]
    for along in (c for c in pulled if len(c.terms) > 1 and {*c.terms} <= {*robot.passive}):
        advice += (
            f" If {listing(along.terms)} move together, tie them with <equality><joint>, or as "
            f"[[couplings]] in the sidecar: the tendon '{along.joint}' moves their sum alone."
        )
    if wide:
        advice = f" Ball and floating joints ({listing(wide)}) can only be passive in a closed "
        advice += "loop; write a ball that is driven as three hinges in one body."
    if single:
        locks = listing([option_for_shell("--lock", name) for name in single], between=" ")
        advice += (
            f" Lock joints that stand still, such as a gripper: {locks} (or {single[0]}=0.02)."
        )
    raise RobotError(
        f"{robot.path}: {len(robot.dependent)} joints have no actuator ({listing(robot.passive)}) "
        f"and the loops give only {count} independent equations; name the missing actuated joints "
        "(<actuator> in MJCF, 'actuated' in the sidecar), add the closures, or choose a home "
        "position away from singularities. A joint without a motor must be locked or follow others."
        f"{advice}"
    )


def position_limits(
    robot: Description, names: Sequence[str], given: Mapping[str, LimitEntry]
) -> Array:
    """Return the position limits of one-dof joints, (n, 2), those of the sidecar first."""
    own = {name: robot.spans.get(name, (-np.inf, np.inf)) for name in names}
    spans = [given.get(name, LimitEntry()).q or span for name, span in own.items()]
    return np.array(spans).reshape(-1, 2)


def _close_home(robot: Description, gap: float, closed: Closed, *, stated: bool) -> Description:
    """Return a robot whose home closes its loops, unless the files state home.

    A home that is stated may be rounded; one that is far from closing them is refused.
    """
    q = closed.q[0]
    single = robot.tree.single
    sites = ""
    such_as = ""
    closes = closed.error[0] < ROUNDOFF
    if closes and not stated and np.abs(q - robot.home).max() <= RULES.leap:
        return replace(robot, home=q, assembled=True)
    if closes and single.keys() >= {*robot.passive}:
        found = (f"{toml_key(n)} = {q[single[n].iq]:.4f}" for n in robot.passive)
        such_as = f", such as {', '.join(found)}"
    if stated and robot.mjcf:
        sites = "if an anchor of <connect> is meant there, name two sites instead (site1, site2), "
        sites += "as it lies where bodies are drawn (all joints at 0, without any key); else "
    raise RobotError(
        f"{robot.path}: the loops are open by {gap:.2g} m at the home position "
        f"({robot.describe_home()}), so their assembly is not determined; {sites}give a position "
        'of every joint that closes them: <keyframe><key name="home" qpos="…"/></keyframe> in '
        f"MJCF, or a table [home] in the sidecar{such_as}."
    )


# Put a `Description` together from model, closures and sidecar; they must determine the motion.


def refuse_patterns(path: Path, names: Iterable[str]) -> None:
    """Refuse names that look like patterns of a sidecar or a ladder.

    Raises
    ------
    RobotError
    """
    odd = [name for name in names if is_pattern(name)]
    if odd:
        raise RobotError(Finding("robot.pattern", path, name=odd[0]))


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
    names = body_names(stated.model)
    bodies = tuple(names[joint - 1] for joint in stated.carriers)
    motors = tuple(extra.transmission.motors) if extra.transmission else ()
    dofs = tuple(d for j in stated.tree.joints for d in j.dofs)
    owners = (*dofs, *stated.locked, *motors)
    refuse_patterns(path, (*bodies, *owners, *stated.combinations))
    stated = combine_joints(path, extra, stated, (*bodies, *owners))
    lines = (*motors, *stated.combinations)
    extra = expand_names(path, extra, bodies, dofs, lines, stated.locked, stated.welded)
    name = path.resolve().parent.name if path.stem == "robot" else path.stem
    title = extra.name or stated.model.name or name
    scales = _scales(path, extra, owners)
    bounds = read_bounds(path, extra, bodies, stated)
    base = _read_base(path, extra, stated, bodies)
    said = {
        "name": name,
        "title": title,
        "path": path,
        "sidecar": sidecar,
        "bodies": bodies,
        "scales": scales,
        "bounds": bounds,
        "base": base,
    }
    parts = vars(stated) | said | _state_sidecar(extra) | _state_motion(path, extra, stated)
    robot = choose_joints(Description(**parts), extra, stated)
    robot = replace(robot, torque=_torque_by_joint(robot, motors))
    limits = {joint: extra.limits.get(joint, LimitEntry()) for joint in robot.joints}
    fastest = [x.v or robot.speeds.get(joint, np.inf) for joint, x in limits.items()]
    position_ranges = position_limits(robot, robot.joints, extra.limits)
    accelerations = np.array([limit.a or np.inf for limit in limits.values()])
    robot = replace(
        robot,
        nominal=_nominal(robot, extra),
        limits=position_ranges,
        speed_limits=np.array(fastest),
        acceleration_limits=accelerations,
        transmission=_transmission(robot, extra),
    )
    if robot.motor_joints:  # a single body has none
        servo = read_servo(path, extra.servo, stated.servos, robot.motor_joints)
        if robot.base is None:
            robot = replace(robot, servo=servo)
        else:  # torque is made of commands only where a robot is held
            robot = replace(robot, base=replace(robot.base, servo=servo))
    every = (*robot.axes, *robot.passive_axes)
    straight = (a.name for a in every if a.row is not None or not a.mixed)
    check_known(path, "known_torque", (k.along for k in extra.known_torque), straight)
    return robot


def _state_sidecar(extra: Sidecar) -> Fields:
    """Return the fields of a `Description` that a sidecar states."""
    prior = {name: (entry.mean, entry.sd) for name, entry in extra.prior.items()}
    ties = tuple({k: tuple(v) for k, v in s.tie.items()} for s in extra.symmetry)
    columns = Renames.of(renaming(extra.columns))
    return {
        "said": extra,
        "symbols": dict(extra.symbols),
        "guessed": tuple(extra.guessed),
        "inertia_parts": tuple(extra.inertia_parts),
        "prior": prior,
        "ties": ties,
        "shapes": extra.shapes,
        "reference": extra.reference,
        "columns": columns,
        "time_unit": extra.time.unit or "",
        "known_torque": tuple(extra.known_torque),
        "angles": extra.angles,
    }


def _state_motion(path: Path, extra: Sidecar, stated: Stated) -> Fields:
    """Return loops, springs, limits and torque columns; the sidecar overrides the robot file."""
    loops = stated.loops
    if extra.loops is not None:
        loops = tuple(_sidecar_loop(path, entry, stated) for entry in extra.loops)
    spans = stated.spans.items()
    loops_kept = tuple(x for x in loops if x.first.joint != x.second.joint)
    spans_kept = {n: x for n, x in spans if x[0] < x[1] and np.abs(x).max() < ENDLESS}
    speeds = {n: x for n, x in stated.speeds.items() if 0 < x < ENDLESS}
    rests = {**stated.rests, **extra.rest}
    tendons = tuple(name for name in stated.combinations if name in stated.numbers)
    return {
        "loops": loops_kept,  # else locked
        "rest": rests,
        "spans": spans_kept,
        "speeds": speeds,
        "tendons": tendons,
        "torque": _measured_torque(extra, stated),
    }


def _torque_by_joint(robot: Description, motors: Strings) -> MeasuredTorque:
    """Return the contents of torque columns with patterns replaced by the names that fit.

    Raises
    ------
    RobotError
        If a name is no actuated joint or motor, or if keys cannot be combined.
    """
    # A key that nobody stated stays unstated: a copy of it would count as stated.
    said: Fields = {}
    for key, value in robot.torque:
        name = f"torque.{key}"
        if isinstance(value, dict):
            lines = (*robot.joints, *motors)
            said[key] = by_name(robot.path, name, value, lines, robot.locked)
            _refuse_joints(robot, key, value, motors)
        elif isinstance(value, list):
            table = dict.fromkeys(value, True)
            said[key] = [*by_name(robot.path, name, table, robot.joints, robot.locked)]
    torque = robot.torque.model_copy(update=said)
    both = torque.has_side("both")
    if both and motors:
        raise RobotError(Finding("robot.both", robot.path, other="[transmission]"))
    if both and torque.compensated:
        raise RobotError(Finding("robot.both", robot.path, other="compensated"))
    if both and robot.base is not None:
        raise RobotError(Finding("robot.both", robot.path, other="a base that floats"))
    return torque


def _refuse_joints(robot: Description, key: str, table: Mapping[str, Any], motors: Strings) -> None:
    """Refuse a key of [torque] that names joints beside motors, as it would change nothing."""
    joints = [j for j in robot.joints if j not in motors]
    of_motors = [text for text in table if find_named(text, motors)]
    of_joints = [text for text in table if text not in of_motors and find_named(text, joints)]
    if of_motors and of_joints:
        raise RobotError(
            Finding("robot.joint", robot.path, key=key, joints=of_joints, motors=[*motors])
        )


def _sidecar_loop(path: Path, entry: LoopEntry, stated: Stated) -> Loop:
    places = ((entry.body1, entry.point1), (entry.body2, entry.point2))
    only = (pin.FrameType.BODY,)
    ends = [_find_frame(path, "loops", body, at, stated, only)[0] for body, at in places]
    name = entry.name or f"{entry.body1}-{entry.body2}"
    return Loop(name, ends[0], ends[1], places)


def _read_base(path: Path, extra: Sidecar, stated: Stated, bodies: Strings) -> Base | None:
    """Return the base of a floating robot, with its contacts and its sensors."""
    if stated.base is None:
        given = [k for k in ("imu", "contacts", "wrench") if getattr(extra, k)]
        if given and extra.base != "fixed":
            raise RobotError(
                f"The sidecar of {path}: [{given[0]}] is about a base that moves, and this robot "
                'stands; take it out, or say base = "floating" if nothing holds its root link. If '
                "only some rows are in contact, empty their torque cells or leave them out."
            )
        return None
    imu = extra.imu or ImuEntry()
    contacts = []
    for entry in extra.contacts:
        own = entry.model_dump(include={"kind", "flag", "threshold", "margin"})
        own["point"], _ = _find_frame(path, "contacts", entry.frame, entry.point, stated)
        radius = stated.radii.get(entry.frame, 0.0) if entry.radius is None else entry.radius
        contacts.append(Contact(entry.frame, radius=radius, **own))
    wrenches = []
    for wrench in extra.wrench:
        frame = _find_frame(path, "wrench", wrench.frame, (0, 0, 0), stated)
        wrenches.append(Wrench(wrench.frame, *frame, tuple(wrench.columns)))
    R = pin.rpy.rpyToMatrix(np.array(imu.rotation, float)).T
    parts = (imu.place, imu.acc_bias, imu.gyro_bias)
    place, acc, gyro = (np.array(x, float) for x in parts)
    mount = Imu(R, place, acc, gyro, tuple(dict.fromkeys(imu.fit)))
    own = {"contacts": tuple(contacts), "wrenches": tuple(wrenches), "imu": mount}
    return replace(stated.base, body=bodies[0], **own)


def _find_frame(
    path: Path,
    key: str,
    name: str,
    at: Sequence[float],
    stated: Stated,
    kinds: Sequence[Any] = (pin.FrameType.BODY, pin.FrameType.OP_FRAME),
) -> tuple[Point, Array]:
    """Return a point in a frame as a point of the tree, and the frame's axes in its joint's."""
    found = {f.name: f for kind in kinds[::-1] for f in stated.model.frames if f.type == kind}
    check_known(path, key, [name], found)
    place = found[name].placement
    where = place.act(np.array(at, float))
    return Point(found[name].parentJoint - 1, where), np.array(place.rotation)


def _nominal(robot: Description, extra: Sidecar) -> dict[str, float]:
    """Return the parameter values that the files state, by name."""
    values: dict[str, float] = {}
    for body, carrier in zip(robot.bodies, robot.carriers, strict=True):
        theta = robot.model.inertias[carrier].toDynamicParameters().tolist()
        values |= {f"{body}.{kind}": v for kind, v in zip(INERTIAL_KINDS, theta, strict=True)}
    words = ("damping", "frictionloss", "armature")
    parts = robot.inertia_parts
    for name in dict.fromkeys((*robot.dofs, *robot.numbers)):
        more = () if name in robot.dofs else ("stiffness",)
        zeros = dict.fromkeys((*words, *more), 0.0)
        stated = dict(robot.numbers.get(name, {}))
        own = zeros | stated
        if robot.offsets.get(name):
            own |= {"offset": robot.offsets[name]}
        values |= {f"{name}.{part}": 0.0 for part in parts} | name_numbers(name, own, parts)
    # One level of dry friction is that of both directions.
    for name, value in extra.nominal.items():
        joint, _, kind = name.rpartition(".")
        if kind == "Fc":
            values |= name_numbers(joint, {"frictionloss": value}, parts)
    every = values | extra.nominal
    check_nominal(robot.path, every, parts[0])
    return every


def _measured_torque(extra: Sidecar, stated: Stated) -> MeasuredTorque:
    """Return the contents of torque columns; without a ratio, motors have the MJCF's gears."""
    said = extra.torque
    if not said.has_side("motor") or said.ratio is not None:
        return said
    return said.model_copy(update={"ratio": dict(stated.gears)})


def _scales(path: Path, extra: Sidecar, lines: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return scale and offset of the joints' positions in logs; a name overrides a pattern."""
    rules = {key: rule for key, rule in extra.columns.items() if not isinstance(rule, str)}
    given = {key: (rule.scale, rule.offset) for key, rule in rules.items()}
    return by_name(path, "columns", given, lines)


def _transmission(robot: Description, extra: Sidecar) -> Transmission | None:
    entry = extra.transmission
    n = len(robot.motor_joints)
    if entry is None:
        return None
    m = len(entry.motors)
    whole = len(entry.coupling) == m and all(len(row) == n for row in entry.coupling)
    coupling = np.array(entry.coupling, float) if whole else np.zeros((m, n))
    ratio = np.array(entry.ratio or [1.0] * m)
    offset = np.array(entry.offset or [0.0] * n)
    square = ratio.shape == (m,)
    fits = square and offset.shape == (n,) and bool(np.all(ratio))
    regular = m >= n and coupling.any(axis=1).all() and np.linalg.cond(coupling) * ROUNDOFF < 1
    if not (fits and regular):
        raise RobotError(
            f"The sidecar of {robot.path}: [transmission] needs at least {n} motors that move all "
            f"the actuated joints {listing(robot.motor_joints)}: a row of {n} numbers in "
            f"'coupling' for each motor, together of rank {n}; and, where given, a ratio that is "
            f"not zero for each motor and {n} offsets."
        )
    twice = [m for m in entry.motors if entry.ratio and extra.torque.at("ratio", m) is not None]
    if twice:
        raise RobotError(
            f"The sidecar of {robot.path}: both [torque] ratio and [transmission] ratio are stated "
            f"for {listing(twice)}, and torque is multiplied by each; leave out one of them."
        )
    return Transmission(tuple(entry.motors), coupling, ratio, offset)
