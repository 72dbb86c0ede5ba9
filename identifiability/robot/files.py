"""Read robot files: MJCF and URDF through Pinocchio, and what Pinocchio leaves out of them."""

from __future__ import annotations

import os
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from identifiability.errors import ClosureError, RobotError, listing, near_match
from identifiability.names import INERTIAL_KINDS, Array
from identifiability.robot import closure
from identifiability.robot.description import Coupling, Loop, Robot, Transmission
from identifiability.robot.kinematics import WORLD, Joint, Point, Tree
from identifiability.robot.markup import as_file, read_markup
from identifiability.robot.sidecar import Sidecar, read_sidecar


def shipped_folder() -> Path:
    """Return the folder of the shipped robots (inside a wheel, or beside a checkout)."""
    inside = Path(str(resources.files("identifiability"))) / "models"
    return inside if inside.is_dir() else inside.parent.parent / "models"


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    return sorted(p.parent.name for p in shipped_folder().glob("*/robot.[xu]*"))


def locate_robot(source: str | Path) -> Path:
    """Return the robot file that a path or a shipped name stands for.

    Raises
    ------
    RobotError
    """
    path = Path(source)
    try:
        if path.is_file():
            return path
    except OSError as error:
        raise RobotError(f"'{source}' cannot be a robot file: {error.strerror}.") from None
    folder = shipped_folder() / str(source)
    for name in ("robot.xml", "robot.urdf"):
        if str(source) in shipped_robots() and (folder / name).is_file():
            return folder / name
    if path.is_dir():
        raise RobotError(f"{path} is a folder; give the robot file (MJCF or URDF) in it.")
    raise RobotError(
        f"There is no robot file '{source}'{near_match(str(source), shipped_robots())} Give an "
        f"MJCF or URDF file, or one of the shipped robots: {', '.join(shipped_robots())}."
    )


def read_robot(source: str | Path, sidecar: str | Path | None = None) -> Robot:
    """Read a robot; see `Robot.load`."""
    path = locate_robot(source)
    beside = path.with_suffix(".toml")
    chosen = Path(sidecar) if sidecar is not None else (beside if beside.is_file() else None)
    extra = read_sidecar(chosen)
    root = read_markup(path)
    if root.tag == "mujoco":
        model, loops, couplings, actuated = _read_mjcf(path, root)
    else:
        model, loops, couplings, actuated = _read_urdf(path, root)
    _check_bodies(path, root, model)
    tree = _read_tree(path, model, root)
    return _assemble(path, chosen, extra, model, tree, (loops, couplings, actuated))


Closures = tuple[Any, list[Loop], list[Coupling], list[str] | None]


def _read_mjcf(path: Path, root: ET.Element) -> Closures:
    """Build the Pinocchio model of an MJCF, with its closures and actuated joints."""
    try:
        with as_file(path, root) as file:
            model, points, _ = pin.buildModelAndConstraintsFromMJCF(str(file))
    except Exception as error:  # noqa: BLE001 - a foreign parser may raise anything
        raise RobotError(f"{path} cannot be read as MJCF: {_one_line(error)}.") from None
    loops = []
    for k, c in enumerate(points):
        first = Point(c.joint1_id - 1, np.array(c.joint1_placement.translation))
        second = Point(c.joint2_id - 1, np.array(c.joint2_placement.translation))
        loops.append(Loop(c.name or f"closure{k + 1}", first, second))
    wanted = root.findall("./equality/connect")
    if len(wanted) != len(loops):
        raise RobotError(
            f"{path} has {len(wanted)} active <connect> closures but {len(loops)} were read; name "
            "their bodies or sites as MuJoCo documents it."
        )
    radians = any(c.get("angle") == "radian" for c in root.findall("compiler"))
    refs = {}
    for j in root.iter("joint"):
        unit = 1.0 if radians or j.get("type") == "slide" else np.pi / 180
        refs[j.get("name")] = unit * float(j.get("ref", 0.0))
    couplings = [_read_coupling(e, refs) for e in root.findall("./equality/joint")]
    motors = [e.get("joint") for parent in root.findall("./actuator") for e in parent]
    # A joint may have several actuators, say one that holds a position and one that damps.
    actuated = list(dict.fromkeys(m for m in motors if m is not None)) or None
    return model, loops, couplings, actuated


def _read_coupling(element: ET.Element, refs: dict[str | None, float]) -> Coupling:
    """Return an MJCF joint equality as a polynomial of absolute positions."""
    joint, of = element.get("joint1", ""), element.get("joint2")
    coefficients = [float(c) for c in element.get("polycoef", "0 1 0 0 0").split()]
    # MuJoCo writes it in displacements from the reference positions.
    shift = np.polynomial.Polynomial([-refs.get(of, 0.0), 1.0])
    poly = np.polynomial.Polynomial(coefficients)(shift) + refs.get(joint, 0.0)
    values = poly.coef if of is not None else [coefficients[0] + refs.get(joint, 0.0)]
    return Coupling(element.get("name", joint), joint, of, tuple(float(c) for c in values))


def _read_urdf(path: Path, root: ET.Element) -> Closures:
    """Build the Pinocchio model of a URDF; mimic joints become couplings."""
    reason = ""
    with _printed_errors() as printed:
        try:
            model = pin.buildModelFromUrdf(str(path))
        except Exception as error:  # noqa: BLE001 - a foreign parser may raise anything
            reason = _one_line(error)
    if reason or printed:  # a link whose inertia is misspelt is read without any, but told of
        reason = printed[0] if printed else reason
        raise RobotError(f"{path} cannot be read as URDF: {reason}.")
    couplings, mimics = [], set()
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            name, of = joint.get("name", ""), mimic.get("joint", "")
            mimics.add(name)
            line = (float(mimic.get("offset", 0.0)), float(mimic.get("multiplier", 1.0)))
            couplings.append(Coupling(name, name, of, line))
    driven = [j for j in range(1, model.njoints) if model.joints[j].nv == 1]
    actuated = [model.names[j] for j in driven if model.names[j] not in mimics]
    return model, [], couplings, actuated


@contextmanager
def _printed_errors() -> Iterator[list[str]]:
    """Collect the errors that a C++ library prints instead of raising them."""
    found: list[str] = []
    with tempfile.TemporaryFile() as file:
        sys.stderr.flush()
        kept = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield found
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            marked = (line.partition("Error:") for line in lines)
            found += [" ".join(text.split()).rstrip(".") for _, mark, text in marked if mark]


def _one_line(error: Exception) -> str:
    text = str(error).rpartition("message:")[2]  # Pinocchio puts its source file before it
    return " ".join(text.split()).rstrip(".")[:300] or type(error).__name__


def _check_bodies(path: Path, root: ET.Element, model: Any) -> None:
    """Refuse a file of which the parser lost bodies."""
    read = {f.name for f in model.frames if f.type == pin.FrameType.BODY}
    if root.tag == "mujoco":
        what, wanted = (
            "bodies",
            [b.get("name", "") for w in root.findall("worldbody") for b in w.iter("body")],
        )
        advice = (
            "Pinocchio reads only the first body of <worldbody>, and only bodies with names: name "
            "them all and wrap the robot in one root <body>"
        )
    else:
        what, wanted = "links", [link.get("name", "") for link in root.findall("link")]
        advice = "connect them to the root link by joints"
    lost = [b or "one without a name" for b in wanted if b not in read]
    if lost and len(read) < len(wanted):
        raise RobotError(
            f"{path}: {len(wanted) - len(read)} of {len(wanted)} {what} were lost in reading "
            f"({listing(dict.fromkeys(lost))}); {advice}."
        )
    if model.njoints < 2:
        raise RobotError(f"{path} has no joint that moves; there is nothing to identify.")


_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


def _read_tree(path: Path, model: Any, root: ET.Element) -> Tree:
    """Take the joints off a Pinocchio model; a composite joint becomes one joint an axis.

    Joint k of Pinocchio ends at tree joint ``last[k]``, and loop points refer to that index.
    """
    joints: list[Joint] = []
    last = {0: WORLD}
    for index in range(1, model.njoints):
        whole = model.joints[index]
        placement = model.jointPlacements[index]
        parts, places = [whole], [placement]
        if whole.shortname() == "JointModelComposite":
            inner = whole.extract()
            parts = list(inner.joints)
            places = [placement * inner.jointPlacements[0], *list(inner.jointPlacements)[1:]]
        names = _dof_names(model, index, len(parts), root)
        parent = last[model.parents[index]]
        iq, iv = whole.idx_q, whole.idx_v
        for part, place, name in zip(parts, places, names, strict=True):
            joint = _read_joint(path, part, place, name, parent, iq, iv)
            joints.append(joint)
            parent = len(joints) - 1
            iq, iv = iq + joint.nq, iv + joint.nv
        last[index] = parent
    tree = Tree(tuple(joints))
    object.__setattr__(tree, "_last", last)
    return tree


def _dof_names(model: Any, index: int, count: int, root: ET.Element) -> list[str]:
    """Return the file's names of the joints in a Pinocchio joint."""
    if count == 1:
        return [model.names[index]]
    body = next(
        f.name for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == index
    )
    element = next(b for b in root.iter("body") if b.get("name") == body)
    named = [j.get("name") for j in element.findall("joint")]
    return [n or f"{body}_{k + 1}" for k, n in enumerate(named)]


def _read_joint(
    path: Path, part: Any, place: Any, name: str, parent: int, iq: int, iv: int
) -> Joint:
    kind = part.shortname().removeprefix("JointModel")
    R, p = np.array(place.rotation), np.array(place.translation)
    axis, unbounded = np.zeros(3), False
    if kind in ("RX", "RY", "RZ", "PX", "PY", "PZ"):
        axis = np.array(_AXES[kind[1]])
        type_ = "revolute" if kind[0] == "R" else "prismatic"
    elif kind in ("RUBX", "RUBY", "RUBZ"):
        axis, type_, unbounded = np.array(_AXES[kind[3]]), "revolute", True
    elif kind in ("RevoluteUnaligned", "RevoluteUnboundedUnaligned", "PrismaticUnaligned"):
        inner = part.extract() if hasattr(part, "extract") else part
        axis = np.array(inner.axis)
        type_ = "prismatic" if kind.startswith("P") else "revolute"
        unbounded = "Unbounded" in kind
    elif kind == "Spherical":
        type_ = "ball"
    elif kind == "FreeFlyer":
        type_ = "free"
    else:
        raise RobotError(
            f"{path}: joint '{name}' is of a type ({kind}) that is not supported; use hinge, "
            "slide, ball or free joints."
        )
    if type_ in ("revolute", "prismatic") and not abs(np.linalg.norm(axis) - 1) < 1e-6:
        raise RobotError(f"{path}: joint '{name}' has no axis; give one that is not all zero.")
    dofs = {
        "ball": tuple(f"{name}.{k}" for k in ("rx", "ry", "rz")),
        "free": tuple(f"{name}.{k}" for k in ("tx", "ty", "tz", "rx", "ry", "rz")),
    }.get(type_, (name,))
    return Joint(dofs, type_, parent, R, p, axis, iq, iv, unbounded)  # type: ignore[arg-type]


def _assemble(
    path: Path,
    sidecar: Path | None,
    extra: Sidecar,
    model: Any,
    tree: Tree,
    parts: tuple[list[Loop], list[Coupling], list[str] | None],
) -> Robot:
    """Put the parts together and check that they determine the motion."""
    loops, couplings, actuated = parts
    last: dict[int, int] = tree._last  # type: ignore[attr-defined]
    bodies = _body_names(model)
    loops = [
        replace(loop, first=_on_tree(loop.first, last), second=_on_tree(loop.second, last))
        for loop in loops
    ]
    shell = Robot(
        name=path.parent.name if path.stem == "robot" else path.stem,
        title=extra.name or model.name,
        path=path,
        sidecar=sidecar,
        model=model,
        tree=tree,
        bodies=bodies,
        body_symbols={b: extra.symbols.get(b, b) for b in bodies},
        joint_symbols=dict(extra.symbols),
        actuated=np.empty(0, int),
        dependent=np.empty(0, int),
        loops=tuple(loops),
        couplings=tuple(couplings),
        loop_rows=np.empty(0, int),
        home=_home(model),
        nominal={},
        body_order=bodies,
        limits=np.empty((0, 2)),
        speed_limits=np.empty(0),
        acceleration_limits=np.empty(0),
        inertia_parts=tuple(extra.inertia_parts),
        prior_relative=extra.prior_relative,
        prior={name: (entry.mean, entry.sd) for name, entry in extra.prior.items()},
        ties=tuple({k: tuple(v) for k, v in s.tie.items()} for s in extra.symmetry),
    )
    known = (*bodies, *shell.dofs, *(extra.transmission.motors if extra.transmission else ()))
    _check_known(path, "symbols", extra.symbols, known)
    _check_known(path, "base_parameters.bodies", extra.base_parameters.bodies, bodies)
    _check_known(path, "limits", extra.limits, shell.dofs)
    tied = [name for s in extra.symmetry for members in s.tie.values() for name in members]
    for key, names in (("nominal", extra.nominal), ("symmetry", tied)):
        _check_known(path, key, (name.rpartition(".")[0] for name in names), known)
    if extra.base_parameters.bodies:
        named = tuple(extra.base_parameters.bodies)
        shell = replace(shell, body_order=named + tuple(b for b in bodies if b not in named))
    if extra.loops is not None:
        shell = replace(
            shell, loops=tuple(_sidecar_loop(path, e, model, last) for e in extra.loops)
        )
    if extra.couplings:
        added = (
            Coupling(c.name or c.joint, c.joint, c.of, tuple(c.polynomial)) for c in extra.couplings
        )
        shell = replace(shell, couplings=tuple(added))
    robot = _choose_joints(shell, extra, actuated)
    robot = replace(
        robot,
        nominal=_nominal(robot, extra),
        limits=_limits(robot, extra),
        speed_limits=_rate_limits(robot, extra, "v"),
        acceleration_limits=_rate_limits(robot, extra, "a"),
    )
    return replace(robot, transmission=_transmission(robot, extra))


def _on_tree(point: Point, last: dict[int, int]) -> Point:
    """Move a point's joint from Pinocchio's numbering (less one) to the tree's."""
    return Point(last[point.joint + 1], point.position)


def _check_known(path: Path, key: str, given: Any, known: tuple[str, ...]) -> None:
    for name in given:
        if name not in known:
            raise RobotError(
                f"The sidecar of {path}: [{key}] names '{name}', which the robot does not have"
                f"{near_match(name, known)} Known: {listing(known)}."
            )


def _body_names(model: Any) -> tuple[str, ...]:
    """Return the body behind each Pinocchio joint."""
    names = []
    for index in range(1, model.njoints):
        frames = [
            f for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == index
        ]
        direct = [f for f in frames if model.frames[f.parentFrame].type == pin.FrameType.JOINT]
        names.append((direct or frames)[0].name if frames else model.names[index])
    return tuple(names)


def _home(model: Any) -> Array:
    """Return the keyframe ``home``, else another keyframe, else the zero configuration."""
    keys = {e.key(): np.array(e.data()) for e in model.referenceConfigurations}
    for name in ("home", *(k for k in keys if k != "qpos0"), "qpos0"):
        if name in keys and len(keys[name]) == model.nq:
            return keys[name]
    return np.array(pin.neutral(model))


def _sidecar_loop(path: Path, entry: Any, model: Any, last: dict[int, int]) -> Loop:
    ends = []
    for body, point in ((entry.body1, entry.point1), (entry.body2, entry.point2)):
        frames = [f for f in model.frames if f.name == body and f.type == pin.FrameType.BODY]
        if not frames:
            known = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
            raise RobotError(
                f"The sidecar of {path}: a loop names the body '{body}', which the robot does not "
                f"have{near_match(body, known)} Known: {listing(known)}."
            )
        place = frames[0].placement
        position = np.array(place.rotation) @ np.array(point) + np.array(place.translation)
        ends.append(Point(last[frames[0].parentJoint], position))
    axes = tuple("xyz".index(a) for a in entry.axes)
    stated = ((entry.body1, entry.point1), (entry.body2, entry.point2))
    return Loop(entry.name or f"{entry.body1}-{entry.body2}", ends[0], ends[1], axes, stated)


def _choose_joints(robot: Robot, extra: Sidecar, actuated: list[str] | None) -> Robot:
    """Split the degrees of freedom into actuated and dependent ones, and check the count."""
    names = extra.actuated if extra.actuated is not None else actuated
    names = list(robot.dofs) if names is None else names
    index = np.array([robot.dof_index(n) for n in names], int)
    if len(set(names)) != len(names) or not names:
        raise RobotError(f"{robot.path}: the actuated joints are {names}; name each one once.")
    dependent = np.array([k for k in range(robot.nv) if k not in set(index.tolist())], int)
    robot = replace(robot, actuated=index, dependent=dependent)
    home = np.array(robot.home)
    for name, value in extra.home.items():
        joint = next(j for j in robot.tree.joints if j.iv == robot.dof_index(name))
        home[joint.iq] = value
    robot = replace(robot, home=home)
    equations = sum(len(loop.axes) for loop in robot.loops) + len(robot.couplings)
    if not len(dependent) and not equations:
        return robot
    robot = replace(robot, loop_rows=np.arange(equations))
    rows = closure.independent_rows(robot) if equations else np.empty(0, int)
    if len(rows) < len(dependent):
        raise RobotError(
            f"{robot.path}: {len(dependent)} joints have no actuator ({listing(robot.passive)}) "
            f"but the loops give only {len(rows)} independent equations; name the missing "
            "actuated joints (<actuator> in MJCF, 'actuated' in the sidecar), add the closures, or "
            "choose a home position away from singularities."
        )
    if len(rows) > len(dependent):
        raise RobotError(
            f"{robot.path}: the loops give {len(rows)} independent equations for "
            f"{len(dependent)} passive joints, so not all {len(index)} actuated joints are free; "
            "remove an actuator or a closure."
        )
    robot = replace(robot, loop_rows=rows)
    try:
        closure.check_home(robot)
    except ClosureError as error:
        raise RobotError(str(error)) from None
    return robot


def _nominal(robot: Robot, extra: Sidecar) -> dict[str, float]:
    """Return the parameter values that the files state, by name."""
    model = robot.model
    values: dict[str, float] = {}
    for k, body in enumerate(robot.bodies):
        pi = model.inertias[k + 1].toDynamicParameters()
        values.update(
            {f"{body}.{kind}": float(v) for kind, v in zip(INERTIAL_KINDS, pi, strict=True)}
        )
    friction = np.array(model.upperDryFrictionLimit)
    for dof, name in enumerate(robot.dofs):
        finite = float(friction[dof]) if np.isfinite(friction[dof]) else 0.0
        values[f"{name}.Fv"] = float(model.damping[dof])
        for kind in ("Fc", "Fc+", "Fc-"):
            values[f"{name}.{kind}"] = finite
        parts = robot.inertia_parts
        values[f"{name}.{parts[0]}"] = float(model.armature[dof])
        values.update({f"{name}.{part}": 0.0 for part in parts[1:]})
    values.update(extra.nominal)
    return values


def _limits(robot: Robot, extra: Sidecar) -> Array:
    """Return the position limits of the actuated joints, (n, 2)."""
    out = np.tile([-np.inf, np.inf], (len(robot.actuated), 1))
    for row, (name, dof) in enumerate(zip(robot.joints, robot.actuated, strict=True)):
        joint = next(j for j in robot.tree.joints if j.iv == dof)
        lower = float(robot.model.lowerPositionLimit[joint.iq])
        upper = float(robot.model.upperPositionLimit[joint.iq])
        if not joint.unbounded and lower < upper and max(abs(lower), abs(upper)) < 1e6:
            out[row] = lower, upper
        given = extra.limits.get(name)
        if given is not None and given.q is not None:
            out[row] = given.q
    return out


def _rate_limits(robot: Robot, extra: Sidecar, kind: Literal["v", "a"]) -> Array:
    """Return velocity or acceleration limits of the actuated joints, (n,)."""
    given = [extra.limits.get(name) for name in robot.joints]
    values = [None if g is None else getattr(g, kind) for g in given]
    return np.array([np.inf if v is None else v for v in values], float)


def _transmission(robot: Robot, extra: Sidecar) -> Transmission | None:
    entry, n = extra.transmission, len(robot.actuated)
    if entry is None:
        return None
    square = len(entry.coupling) == n and all(len(row) == n for row in entry.coupling)
    coupling = np.array(entry.coupling, float) if square else np.zeros((n, n))
    if len(entry.motors) != n or not np.linalg.cond(coupling) < 1e9:
        raise RobotError(
            f"The sidecar of {robot.path}: [transmission] needs {n} motors and an invertible "
            f"{n}×{n} coupling for the actuated joints {listing(robot.joints)}."
        )
    ratio = np.ones(n) if entry.ratio is None else np.array(entry.ratio, float)
    offset = np.zeros(n) if entry.offset is None else np.array(entry.offset, float)
    if ratio.shape != (n,) or offset.shape != (n,) or not np.all(ratio):
        raise RobotError(
            f"The sidecar of {robot.path}: [transmission] needs {n} non-zero ratios and {n} "
            "offsets."
        )
    return Transmission(tuple(entry.motors), coupling, ratio, offset)
